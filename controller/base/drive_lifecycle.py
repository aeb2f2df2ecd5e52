"""How a drive begins and ends: it arms the chassis, takes requests to stop, and tells when the robot rests.

controller/base/driven_base.py calls it in each step of both control loops.
"""

from __future__ import annotations

import math
from enum import Enum

from hal.api import Chassis
from hal.clocks import NS_PER_S
from hal.types import LATCHED_MODES, ChassisMode, ChassisState, Setpoint

# The robot has come to rest once it has been commanded to stand, and measured to stand, for this long.
SETTLE_S = 0.5
# A base that is not even arming after this time will not arm: the drive ends instead of waiting for ever. How
# long arming itself may take is up to the driver, which then gives up (chassis.arming_timeout_ms).
ARM_TIMEOUT_S = 5.0
# A base that lags by 2 s has come to rest this long after the last command that moved it.
REST_TIMEOUT_S = 6.0

# Below these, measured speeds count as rest: the jitter of a coarse encoder, the noise of a gyro.
MEASURED_REST_MPS = 0.02
MEASURED_REST_RADPS = 0.05


class Outcome(Enum):
    """How a drive ended."""

    REACHED = "target reached"
    STOPPED = "stopped on request"
    BROKEN_OFF = "broken off"
    CHASSIS_FAULT = "the chassis stopped the drive"
    NOT_ARMED = "the chassis did not arm"


class DriveLifecycle:
    """Arms the chassis at the first step of a drive; decides whether, how and why the drive is over.

    Then it stops the chassis. A chassis that latches a fault or is lost ends every drive, and only a person
    can start it again. So does a base that keeps moving although it is commanded to stand.

    stop_reason: why the robot comes to rest, from the request on; None: nobody has requested it.
    outcome: how the drive ended; None while it goes on.
    """

    def __init__(self, chassis: Chassis) -> None:
        self.stop_reason: str | None = None
        self.outcome: Outcome | None = None
        self._chassis = chassis
        self._asked_for = Outcome.STOPPED
        self._started_ns: int | None = None
        self._was_armed = False
        self._commanded_to_stand_since_ns: int | None = None
        self._resting_since_ns: int | None = None

    def request_stop(self, reason: str, outcome: Outcome) -> None:
        """Let the drive end with this outcome once the robot is at rest. The first reason is kept."""
        if self.stop_reason is None:
            self.stop_reason = reason
            self._asked_for = outcome

    def arm_once(self, now_ns: int) -> None:
        """Call before each step; the first call arms the chassis."""
        if self._started_ns is None:
            self._started_ns = now_ns
            self._chassis.arm(now_ns)

    def check_end(self, state: ChassisState, setpoint: Setpoint, now_ns: int, *, arrived: bool) -> None:
        """Call after each step, with what was sent and answered.

        arrived: whether the robot is where this drive leads to.
        """
        assert self._started_ns is not None, "checked before it began"
        if state.mode is ChassisMode.ARMED:
            self._was_armed = True
        elif self._was_armed or state.mode in LATCHED_MODES:
            self._end(Outcome.CHASSIS_FAULT, state.reason, now_ns)
            return
        elif state.mode is not ChassisMode.ARMING and now_ns - self._started_ns > ARM_TIMEOUT_S * NS_PER_S:
            self._end(Outcome.NOT_ARMED, state.reason, now_ns)
            return
        told_to_stand = setpoint.v_mps == 0.0 and setpoint.a_mps2 == 0.0 and setpoint.w_radps == 0.0
        if not told_to_stand or not (arrived or self.stop_reason is not None):
            self._commanded_to_stand_since_ns = self._resting_since_ns = None
            return
        if self._commanded_to_stand_since_ns is None:
            self._commanded_to_stand_since_ns = now_ns
        if self._settled(state, now_ns):
            self._end(Outcome.REACHED if arrived else self._asked_for, None, now_ns)
        elif now_ns - self._commanded_to_stand_since_ns >= REST_TIMEOUT_S * NS_PER_S:
            self._end(Outcome.CHASSIS_FAULT, _still_moving_text(state), now_ns)

    def _settled(self, state: ChassisState, now_ns: int) -> bool:
        """Whether the base has measured rest for long enough, and has reported since then.

        A report from before is no evidence of rest. A base that was never armed has not been moved, so it
        need not have reported anything.
        """
        trusted = not self._was_armed
        # NaN is no rest.
        slow = abs(state.v_mps) <= MEASURED_REST_MPS and abs(state.w_radps) <= MEASURED_REST_RADPS
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


def _still_moving_text(state: ChassisState) -> str:
    text = f"commanded to stand for {REST_TIMEOUT_S:g} s, "
    if math.isfinite(state.v_mps + state.w_radps):
        text += f"the base still reports {state.v_mps:.2f} m/s and {state.w_radps:.2f} rad/s"
        return f"{text}; does it hold itself where it stands, and do its motors obey?"
    return f"{text}the base does not tell how fast it goes"
