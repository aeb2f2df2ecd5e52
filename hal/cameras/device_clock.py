"""A camera's own clock on the machine's monotonic clock, without the jitter of USB and scheduling."""

from __future__ import annotations

from collections import deque


class DeviceClock:
    """Maps device times to monotonic times, one frame after another.

    A frame arrives at its exposure plus a delay that is never shorter than the transport takes and
    often longer. The smallest difference between arrival and device time among the last frames is
    therefore the clocks' offset plus the shortest delay, and that is latency_ns. The window is short
    enough that drift between two quartzes (50 ppm at most) stays below a millisecond.

    Every result lies latency_ns or more before the arrival: a frame can look older than it is, never
    fresher. Each lies after the one before: with a new smallest difference it is this arrival less the
    latency, which no earlier result exceeds. A device clock that steps is followed at once.
    """

    def __init__(self, latency_ns: int, window: int = 128) -> None:
        self._latency_ns = latency_ns
        self._offsets_ns: deque[int] = deque(maxlen=window)
        self._device_ns: int | None = None

    def captured_ns(self, device_ns: int, arrival_ns: int) -> int:
        """The monotonic time of a frame with the given device time that has just arrived."""
        if self._device_ns is not None and device_ns <= self._device_ns:
            self._offsets_ns.clear()  # the device was reset: its old offset means nothing
        self._device_ns = device_ns
        self._offsets_ns.append(arrival_ns - device_ns)
        return self.monotonic_ns(device_ns)

    def monotonic_ns(self, device_ns: int) -> int:
        """Any other device time, such as a gyro sample's, by what the frames have taught so far."""
        return device_ns + min(self._offsets_ns, default=0) - self._latency_ns
