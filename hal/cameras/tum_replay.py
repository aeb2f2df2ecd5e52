"""A recording in a TUM RGB-D folder as a camera."""

from __future__ import annotations

import os
import stat
from bisect import bisect_left
from collections import deque
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from statistics import median
from types import TracebackType
from typing import Self

from hal.cameras.calibration import RecordingCalibration
from hal.cameras.gyro_file import read_gyro
from hal.cameras.image_file import ImageError, read_colour, read_depth
from hal.cameras.recording import SkippedFrame
from hal.cameras.tum_index import ImageIndex, IndexEntry, associate, read_index
from hal.clocks import NS_PER_S
from hal.errors import BadRecording, DeviceRefused, EndOfStream
from hal.types import CameraMount, Intrinsics, RgbdFrame

_REQUIRED_FILES = ("rgb.txt", "depth.txt", "camera.yaml")
_FORMAT_HINT = (
    "a recording is a folder with rgb.txt, depth.txt, camera.yaml and the images they name, or a ROS bag "
    "(.bag, .db3, .mcap, or the folder around it)"
)


@dataclass(frozen=True, slots=True)
class _Pair:
    """One frame to be read. sequence counts the colour images, so a gap shows an image without depth."""

    sequence: int
    colour: IndexEntry
    depth: IndexEntry


