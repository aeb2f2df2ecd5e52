"""A ROS bag as a camera."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from contextlib import ExitStack
from itertools import islice, pairwise
from pathlib import Path
from statistics import median
from types import TracebackType
from typing import Any, Self

from config.camera import OdometryChoice
from hal.cameras.bag_calibration import read_calibration, read_transforms
from hal.cameras.bag_exposures import Exposures
from hal.cameras.bag_file import BagFile, until_damage
from hal.cameras.bag_gyro import ColourCamera, read_gyro
from hal.cameras.bag_images import colour_image, depth_image
from hal.cameras.bag_odometry import read_odometry
from hal.cameras.bag_topics import BagTopics, WantedTopics, choose_topics
from hal.cameras.bag_transforms import StaticTransforms
from hal.cameras.calibration import RecordingCalibration
from hal.cameras.image_file import ImageError
from hal.cameras.pose_track import PoseTrack
from hal.cameras.recording import SkippedFrame
from hal.cameras.stamp_pairing import Stamped, StampPairing
from hal.cameras.tum_index import format_stamp
from hal.clocks import NS_PER_S
from hal.errors import BadRecording, DeviceRefused, EndOfStream
from hal.types import CameraMount, Intrinsics, RgbdFrame

_ANY_TOPICS = WantedTopics()
_FPS_SAMPLE = 10
_REMAINDER = "the rest"


class BagReplay:
    """Recording over the images of a bag of ROS 1 or ROS 2, or of a RealSense viewer (.db3).

    The constructor reads topics, calibration and odometry (raises BadRecording, and DeviceNotFound if rosbags
    is not installed); images are read after entering. captured_ns is the time of the colour image.
    odometry: the chosen poses, None if there are none. gyro: its readings, None if there are none or they are
    not to be used. Entering again starts from the beginning.
    """

    def __init__(
        self,
        path: Path,
        odometry: OdometryChoice = "auto",
        wanted: WantedTopics = _ANY_TOPICS,
        max_pair_gap_s: float = 0.02,
        use_gyro: bool = True,
    ) -> None:
        self._path, self._max_gap_ns = path, round(max_pair_gap_s * NS_PER_S)
        with BagFile(path) as bag:
            self._topics = choose_topics(path, bag.topics, wanted, with_odometry=odometry != "none")
            transforms = read_transforms(bag)
            camera, frame, notes = read_calibration(bag, self._topics, transforms)
            self.odometry, odometry_notes = _odometry(bag, self._topics, odometry, frame, transforms)
            colour, depth = self._topics.colour.name, self._topics.depth.name
            self._exposures = Exposures(bag, (colour, depth))
            of = ColourCamera(colour, frame, self._exposures.clock)
            self.gyro, gyro_notes = read_gyro(bag, wanted.gyro, of, transforms) if use_gyro else (None, ())
            self.fps = _estimate_fps(bag, colour, self._exposures)
        self._calibration = RecordingCalibration(camera)
        self._notes = (*notes, *odometry_notes, *gyro_notes)
        self._messages: Iterator[tuple[str, Any]] | None = None
        self._closing = ExitStack()
        self._rewind()

    @property
    def intrinsics(self) -> Intrinsics:
        """The intrinsics of the undistorted images that read() gives."""
        return self._calibration.intrinsics

    @property
    def mount(self) -> CameraMount | None:
        """None: a bag does not give the height of its camera above the floor."""
        return None

    @property
    def frame_count(self) -> int:
        """Number of colour or of depth images, whichever is smaller."""
        return min(self._topics.colour.messages, self._topics.depth.messages)

    @property
    def skipped(self) -> tuple[SkippedFrame, ...]:
        """What could not be used so far, and why, in the order of the recording."""
        return tuple(self._skipped)

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences for the summary: what was chosen, assumed or left out."""
        colour, depth = self._pairing.colour, self._pairing.depth
        counted = {
            "colour images without depth of the same time": colour.unpaired,
            "depth images without colour of the same time": depth.unpaired,
            "images not later than the one before, left out": colour.out_of_order + depth.out_of_order,
        }
        chosen = f"colour is {self._topics.colour.name}, depth {self._topics.depth.name}"
        found = tuple(f"{count} {what}" for what, count in counted.items() if count)
        return (chosen, *self._notes, *found)

    def __enter__(self) -> Self:
        """Open the bag. Raises BadRecording."""
        self._rewind()
        bag = self._closing.enter_context(BagFile(self._path))
        self._messages = bag.messages((self._topics.colour.name, self._topics.depth.name))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._messages = None
        self._closing.close()

    def read(self, timeout_s: float) -> RgbdFrame:
        """The next usable frame. timeout_s has no effect, because a recording is never late.

        Raises EndOfStream after the last frame, BadRecording instead if not one frame was usable,
        DeviceRefused outside of a with block.
        """
        if self._messages is None:
            raise DeviceRefused(f"{self._path}: the recording is not open; read it inside a with block")
        while self._pairs or not self._ended:
            if not self._pairs:
                self._read_message(self._messages)
                continue
            outcome = self._load(*self._pairs.popleft())
            if isinstance(outcome, RgbdFrame):
                self._usable += 1
                return outcome if self.gyro is None else self.gyro.attach(outcome)
            self._skipped.append(outcome)
        if self._usable == 0:
            raise BadRecording(f"{self._path}: not one frame is usable; {self._no_frame_reason()}")
        raise EndOfStream(f"{self._path}: no further frame")

    def _no_frame_reason(self) -> str:
        if not self._skipped:
            return "check the times of its images"
        first = self._skipped[0]
        return first.reason if first.file == _REMAINDER else f"the first: {first}"

    def skip_until(self, until_ns: int) -> None:
        """Skip, without decoding, every frame that is followed by another one not later than until_ns."""
        while self._messages is not None:
            while len(self._pairs) < 2 and not self._ended:
                self._read_message(self._messages)
            if len(self._pairs) < 2 or self._pairs[1][0].stamp_ns > until_ns:
                return
            self._pairs.popleft()

    def _rewind(self) -> None:
        self._pairing: StampPairing[Any] = StampPairing(self._max_gap_ns)
        self._pairs: deque[tuple[Stamped[Any], Stamped[Any]]] = deque()
        self._skipped: list[SkippedFrame] = []
        self._usable, self._messages_read, self._ended = 0, 0, False
        if self.gyro is not None:
            self.gyro.rewind()

    def _read_message(self, messages: Iterator[tuple[str, Any]]) -> None:
        try:
            topic, message = next(messages)
        except StopIteration:
            self._finish()
        except BadRecording as error:
            # Everything before the damage is valid and stays usable.
            self._skipped.append(SkippedFrame(_REMAINDER, str(error)))
            self._ended = True
        else:
            self._messages_read += 1
            is_colour = topic == self._topics.colour.name
            stream = self._pairing.colour if is_colour else self._pairing.depth
            stream.add(self._exposures.stamp_ns(topic, message), message)
        self._pairs.extend(self._pairing.pairs(self._ended))

    def _finish(self) -> None:
        """Compare with the number of messages in the bag's index: a storage format may skip damage
        silently."""
        self._ended = True
        expected = self._topics.colour.messages + self._topics.depth.messages
        if self._messages_read < expected:
            reason = (
                f"{expected - self._messages_read} of {expected} images cannot be found; the bag is damaged"
            )
            self._skipped.append(SkippedFrame(_REMAINDER, reason))

    def _load(self, colour: Stamped[Any], depth: Stamped[Any]) -> RgbdFrame | SkippedFrame:
        calibration = self._calibration
        topic, stamp = self._topics.colour.name, colour.stamp_ns
        try:
            bgr = colour_image(colour.item, calibration.intrinsics.width, calibration.intrinsics.height)
            topic, stamp = self._topics.depth.name, depth.stamp_ns
            depth_units = depth_image(depth.item, calibration.depth_width, calibration.depth_height)
        except ImageError as error:
            return SkippedFrame(f"{topic} at {format_stamp(stamp)}", str(error))
        bgr, depth_units = calibration.rectify(bgr, depth_units)
        return RgbdFrame(
            colour=bgr,
            depth=depth_units,
            depth_scale_m=calibration.depth_scale_m,
            captured_ns=colour.stamp_ns,
            device_s=colour.stamp_ns / NS_PER_S,
            sequence=colour.number,
            intrinsics=calibration.intrinsics,
        )


