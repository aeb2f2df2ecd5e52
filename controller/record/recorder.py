"""What is kept of a run or a replay: observations as JSON lines, an annotated video, and the frames."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from os.path import realpath
from pathlib import Path as FilePath

import numpy as np

from config.robot import Body
from controller.control import ControlStep
from controller.decision.decision import Decision
from controller.errors import UserError
from controller.path.path import Path
from controller.perceive import Look
from controller.record.frame_recorder import FrameRecorder
from controller.record.observations import ObservationFile
from controller.video.compose import Composer
from controller.video.moment import VideoMoment
from controller.video.writer import VideoWriter
from hal.cameras.tum_writer import TumWriter
from hal.geometry import body_in_floor
from hal.types import CameraMount, FloatArray, PlanarPose

PATH_SHOWN_M = 12.0
PATH_STEP_M = 0.25


@dataclass(frozen=True, slots=True)
class RecordingOptions:
    """Files to write, and a folder for the frames; None: not wanted. timed: time is not simulated, so write
    the measured durations, and leave out frames rather than wait for them to be written."""

    observations: FilePath | None = None
    video: FilePath | None = None
    frames: FilePath | None = None
    timed: bool = True


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What the video shows around the observations; None: not known. fps: pictures a second."""

    mount: CameraMount | None
    body: Body | None
    corridor_half_width_m: float | None
    fps: float
    top_speed_mps: float
    range_m: float


class Recorder:
    """Writes looks with the decision that used them."""

    def __init__(
        self,
        observations: ObservationFile | None,
        video: VideoWriter | None,
        frames: FrameRecorder | None,
        surroundings: Surroundings,
        timed: bool,
    ) -> None:
        self._observations = observations
        self._video = video
        self._frames = frames
        self._composer = Composer(surroundings.top_speed_mps, surroundings.range_m)
        self._surroundings = surroundings
        self._timed = timed

    def record(
        self,
        look: Look,
        decision: Decision | None,
        commanded_mps: float | None = None,
        measured_mps: float | None = None,
        path_ahead_m: FloatArray | None = None,
    ) -> None:
        """One frame. path_ahead_m: (N, 2) in the body frame."""
        if self._observations is not None:
            self._observations.write(look.scene, decision, look.timing_ms if self._timed else {})
        if self._frames is not None:
            self._frames.write(look.frame, look.camera_pose)
        if self._video is not None:
            around = self._surroundings
            moment = VideoMoment(
                look.frame,
                look.scene,
                look.fragments,
                decision,
                commanded_mps,
                measured_mps,
                around.mount,
                around.body,
                path_ahead_m,
                around.corridor_half_width_m,
            )
            self._video.write(self._composer.compose(moment))


def require_two_files(observations: FilePath | None, video: FilePath | None) -> None:
    """Raises UserError where both name the same file: each would write over the other."""
    if observations is not None and video is not None and realpath(observations) == realpath(video):
        raise UserError(f"{observations}: is to hold the observations and the video; name two files")


def require_writable(options: RecordingOptions) -> None:
    """Before a robot is armed for a drive that another process records. Raises UserError, HalError."""
    require_two_files(options.observations, options.video)
    if options.observations is not None:
        with ObservationFile(options.observations):
            pass
    if options.video is not None:
        VideoWriter(options.video, fps=1.0)
    if options.frames is not None:
        TumWriter(options.frames).prepare()


@contextmanager
def open_recorder(options: RecordingOptions, surroundings: Surroundings) -> Iterator[Recorder]:
    """A recorder whose files are complete when the block ends. Raises VideoError, UserError, HalError."""
    require_two_files(options.observations, options.video)
    with ExitStack() as files:
        observations = video = frames = None
        if options.observations is not None:
            observations = files.enter_context(ObservationFile(options.observations))
        if options.video is not None:
            video = files.enter_context(VideoWriter(options.video, surroundings.fps))
        if options.frames is not None:
            writer = files.enter_context(TumWriter(options.frames, surroundings.mount))
            frames = files.enter_context(FrameRecorder(writer, options.frames, may_drop=options.timed))
        yield Recorder(observations, video, frames, surroundings, options.timed)


class RunRecorder:
    """Pairs each look with the first control step whose decision knew it, which comes some latency later."""

    def __init__(self, recorder: Recorder, path: Path) -> None:
        self._recorder = recorder
        self._path = path
        self._waiting: deque[Look] = deque()

    def saw(self, look: Look) -> None:
        """A look whose decision is still to come."""
        self._waiting.append(look)

    def decided(self, step: ControlStep) -> None:
        """Records every look that step's decision knew."""
        while (
            self._waiting
            and step.scene_sequence is not None
            and self._waiting[0].scene.sequence <= step.scene_sequence
        ):
            self._recorder.record(
                self._waiting.popleft(),
                step.decision,
                step.setpoint.v_mps,
                step.chassis.v_mps,
                path_ahead(self._path, step.progress_m, step.pose) if step.ahead_m is None else step.ahead_m,
            )

    def finish(self) -> None:
        """Records what no decision has used: the run ended first."""
        while self._waiting:
            self._recorder.record(self._waiting.popleft(), None)


def path_ahead(path: Path, progress_m: float, body: PlanarPose) -> FloatArray:
    """(N, 2) points of the path from progress_m on, in the body frame."""
    end_m = min(progress_m + PATH_SHOWN_M, path.length_m)
    s_m = np.arange(progress_m, end_m + PATH_STEP_M, PATH_STEP_M).clip(max=end_m)
    x_m, y_m, _ = path.poses(s_m)
    floor = np.column_stack([x_m, y_m, np.zeros_like(x_m)])
    return body_in_floor(body).inverse().apply(floor)[:, :2]
