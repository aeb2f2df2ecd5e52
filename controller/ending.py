"""How every drive begins and ends, whoever steers it: arming, a wish to stop, rest, the last zero."""

from __future__ import annotations

import math
from enum import Enum

from hal.api import Chassis
from hal.clocks import NS_PER_S
from hal.types import LATCHED_MODES, ChassisMode, ChassisState, Setpoint

# At rest, by command and by what the chassis measures, for this long.
SETTLE_S = 0.5
# A base that does not arm within this will not: say so instead of waiting for ever.
ARM_TIMEOUT_S = 5.0
# A base that lags by two seconds has come to rest this long after the last command that moved it.
STILL_GOING_S = 6.0

# Slower is at rest: some counts of jitter of a coarse encoder, the noise of a gyro.
REST_MPS = 0.02
REST_RADPS = 0.05


class Outcome(Enum):
    """How a drive ended."""

    REACHED = "target reached"
    STOPPED = "stopped on request"
    BROKEN_OFF = "broken off"
    CHASSIS_FAULT = "the chassis stopped the drive"
    NOT_ARMED = "the chassis did not arm"


class Ending:
    """Arms the chassis at the drive's first step, tells whether, how and why the drive is over, and stops
    the chassis then. A chassis that latches or is lost ends every drive; only a person starts it again. So
    does one that is told to stand and goes on.

    stop_reason: why the robot comes to rest, from the moment that this is asked for. outcome: how the drive
    ended, None as long as it goes on.
    """

    def __init__(self, chassis: Chassis) -> None:
        self.stop_reason: str | None = None
        self.outcome: Outcome | None = None
        self._chassis = chassis
        self._asked_for = Outcome.STOPPED
        self._started_ns: int | None = None
        self._was_armed = False
        self._told_to_stand_since_ns: int | None = None
        self._resting_since_ns: int | None = None

    def request_stop(self, reason: str, outcome: Outcome) -> None:
        """Have the drive end with this outcome once the robot is at rest. The first reason stays."""
        if self.stop_reason is None:
            self.stop_reason = reason
            self._asked_for = outcome

    def begin(self, now_ns: int) -> None:
        """Before each step; the first one arms the chassis."""
        if self._started_ns is None:
            self._started_ns = now_ns
            self._chassis.arm(now_ns)

    def conclude(self, state: ChassisState, setpoint: Setpoint, now_ns: int, *, arrived: bool) -> None:
        """After each step, with what was sent and answered. arrived: where this drive leads to."""
        assert self._started_ns is not None, "concluded before it began"
        if state.mode is ChassisMode.ARMED:
            self._was_armed = True
        elif self._was_armed or state.mode in LATCHED_MODES:
            self._end(Outcome.CHASSIS_FAULT, state.reason, now_ns)
            return
        elif now_ns - self._started_ns > ARM_TIMEOUT_S * NS_PER_S:
            self._end(Outcome.NOT_ARMED, state.reason, now_ns)
            return
        told_to_stand = setpoint.v_mps == 0.0 and setpoint.a_mps2 == 0.0 and setpoint.w_radps == 0.0
        if not told_to_stand or not (arrived or self.stop_reason is not None):
            self._told_to_stand_since_ns = self._resting_since_ns = None
            return
        if self._told_to_stand_since_ns is None:
            self._told_to_stand_since_ns = now_ns
        if self._settled(state, now_ns):
            self._end(Outcome.REACHED if arrived else self._asked_for, None, now_ns)
        elif now_ns - self._told_to_stand_since_ns >= STILL_GOING_S * NS_PER_S:
            self._end(Outcome.CHASSIS_FAULT, _goes_on(state), now_ns)

    def _settled(self, state: ChassisState, now_ns: int) -> bool:
        """It has measured rest for long enough, and told so since: what it told before is no evidence. Before
        it was armed nobody has moved it, and it need not have told anything."""
        trusted = not self._was_armed
        slow = abs(state.v_mps) <= REST_MPS and abs(state.w_radps) <= REST_RADPS  # NaN is not
        if not (slow or trusted):
            self._resting_since_ns = None
            return False
        if self._resting_since_ns is None:
            self._resting_since_ns = now_ns
        heard = state.feedback_ns is not None and state.feedback_ns > self._resting_since_ns
        return (heard or trusted) and now_ns - self._resting_since_ns >= SETTLE_S * NS_PER_S

    def _end(self, outcome: Outcome, reason: str | None, now_ns: int) -> None:
        self.outcome = outcome
        self.stop_reason = "; then ".join(filter(None, (self.stop_reason, reason))) or None
        self._chassis.stop(now_ns)


def _goes_on(state: ChassisState) -> str:
    told = f"told to stand for {STILL_GOING_S:g} s, "
    if math.isfinite(state.v_mps + state.w_radps):
        told += f"the base still tells of {state.v_mps:.2f} m/s and {state.w_radps:.2f} rad/s"
        return f"{told}; does it hold itself where it stands, and do its motors obey?"
    return f"{told}the base does not tell how fast it goes"
