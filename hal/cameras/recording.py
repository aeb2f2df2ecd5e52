"""What every kind of recording offers besides its frames, and its frames one after the other."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Protocol

from hal.api import FrameSource
from hal.cameras.gyro_track import GyroTrack
from hal.errors import EndOfStream
from hal.types import CameraMount, RgbdFrame


@dataclass(frozen=True, slots=True)
class SkippedFrame:
    """Something that could not be used, and why. file: an image, ``index.txt:line``, or a topic."""

    file: str
    reason: str

    def __str__(self) -> str:
        return f"{self.file}: {self.reason}"


class Recording(FrameSource, Protocol):
    """A FrameSource that ends, with a description of the recording."""

    def skip_until(self, until_ns: int) -> None:
        """Skip, without decoding, every frame that is followed by another one not later than until_ns."""
        ...

    @property
    def mount(self) -> CameraMount | None:
        """Where the camera sat on the robot; None if the recording does not say."""
        ...

    @property
    def frame_count(self) -> int:
        """Maximum number of frames; some may turn out to be unusable."""
        ...

    @property
    def fps(self) -> float | None:
        """Frames per second; None if unknown."""
        ...

    @property
    def skipped(self) -> tuple[SkippedFrame, ...]:
        """What could not be used so far, and why, in the order of the recording."""
        ...

    @property
    def gyro(self) -> GyroTrack | None:
        """The gyro whose readings come with the frames; None if there is none."""
        ...

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences for the summary: what was assumed, left out or put in order."""
        ...


def frames_of(recording: Recording) -> Iterator[RgbdFrame]:
    """The usable frames of an open recording, until it ends. Raises BadRecording if not one is usable."""
    with suppress(EndOfStream):
        while True:
            yield recording.read(timeout_s=0.0)
