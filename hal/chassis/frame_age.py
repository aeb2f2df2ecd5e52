"""How long a frame was delayed on its way, from the sender's clock and the clock of this machine."""

from __future__ import annotations

from hal.clocks import NS_PER_MS

# The two clocks may drift apart by one part in this number. A line that falls behind faster is noticed.
_DRIFT = 100


class FrameAge:
    """The age of frames relative to the fastest frame so far, which is taken to have no age: the offset
    between the two clocks is unknown."""

    def __init__(self) -> None:
        self._sender_ns = 0
        self._min_offset_ns: int | None = None
        self._now_ns = 0

    def restart(self) -> None:
        """The sender's clock restarted, or the waiting frames were discarded: the next frame has no age."""
        self._min_offset_ns = None

    def step(self, elapsed_ms: int, now_ns: int) -> int:
        """The age in ns of a frame that arrived at now_ns and was made elapsed_ms after the frame before."""
        self._sender_ns += elapsed_ms * NS_PER_MS
        offset_ns = now_ns - self._sender_ns
        elapsed_ns, self._now_ns = now_ns - self._now_ns, now_ns
        min_offset_ns = (
            offset_ns if self._min_offset_ns is None else self._min_offset_ns + elapsed_ns // _DRIFT
        )
        self._min_offset_ns = min(offset_ns, min_offset_ns)
        return offset_ns - self._min_offset_ns
