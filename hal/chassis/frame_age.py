"""How long a frame has waited on its way, by the sender's clock and ours."""

from __future__ import annotations

from hal.clocks import NS_PER_MS

# How far the two clocks may drift apart: one part in a hundred. A line that falls behind by more shows.
_DRIFT = 100


class FrameAge:
    """Neither knows when the other began, so the frame that was fastest so far is taken to have no age."""

    def __init__(self) -> None:
        self._sender_ns = 0
        self._least_ns: int | None = None
        self._now_ns = 0

    def restart(self) -> None:
        """The sender's clock began anew, or what waited has been thrown away: the next frame has no age."""
        self._least_ns = None

    def step(self, elapsed_ms: int, now_ns: int) -> int:
        """The age, ns, of a frame that arrived at now_ns and was made elapsed_ms after the one before."""
        self._sender_ns += elapsed_ms * NS_PER_MS
        apart_ns = now_ns - self._sender_ns
        since_ns, self._now_ns = now_ns - self._now_ns, now_ns
        least_ns = apart_ns if self._least_ns is None else self._least_ns + since_ns // _DRIFT
        self._least_ns = min(apart_ns, least_ns)
        return apart_ns - self._least_ns
