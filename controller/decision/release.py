"""Slower at once, faster later: what keeps a noisy limit from making the robot twitch."""

from __future__ import annotations

import math
from collections import deque

from config.decision import Release
from controller.decision.limits import STANDING_MPS
from hal.clocks import NS_PER_S


class _Least:
    """The least of what was seen during the last delay_s, or since the first look if that is less."""

    def __init__(self, delay_s: float) -> None:
        self._delay_ns = round(delay_s * NS_PER_S)
        # (when, how much), growing, so the first is the least.
        self._lately: deque[tuple[int, float]] = deque()

    def update(self, value: float, now_ns: int) -> float:
        """With value seen at now_ns."""
        lately, since_ns = self._lately, now_ns - self._delay_ns
        while lately and lately[-1][1] >= value:
            lately.pop()
        lately.append((now_ns, value))
        while lately[0][0] < since_ns:
            lately.popleft()
        return lately[0][1]


class ReleaseGate:
    """Passes a falling target on at once and holds a rising one back.

    The target rises to the least that was allowed during delay_s, so one free moment is no reason to go, nor
    one good number a reason to go fast. Where that is far above the present speed, the least during
    far_delay_s will do: before the difference is used up, there is time to look again. After it has turned
    from faster to slower, it does not turn again within hold_s, and then only for a gain of worth_mps: in
    hold_s it can turn round at most twice.
    """

    def __init__(self, config: Release) -> None:
        self._config = config
        self._held_mps = 0.0
        self._rising = True
        self._went_faster = True
        self._turned_ns: int | None = None
        self._lately, self._just_now = _Least(config.delay_s), _Least(config.far_delay_s)

    def step(
        self, raw_mps: float, v_mps: float, let_go_mps: float, now_ns: int, most_mps: float = math.inf
    ) -> float:
        """The target to use.

        let_go_mps: the speed that remains when the present deceleration is let go of, which may be kept at
        any time: that is no increase. most_mps: what the path allows, for which nothing is held back.
        """
        band = self._config.dead_band_mps
        least_mps, far_mps = self._lately.update(raw_mps, now_ns), self._just_now.update(raw_mps, now_ns)
        if far_mps >= v_mps + self._config.far_mps:
            least_mps = far_mps
        if raw_mps < self._held_mps - band or raw_mps <= 0.0:
            self._rising = False
        if raw_mps <= self._held_mps or self._rising:
            self._held_mps = raw_mps
        elif least_mps > self._held_mps:
            self._raise(least_mps, let_go_mps, now_ns)
        target_mps = self._held_mps
        hardly = not self._went_faster and min(target_mps, most_mps) < v_mps + self._config.worth_mps
        if hardly or not self._may_turn(now_ns):
            target_mps = min(target_mps, v_mps)
        self._note_turn(target_mps, v_mps, now_ns)
        return target_mps

    def _raise(self, least_mps: float, let_go_mps: float, now_ns: int) -> None:
        if self._may_turn(now_ns):
            self._held_mps = least_mps
        else:
            self._held_mps = max(self._held_mps, min(least_mps, let_go_mps))

    def _may_turn(self, now_ns: int) -> bool:
        turned_ns = self._turned_ns
        return turned_ns is None or (now_ns - turned_ns) / NS_PER_S >= self._config.hold_s

    def _note_turn(self, target_mps: float, v_mps: float, now_ns: int) -> None:
        band = self._config.dead_band_mps
        if target_mps > v_mps + band:
            self._went_faster = True
        elif self._went_faster:
            stops = target_mps <= 0.0 and v_mps > STANDING_MPS
            if stops or target_mps < v_mps - band:
                self._went_faster = False
                self._turned_ns = now_ns
