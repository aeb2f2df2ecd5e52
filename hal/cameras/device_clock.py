"""Maps the clock of a camera to the machine's monotonic clock, without the jitter of USB and scheduling."""

from __future__ import annotations

from collections import deque


class DeviceClock:
    """Maps device times to monotonic times, one frame after another.

    A frame arrives after its exposure, by the time of the transport at least and often by more. The smallest
    difference between arrival and device time among the last frames is therefore the offset of the clocks
    plus the shortest delay, which is latency_ns. The window is so short that the drift between two quartz
    clocks (50 ppm at most) stays below a millisecond.

    Every result lies at least latency_ns before the arrival: a frame may appear older than it is, but not
    younger. The results increase: with a new smallest difference, the result is this arrival minus the
    latency, which no earlier result exceeds. A step of the device's clock is followed at once.
    """

    def __init__(self, latency_ns: int, window: int = 128) -> None:
        self._latency_ns = latency_ns
        self._offsets_ns: deque[int] = deque(maxlen=window)
        self._last_device_ns: int | None = None

    def captured_ns(self, device_ns: int, arrival_ns: int) -> int:
        """The monotonic time of a frame with the given device time that has just arrived."""
        if self._last_device_ns is not None and device_ns <= self._last_device_ns:
            self._offsets_ns.clear()  # the device was reset, so its old offsets are invalid
        self._last_device_ns = device_ns
        self._offsets_ns.append(arrival_ns - device_ns)
        return self.monotonic_ns(device_ns)

    def monotonic_ns(self, device_ns: int) -> int:
        """The monotonic time of any other device time, such as that of a gyro sample, by the offset of the
        frames so far."""
        return device_ns + min(self._offsets_ns, default=0) - self._latency_ns