class TumReplay:
    """FrameSource over a folder with rgb.txt, depth.txt, camera.yaml (config/recording.py), maybe gyro.txt.

    The constructor reads index, calibration and gyro (raises BadRecording); images are read after entering.
    captured_ns is the recorded time of the colour image. A frame that cannot be used is left out and listed
    in ``skipped``. Entering again starts from the beginning.
    """

    def __init__(
        self, folder: Path, max_pair_gap_s: float = 0.02, read_ahead: int = 2, use_gyro: bool = True
    ) -> None:
        """read_ahead: frames that one background thread decodes in advance; 0: decode in read()."""
        self._folder = folder
        _require_recording(folder)
        self._calibration = RecordingCalibration.from_file(folder / "camera.yaml")
        colour, depth = read_index(folder / "rgb.txt"), read_index(folder / "depth.txt")
        self._pairs = _pairs(folder, colour, depth, max_pair_gap_s)
        self.gyro, bad_readings = read_gyro(folder) if use_gyro else (None, ())
        self._bad_lines = colour.bad_lines + depth.bad_lines + bad_readings
        self.unpaired_colour = len(colour.entries) - len(self._pairs)
        self.unpaired_depth = len(depth.entries) - len(self._pairs)
        self.duplicates = colour.duplicates + depth.duplicates
        self._unsorted = colour.unsorted + depth.unsorted
        self._read_ahead = read_ahead
        self._reader: ThreadPoolExecutor | None = None
        self._rewind()

    @property
    def intrinsics(self) -> Intrinsics:
        """The intrinsics of the undistorted images that read() gives."""
        return self._calibration.intrinsics

    @property
    def mount(self) -> CameraMount | None:
        """Where the camera sat on the robot; None if the recording does not say."""
        return self._calibration.mount

    @property
    def frame_count(self) -> int:
        """Number of pairs of colour and depth; some may turn out to be unusable."""
        return len(self._pairs)

    @property
    def fps(self) -> float | None:
        """The rate in camera.yaml, else the median rate of the colour images; None for a single frame."""
        if self._calibration.camera.fps is not None or len(self._pairs) < 2:
            return self._calibration.camera.fps
        return NS_PER_S / median(b.colour.stamp_ns - a.colour.stamp_ns for a, b in pairwise(self._pairs))

    @property
    def skipped(self) -> tuple[SkippedFrame, ...]:
        """What could not be used so far, and why, in the order of the recording; bad index lines first."""
        return self._bad_lines + tuple(self._skipped)

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences for the summary: what was assumed, left out or put in order."""
        counted = {
            "colour images without depth of the same time": self.unpaired_colour,
            "depth images without colour of the same time": self.unpaired_depth,
            "images with the time of an earlier one, left out": self.duplicates,
            "index lines out of time order, sorted": self._unsorted,
        }
        return self._calibration.notes + tuple(f"{count} {what}" for what, count in counted.items() if count)

    def __enter__(self) -> Self:
        self._rewind()
        # OpenCV decodes without the interpreter's lock, so the images of the next frames are decoded while
        # this one is processed. A single thread keeps the recorded order.
        self._reader = ThreadPoolExecutor(max_workers=1, thread_name_prefix="tum-replay")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._reader is not None:
            self._reader.shutdown(wait=True, cancel_futures=True)
            self._reader = None
        self._futures.clear()

    def read(self, timeout_s: float) -> RgbdFrame:
        """The next usable frame. timeout_s has no effect, because a recording is never late.

        Raises EndOfStream after the last frame, BadRecording instead if not one frame was usable,
        DeviceRefused outside of a with block.
        """
        if self._reader is None:
            raise DeviceRefused(f"{self._folder}: the recording is not open; read it inside a with block")
        while (outcome := self._next_outcome(self._reader)) is not None:
            if isinstance(outcome, RgbdFrame):
                self._usable += 1
                return outcome if self.gyro is None else self.gyro.attach(outcome)
            self._skipped.append(outcome)
        if self._usable == 0:
            raise BadRecording(
                f"{self._folder}: none of the {len(self._pairs)} frames is usable; "
                f"the first: {self._skipped[0]}"
            )
        raise EndOfStream(f"{self._folder}: no further frame")

    def skip_until(self, until_ns: int) -> None:
        """Skip, without decoding, every frame that is followed by another one not later than until_ns."""
        while (second_index := self._second_index()) < len(self._pairs):
            if self._pairs[second_index].colour.stamp_ns > until_ns:
                return
            if self._futures:
                self._futures.popleft().cancel()
            else:
                self._next += 1

    def _second_index(self) -> int:
        """Index of the pair after the one that read() gives next."""
        return self._next - len(self._futures) + 1

    def _rewind(self) -> None:
        self._next = 0
        self._usable = 0
        self._skipped: list[SkippedFrame] = []
        self._futures: deque[Future[RgbdFrame | SkippedFrame]] = deque()
        if self.gyro is not None:
            self.gyro.rewind()

    def _next_outcome(self, reader: ThreadPoolExecutor) -> RgbdFrame | SkippedFrame | None:
        """The next frame, or why it is unusable; None after the last."""
        while self._next < len(self._pairs) and len(self._futures) <= self._read_ahead:
            self._futures.append(reader.submit(self._load, self._pairs[self._next]))
            self._next += 1
        return self._futures.popleft().result() if self._futures else None

    def _load(self, pair: _Pair) -> RgbdFrame | SkippedFrame:
        calibration = self._calibration
        file = pair.colour.file
        try:
            colour = read_colour(
                self._folder / file, calibration.intrinsics.width, calibration.intrinsics.height
            )
            file = pair.depth.file
            depth = read_depth(self._folder / file, calibration.depth_width, calibration.depth_height)
        except ImageError as error:
            return SkippedFrame(file, str(error))
        colour, depth = calibration.rectify(colour, depth)
        return RgbdFrame(
            colour=colour,
            depth=depth,
            depth_scale_m=calibration.depth_scale_m,
            captured_ns=pair.colour.stamp_ns,
            device_s=pair.colour.stamp_ns / NS_PER_S,
            sequence=pair.sequence,
            intrinsics=calibration.intrinsics,
        )


def _require_recording(folder: Path) -> None:
    try:
        is_folder = stat.S_ISDIR(os.stat(folder).st_mode)
    except PermissionError:
        raise BadRecording(f"{folder}: cannot be reached; a folder above it may not be entered") from None
    except OSError:
        raise BadRecording(f"{folder}: there is no such folder; {_FORMAT_HINT}") from None
    if not is_folder:
        raise BadRecording(f"{folder}: it is not a folder; {_FORMAT_HINT}")
    if not os.access(folder, os.R_OK | os.X_OK):
        raise BadRecording(f"{folder}: may not be read")
    missing = [name for name in _REQUIRED_FILES if not os.path.isfile(folder / name)]
    if missing:
        raise BadRecording(f"{folder}: {', '.join(missing)} missing; {_FORMAT_HINT}")


def _pairs(folder: Path, colour: ImageIndex, depth: ImageIndex, max_pair_gap_s: float) -> list[_Pair]:
    """Pair colour and depth. Raises BadRecording if an index is empty or there is not a single pair."""
    for name, index in (("rgb.txt", colour), ("depth.txt", depth)):
        if not index.entries:
            why = f"; the first bad line: {index.bad_lines[0]}" if index.bad_lines else ""
            raise BadRecording(f"{folder / name}: names no image; each line must be a time and a path{why}")
    colour_ns = [entry.stamp_ns for entry in colour.entries]
    depth_ns = [entry.stamp_ns for entry in depth.entries]
    pairs = associate(colour_ns, depth_ns, round(max_pair_gap_s * NS_PER_S))
    if not pairs:
        raise BadRecording(
            f"{folder}: no colour and depth image within {max_pair_gap_s} s of each other; the closest are "
            f"{_smallest_gap_s(colour_ns, depth_ns):.3f} s apart; check the times in rgb.txt and depth.txt"
        )
    return [_Pair(i, colour.entries[i], depth.entries[j]) for i, j in pairs]


def _smallest_gap_s(colour_ns: Sequence[int], depth_ns: Sequence[int]) -> float:
    """The smallest time between any colour and any depth image; both inputs are sorted."""
    gaps_ns: list[int] = []
    for stamp_ns in colour_ns:
        after = bisect_left(depth_ns, stamp_ns)
        gaps_ns.extend(
            abs(depth_stamp_ns - stamp_ns) for depth_stamp_ns in depth_ns[max(after - 1, 0) : after + 1]
        )
    return min(gaps_ns) / NS_PER_S
