"""The release gate: slower at once, faster only after a delay, so that noisy limits cause no jerky drive.
The start delay: a standing robot waits until what comes and goes in its way has certainly gone.

controller/decision/decide.py passes the least limit through them in each control step.
"""

from __future__ import annotations

import math
from collections import deque

from config.decision import Release
from controller.decision.limits import STANDING_MPS
from hal.clocks import NS_PER_S

# Something low at the lower edge of the view is seen in some frames only, with gaps of up to half a second.
# The robot would creep on in each gap until the obstacle is below the view. So what has come back within
# _AGAIN_S must have been out of sight for _GONE_S before the robot starts.
_AGAIN_S = 5.0
_GONE_S = 1.0
# Once the robot has not slowed down for so long, a small gain is no nervousness any more. Without it, the
# robot would stay below its speed for the rest of the way.
_SETTLED_S = 4.0


class StartDelay:
    """Keeps a standing robot at rest for _GONE_S after something that comes and goes stood in its way.

    A robot that still rolls is not stopped by it: it only gets no faster meanwhile.
    """

    def __init__(self) -> None:
        self._stood_ns: int | None = None
        self._free = True
        self._flickers = False

    def step(self, blocked: bool, stands: bool, now_ns: int) -> bool:
        """Whether the robot must not start, or get faster, yet.

        blocked: something makes it stand. stands: that does not move. Something that is in the way until it
        leaves, first standing and then moving, has not come back.
        """
        since_s = math.inf if self._stood_ns is None else (now_ns - self._stood_ns) / NS_PER_S
        if stands:
            self._flickers = self._flickers or (self._free and since_s < _AGAIN_S)
            self._stood_ns = now_ns
        elif since_s >= _AGAIN_S:
            self._flickers = False
        self._free = not blocked
        return self._free and self._flickers and since_s < _GONE_S


class _RunningMin:
    """Running minimum over the last delay_s, or since the first value if that is less."""

    def __init__(self, delay_s: float) -> None:
        self._delay_ns = round(delay_s * NS_PER_S)
        # (time, value) with growing values, so that the first one is the minimum.
        self._lately: deque[tuple[int, float]] = deque()

    def update(self, value: float, now_ns: int) -> float:
        """The minimum, with value at now_ns included."""
        lately, since_ns = self._lately, now_ns - self._delay_ns
        while lately and lately[-1][1] >= value:
            lately.pop()
        lately.append((now_ns, value))
        while lately[0][0] < since_ns:
            lately.popleft()
        return lately[0][1]


class ReleaseGate:
    """Passes a falling target on at once and delays a rising one.

    The target rises to the minimum of the last delay_s, so that one free moment does not make the robot go,
    nor one high value make it fast. If the minimum of the shorter far_delay_s is far above the present speed
    (far_mps), that one is used: before the difference is driven, there is time to look again. Not from rest:
    whoever comes into view right before the nose needs about delay_s to become known, and people follow each
    other. After a change from faster to slower, the next increase comes no sooner than hold_s later, and then
    only for a gain of worth_mps: within hold_s the speed changes its direction at most twice. A robot that
    stands, or has not slowed down for _SETTLED_S, takes any gain: a slow section may allow no greater one.
    """

    def __init__(self, config: Release) -> None:
        self._config = config
        self._held_mps = 0.0
        self._rising = True
        self._increasing = True
        self._turned_ns: int | None = None
        self._slowed_ns: int | None = None
        self._delayed_min, self._recent_min = _RunningMin(config.delay_s), _RunningMin(config.far_delay_s)

    def step(
        self, allowed_mps: float, v_mps: float, let_go_mps: float, now_ns: int, max_mps: float = math.inf
    ) -> float:
        """The target speed to use.

        allowed_mps: what the limits allow now.
        v_mps: the present speed.
        let_go_mps: the speed that is reached if the present deceleration ends now. Keeping that speed is no
        increase, so it is allowed at any time.
        max_mps: what the path allows; it bounds the gain, and is not delayed here.
        """
        band = self._config.dead_band_mps
        min_mps = self._delayed_min.update(allowed_mps, now_ns)
        far_mps = self._recent_min.update(allowed_mps, now_ns)
        if v_mps > STANDING_MPS and far_mps >= v_mps + self._config.far_mps:
            min_mps = far_mps
        if allowed_mps < self._held_mps - band or allowed_mps <= 0.0:
            self._rising = False
        if allowed_mps <= self._held_mps or self._rising:
            self._held_mps = allowed_mps
        elif min_mps > self._held_mps:
            self._raise(min_mps, let_go_mps, now_ns)
        target_mps = self._held_mps
        gains = min(target_mps, max_mps) >= v_mps + self._config.worth_mps
        if not self._may_turn(now_ns) or (self._wants_gain(v_mps, now_ns) and not gains):
            target_mps = min(target_mps, v_mps)
        self._note_turn(target_mps, v_mps, now_ns)
        return target_mps

    def _raise(self, min_mps: float, let_go_mps: float, now_ns: int) -> None:
        if self._may_turn(now_ns):
            self._held_mps = min_mps
        else:
            self._held_mps = max(self._held_mps, min(min_mps, let_go_mps))

    def _may_turn(self, now_ns: int) -> bool:
        turned_ns = self._turned_ns
        return turned_ns is None or (now_ns - turned_ns) / NS_PER_S >= self._config.hold_s

    def _wants_gain(self, v_mps: float, now_ns: int) -> bool:
        """Whether a gain may be too small: the robot rolls on after a decrease that is not long ago."""
        settled = self._slowed_ns is None or (now_ns - self._slowed_ns) / NS_PER_S >= _SETTLED_S
        return not (self._increasing or settled or v_mps <= STANDING_MPS)

    def _note_turn(self, target_mps: float, v_mps: float, now_ns: int) -> None:
        band = self._config.dead_band_mps
        if target_mps > v_mps + band:
            self._increasing = True
            return
        stops = target_mps <= 0.0 and v_mps > STANDING_MPS
        if stops or target_mps < v_mps - band:
            self._slowed_ns = now_ns
            if self._increasing:
                self._increasing = False
                self._turned_ns = now_ns
