"""What every kind of recording tells besides its frames."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from hal.api import FrameSource
from hal.types import CameraMount


@dataclass(frozen=True, slots=True)
class SkippedFrame:
    """What could not be used, and why. file: an image of the recording, ``index.txt:line``, or a topic."""

    file: str
    reason: str

    def __str__(self) -> str:
        return f"{self.file}: {self.reason}"


class Recording(FrameSource, Protocol):
    """A FrameSource that ends, and knows what it is."""

    def pass_over(self, until_ns: int) -> None:
        """Leave out what another frame follows until then, without decoding it."""
        ...

    @property
    def mount(self) -> CameraMount | None:
        """Where the camera sat on the robot; None where the recording does not say."""
        ...

    @property
    def frame_count(self) -> int:
        """How many frames there are at most; some may prove unusable."""
        ...

    @property
    def fps(self) -> float | None:
        """Frames a second; None where that is not known."""
        ...

    @property
    def skipped(self) -> tuple[SkippedFrame, ...]:
        """What could not be used so far, and why, in the order of the recording."""
        ...

    @property
    def notes(self) -> tuple[str, ...]:
        """Plain sentences for the summary: what was assumed, left out or put in order."""
        ...
