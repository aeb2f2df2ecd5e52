"""Slower at once, faster later: what keeps a noisy limit from making the robot twitch."""

from __future__ import annotations

from config.decision import Release
from hal.clocks import NS_PER_S


class ReleaseGate:
    """Passes a falling target on at once and holds a rising one back.

    A decrease begins when the target falls below the present speed by the dead band. No increase follows
    sooner than hold_s after that, so in hold_s the target can turn round at most twice; and the way must
    have been free for delay_s without a break.
    """

    def __init__(self, config: Release) -> None:
        self._config = config
        self._held_mps = 0.0
        self._rising = True
        self._decreasing = False
        self._decreased_ns: int | None = None
        self._free_since_ns: int | None = None

    def step(self, raw_mps: float, v_mps: float, let_go_mps: float, now_ns: int) -> float:
        """The target to use. let_go_mps: the speed that remains when the present deceleration is let go of,
        which may be kept at any time: that is no increase."""
        band = self._config.dead_band_mps
        if raw_mps < self._held_mps - band or raw_mps <= 0.0:
            self._rising = False
        if raw_mps <= self._held_mps:
            self._held_mps = raw_mps
            self._free_since_ns = None
        else:
            self._raise(raw_mps, let_go_mps, now_ns)
        self._note_decrease(v_mps, now_ns)
        return self._held_mps if self._may_rise(now_ns) else min(self._held_mps, v_mps)

    def _raise(self, raw_mps: float, let_go_mps: float, now_ns: int) -> None:
        if self._rising:
            self._held_mps = raw_mps
            return
        if self._free_since_ns is None:
            self._free_since_ns = now_ns
        free_s = (now_ns - self._free_since_ns) / NS_PER_S
        if free_s < self._config.delay_s:
            return
        if self._may_rise(now_ns):
            self._held_mps = raw_mps
            self._rising = True
        else:
            self._held_mps = max(self._held_mps, min(raw_mps, let_go_mps))

    def _may_rise(self, now_ns: int) -> bool:
        began_ns = self._decreased_ns
        return began_ns is None or (now_ns - began_ns) / NS_PER_S >= self._config.hold_s

    def _note_decrease(self, v_mps: float, now_ns: int) -> None:
        decreasing = self._held_mps < v_mps - self._config.dead_band_mps
        if decreasing and not self._decreasing:
            self._decreased_ns = now_ns
            self._rising = False
        self._decreasing = decreasing
