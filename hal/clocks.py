"""The machine's monotonic clock, and a simulated clock for simulation and tests."""

from __future__ import annotations

import time

NS_PER_S = 1_000_000_000
NS_PER_MS = 1_000_000


class MonotonicClock:
    """CLOCK_MONOTONIC. It never steps, so deadlines and ages survive a change of the wall clock."""

    def now_ns(self) -> int:
        return time.monotonic_ns()

    def sleep_until_ns(self, deadline_ns: int) -> None:
        """Return at or after the absolute deadline; at once if it has passed."""
        while (remaining_ns := deadline_ns - time.monotonic_ns()) > 0:
            time.sleep(remaining_ns / NS_PER_S)


class SimulatedClock:
    """A clock that stands still until somebody sleeps, and then jumps to the deadline. With it, two runs are
    identical to the bit."""

    def __init__(self, start_ns: int = 0) -> None:
        self._now_ns = start_ns

    def now_ns(self) -> int:
        return self._now_ns

    def sleep_until_ns(self, deadline_ns: int) -> None:
        """Jump to the deadline. A deadline in the past leaves the clock unchanged."""
        self._now_ns = max(self._now_ns, deadline_ns)