def _estimate_fps(bag: BagFile, topic: str, exposures: Exposures) -> float | None:
    """The rate of the first images. The duration of the bag cannot be used, because other topics may begin
    earlier and end later."""
    first = islice(until_damage(bag.messages((topic,))), _FPS_SAMPLE)
    stamps_ns = [exposures.stamp_ns(topic, message) for _, message in first]
    gaps_ns = [after - before for before, after in pairwise(stamps_ns) if after > before]
    return NS_PER_S / median(gaps_ns) if gaps_ns else None


def _odometry(
    bag: BagFile, topics: BagTopics, choice: OdometryChoice, camera: str, transforms: StaticTransforms
) -> tuple[PoseTrack | None, tuple[str, ...]]:
    """The chosen poses, and notes for the summary. Raises BadRecording."""
    if choice == "groundtruth":
        raise BadRecording(f"{bag.path}: a bag has no groundtruth.txt; choose another odometry, or none")
    if choice == "none" or (choice == "auto" and topics.odometry is None):
        return None, ()
    if topics.odometry is None:
        raise BadRecording(f"{bag.path}: no odometry was recorded (nav_msgs/Odometry); choose auto, or none")
    try:
        return read_odometry(bag, topics.odometry, camera, transforms), ()
    except BadRecording as error:
        if choice == "file":
            raise
        return None, (f"odometry is not used: {error}",)
