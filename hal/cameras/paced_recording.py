"""A recording that plays in real time, as if it were a camera."""

from __future__ import annotations

from dataclasses import replace
from types import TracebackType
from typing import Self

from hal.api import Clock
from hal.cameras.recording import Recording
from hal.clocks import NS_PER_S
from hal.errors import FrameTimeout
from hal.types import Intrinsics, RgbdFrame


class PacedRecording:
    """FrameSource that gives each frame when it is due, counted from the first read, with that time as
    captured_ns. The times of its gyro are shifted as much.

    For tests of a real base with recorded images: the decision needs fresh frames. A reader that does not
    keep up gets the newest frame that is due, as from a camera; the frames before it are skipped.
    """

    def __init__(self, recording: Recording, clock: Clock) -> None:
        self._recording, self._clock = recording, clock
        self._waiting: RgbdFrame | None = None
        self._offset_ns: int | None = None

    @property
    def intrinsics(self) -> Intrinsics:
        return self._recording.intrinsics

    def __enter__(self) -> Self:
        self._recording.__enter__()
        self._waiting = self._offset_ns = None
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._recording.__exit__(kind, error, trace)

    def read(self, timeout_s: float) -> RgbdFrame:
        """Wait for the next frame. Raises FrameTimeout if it is not due within timeout_s, and what the
        recording raises."""
        now_ns = self._clock.now_ns()
        frame = self._waiting or self._newest_due(now_ns)
        if self._offset_ns is None:
            now_ns = self._clock.now_ns()
            self._offset_ns = now_ns - frame.captured_ns
        due_ns = frame.captured_ns + self._offset_ns
        deadline_ns = now_ns + round(timeout_s * NS_PER_S)
        self._clock.sleep_until_ns(min(due_ns, deadline_ns))
        if due_ns > deadline_ns:
            self._waiting = frame
            raise FrameTimeout(f"the recording has no frame within {timeout_s:g} s")
        self._waiting = None
        gyro = frame.gyro
        if gyro is not None:
            gyro = replace(gyro, stamps_ns=gyro.stamps_ns + self._offset_ns)
        return replace(frame, captured_ns=due_ns, gyro=gyro)

    def _newest_due(self, now_ns: int) -> RgbdFrame:
        """The newest frame that is due, or the next one if none is."""
        if self._offset_ns is not None:
            self._recording.skip_until(now_ns - self._offset_ns)
        return self._recording.read(0.0)
