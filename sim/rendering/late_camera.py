"""A simulated camera whose frames arrive late, for drives in real time; lock-step delays scenes by itself."""

from __future__ import annotations

from collections import deque

from config.faults import Faults
from hal.api import Clock
from hal.clocks import NS_PER_S
from hal.device_wrapper import DeviceWrapper
from hal.errors import FrameTimeout
from hal.types import Intrinsics, RgbdFrame
from sim.rendering.faulty_camera import FaultyCamera


class LateCamera(DeviceWrapper):
    """A FrameSource that holds each frame back for the delay of its scenario. No frame overtakes another.

    start_ns: time zero of the world.
    """

    def __init__(self, camera: FaultyCamera, faults: Faults, clock: Clock, start_ns: int) -> None:
        super().__init__(camera)
        self._camera, self._faults, self._clock, self._start_ns = camera, faults, clock, start_ns
        self._held: deque[tuple[int, RgbdFrame]] = deque()

    @property
    def intrinsics(self) -> Intrinsics:
        """The pinhole camera of both images."""
        return self._camera.intrinsics

    def read(self, timeout_s: float) -> RgbdFrame:
        """The next frame whose delay is over. Raises FrameTimeout, DeviceRefused once closed."""
        deadline_ns = self._clock.now_ns() + round(timeout_s * NS_PER_S)
        while True:
            until_ns = min(deadline_ns, self._held[0][0] if self._held else deadline_ns)
            wait_ns = until_ns - self._clock.now_ns()
            if wait_ns <= 0 and self._held and self._held[0][0] <= deadline_ns:
                return self._held.popleft()[1]
            if wait_ns <= 0 and until_ns < self._camera.next_capture_ns:
                raise FrameTimeout(f"simulated camera: no frame arrives within {timeout_s:.3f} s")
            try:
                frame = self._camera.read(max(wait_ns, 0) / NS_PER_S)
            except FrameTimeout:
                continue
            late_s = self._faults.late_by((frame.captured_ns - self._start_ns) / NS_PER_S)
            self._held.append((frame.captured_ns + round(late_s * NS_PER_S), frame))
