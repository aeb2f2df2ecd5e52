"""What is kept of a run or a replay: observations as JSON lines, an annotated video, and the frames."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from os.path import realpath
from pathlib import Path as FilePath

from config.own_parts import OwnPart
from config.robot import Body
from controller.control import ControlStep
from controller.decision.decision import Decision
from controller.errors import UserError
from controller.path.path import Path
from controller.perceive import Look
from controller.record.frame_recorder import FrameRecorder
from controller.record.observations import ObservationFile
from controller.record.output_isolation import OutputIsolation
from controller.terminal.outlet import say
from controller.video.compose import Composer
from controller.video.moment import VideoMoment
from controller.video.pace import PacedVideo
from controller.video.writer import VideoWriter
from hal.cameras.tum_writer import TumWriter
from hal.types import CameraMount, FloatArray

# Frame rate of the video of a drive in real time: two cores that also perceive encode no more in VP8.
MAX_REAL_TIME_FPS = 10.0
# Half a second of a camera with 90 frames a second: no decision uses an older scene.
MAX_WAITING = 45


@dataclass(frozen=True, slots=True)
class RecordingOptions:
    """Files to write, and a folder for the frames; None: not wanted. timed: time is not simulated, so write
    the measured durations, and leave out frames rather than wait for them to be written."""

    observations: FilePath | None = None
    video: FilePath | None = None
    frames: FilePath | None = None
    timed: bool = True

    @property
    def paths(self) -> list[FilePath]:
        """All files and folders to be written."""
        return [path for path in (self.observations, self.video, self.frames) if path is not None]


@dataclass(frozen=True, slots=True)
class VideoSettings:
    """What the video shows besides the observations; None: not known. fps: pictures a second. own_parts:
    parts of the robot that its camera sees."""

    mount: CameraMount | None
    body: Body | None
    corridor_half_width_m: float | None
    fps: float
    top_speed_mps: float
    range_m: float
    own_parts: tuple[OwnPart, ...] = ()


class Recorder:
    """Writes looks with the decision that used them."""

    def __init__(
        self,
        observations: ObservationFile | None,
        video: PacedVideo | None,
        frames: FrameRecorder | None,
        settings: VideoSettings,
        timed: bool,
        output_isolation: OutputIsolation | None = None,
    ) -> None:
        self._isolation = output_isolation or OutputIsolation()
        self._observations = observations
        self._video = video
        self._frames = frames
        self._composer = Composer(settings.top_speed_mps, settings.range_m)
        self._settings = settings
        self._timed = timed

    @property
    def records(self) -> bool:
        """Whether there is any output that can still be written."""
        return any(map(self._isolation.is_active, (self._observations, self._frames, self._video)))

    def record(
        self,
        look: Look,
        decision: Decision | None,
        commanded_mps: float | None = None,
        measured_mps: float | None = None,
        path_ahead_m: FloatArray | None = None,
        ending: str = "",
    ) -> None:
        """Write one frame to every output. path_ahead_m: (N, 2) in the body frame; ending: see
        VideoMoment."""
        observations, frames, video = self._observations, self._frames, self._video
        if observations is not None and self._isolation.is_active(observations):
            with self._isolation.guard(observations):
                observations.write(look.scene, decision, look.timing_ms if self._timed else {})
        if frames is not None and self._isolation.is_active(frames):
            with self._isolation.guard(frames):
                frames.write(look.frame, look.camera_pose)
        if video is not None and self._isolation.is_active(video):
            settings = self._settings
            moment = VideoMoment(
                frame=look.frame,
                scene=look.scene,
                fragments=look.fragments,
                decision=decision,
                commanded_mps=commanded_mps,
                measured_mps=measured_mps,
                mount=settings.mount,
                body=settings.body,
                path_ahead_m=path_ahead_m,
                corridor_half_width_m=settings.corridor_half_width_m,
                ending=ending,
                own_parts=settings.own_parts,
            )
            with self._isolation.guard(video):
                video.write(self._composer.compose(moment), look.frame.captured_ns)


def require_two_files(observations: FilePath | None, video: FilePath | None) -> None:
    """Raise UserError if both name the same file: each would overwrite the other."""
    if observations is not None and video is not None and realpath(observations) == realpath(video):
        raise UserError(f"{observations}: cannot hold both the observations and the video; name two files")


def require_writable(options: RecordingOptions) -> None:
    """Check, before a robot is armed, that another process can record the drive. Raises UserError,
    HalError."""
    require_two_files(options.observations, options.video)
    if options.observations is not None:
        with ObservationFile(options.observations):
            pass
    if options.video is not None:
        VideoWriter(options.video, fps=1.0)
    if options.frames is not None:
        TumWriter(options.frames).prepare()


@contextmanager
def open_recorder(
    options: RecordingOptions, settings: VideoSettings, cut_off: Callable[[str], None] | None = None
) -> Iterator[Recorder]:
    """A recorder whose files are complete when the block ends. cut_off: see OutputIsolation.

    Raises VideoError, UserError, HalError: where cut_off is given, only if a file cannot be opened.
    """
    require_two_files(options.observations, options.video)
    output_isolation = OutputIsolation(cut_off)
    with ExitStack() as files:
        observations = video = frames = None
        if options.observations is not None:
            observations = files.enter_context(output_isolation.open(ObservationFile(options.observations)))
        if options.video is not None:
            # A replay waits for the encoder; a drive in real time must not.
            in_real_time = cut_off is not None
            fps = min(settings.fps, MAX_REAL_TIME_FPS) if in_real_time else settings.fps
            paced = PacedVideo(VideoWriter(options.video, fps), fps, may_drop=in_real_time)
            video = files.enter_context(output_isolation.open(paced))
        if options.frames is not None:
            writer = files.enter_context(TumWriter(options.frames, settings.mount))
            recorder = FrameRecorder(writer, options.frames, may_drop=options.timed)
            frames = files.enter_context(output_isolation.open(recorder))
        yield Recorder(observations, video, frames, settings, options.timed, output_isolation)


class RunRecorder:
    """Pairs each look with the first control step whose decision used it, which comes some latency later.

    They are paired by the time of the frame, because sequence numbers restart with the camera. A look that
    waits for longer than a decision can take is recorded without one: each waiting frame takes some 2 MB.
    """

    def __init__(self, recorder: Recorder, path: Path) -> None:
        self._recorder = recorder
        self._path = path
        self._waiting: deque[Look] = deque()
        self._undecided = 0
        self._last_step: ControlStep | None = None

    def add_look(self, look: Look) -> None:
        """Add a look whose decision is still to come."""
        if not self._recorder.records:
            return
        self._waiting.append(look)
        if len(self._waiting) > MAX_WAITING:
            self._undecided += 1
            self._recorder.record(self._waiting.popleft(), None)

    def add_step(self, step: ControlStep) -> None:
        """Record every look that the decision of this control step used."""
        self._last_step = step
        if not any(look.scene.captured_ns == step.scene_ns for look in self._waiting):
            return
        known = False
        while not known:
            look = self._waiting.popleft()
            known = look.scene.captured_ns == step.scene_ns
            self._recorder.record(
                look,
                step.decision,
                step.setpoint.v_mps,
                step.chassis.v_mps,
                self._path.ahead(step.progress_m, step.pose) if step.ahead_m is None else step.ahead_m,
            )

    def finish(self, ending: str = "drive ended") -> None:
        """Record the looks that no decision has used, because the drive ended first, with the last speeds.
        Print how many looks were recorded without a decision for another reason.

        ending: how the drive ended, for the video.
        """
        last = self._last_step
        commanded_mps = None if last is None else last.setpoint.v_mps
        measured_mps = None if last is None else last.chassis.v_mps
        while self._waiting:
            self._recorder.record(self._waiting.popleft(), None, commanded_mps, measured_mps, ending=ending)
        if self._undecided:
            reason = f"none came within {MAX_WAITING} frames"
            say(
                f"treadwatch: {self._undecided} frames were recorded without a decision: {reason}",
                to_stderr=True,
            )
