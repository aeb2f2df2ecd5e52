"""The output guard: the last check between the program and the base. It knows only limits and the clock.

GuardedChassis stands around any chassis driver. It passes a setpoint on if that is finite, fresh, not older
than the one before, not backwards, and within the limits of speed, yaw rate and acceleration and the
emergency limits of deceleration and jerk. Otherwise it sends an explicit stop and latches with the reason.
Only arm(), a person's consent, releases the latch. In a correct program the guard never intervenes.
GuardedCanLink sends only CAN frames with identifiers that it was given.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Self

from config.robot import Limits
from hal.api import CanLink, Chassis
from hal.clocks import NS_PER_MS, NS_PER_S
from hal.device_wrapper import DeviceWrapper
from hal.errors import LinkLost
from hal.types import LATCHED_MODES, CanFrame, ChassisMode, ChassisState, Setpoint

_TOLERANCE = 1e-6


@dataclass(frozen=True, slots=True)
class GuardLimits:
    """The bounds.

    period_s: of the control loop; two steps closer in time are one late and one on time.
    max_age_s: of a setpoint. It is sent in the step that made it; older ones come from a program that hangs.
    """

    max_speed_mps: float
    max_yaw_rate_radps: float
    max_accel_mps2: float
    max_decel_mps2: float
    max_jerk_mps3: float
    period_s: float
    max_age_s: float

    @classmethod
    def of(cls, limits: Limits, period_s: float, max_age_s: float) -> Self:
        """The bounds of every command: the robot's limits, with those of an emergency stop for braking."""
        return cls(
            max_speed_mps=limits.max_speed_mps,
            max_yaw_rate_radps=limits.max_yaw_rate_radps,
            max_accel_mps2=limits.max_accel_mps2,
            max_decel_mps2=limits.emergency_decel_mps2,
            max_jerk_mps3=limits.emergency_jerk_mps3,
            period_s=period_s,
            max_age_s=max_age_s,
        )


def objection(setpoint: Setpoint, last: Setpoint | None, limits: GuardLimits, now_ns: int) -> str:
    """Why this setpoint must not go out after the last one; "" if it may.

    last None: the base is told zero whatever is asked, so there is no step to judge. Every test is written so
    that NaN, of the setpoint or of a limit, objects.
    """
    v, a, w = setpoint.v_mps, setpoint.a_mps2, setpoint.w_radps
    if not (math.isfinite(v) and math.isfinite(a) and math.isfinite(w)):
        return f"not finite: {v} m/s, {a} m/s2, {w} rad/s"
    age_ns = now_ns - setpoint.stamp_ns
    if age_ns < 0:
        return f"the command is from the future: {-age_ns / NS_PER_MS:.3f} ms"
    if not age_ns <= limits.max_age_s * NS_PER_S:
        return f"the command is {age_ns / NS_PER_MS:.0f} ms old"
    if last is not None and setpoint.stamp_ns < last.stamp_ns:
        behind_ms = (last.stamp_ns - setpoint.stamp_ns) / NS_PER_MS
        return f"the command is {behind_ms:.0f} ms older than the one before"
    if not v >= -_TOLERANCE:
        return f"backwards: {v:.3f} m/s"
    if not v <= limits.max_speed_mps + _TOLERANCE:
        return f"too fast: {v:.3f} m/s, at most {limits.max_speed_mps:g}"
    if not abs(w) <= limits.max_yaw_rate_radps + _TOLERANCE:
        return f"turns too fast: {w:.3f} rad/s, at most {limits.max_yaw_rate_radps:g}"
    return "" if last is None else _jolt(setpoint, last, limits)


def _jolt(setpoint: Setpoint, last: Setpoint, limits: GuardLimits) -> str:
    """Acceleration as claimed and as the speeds say, and the jerk between two claims."""
    dt_s = max((setpoint.stamp_ns - last.stamp_ns) / NS_PER_S, limits.period_s)
    really_mps2 = (setpoint.v_mps - last.v_mps) / dt_s
    for a in (setpoint.a_mps2, really_mps2):
        if not -limits.max_decel_mps2 - _TOLERANCE <= a <= limits.max_accel_mps2 + _TOLERANCE:
            most = f"{-limits.max_decel_mps2:g}..{limits.max_accel_mps2:g}"
            return f"accelerates too hard: {a:.3f} m/s2, allowed {most}"
    if setpoint.v_mps == 0.0 and setpoint.a_mps2 == 0.0:
        # A deceleration that is left at standstill may end in one step: the base does not notice it.
        return ""
    jerk_mps3 = (setpoint.a_mps2 - last.a_mps2) / dt_s
    if not abs(jerk_mps3) <= limits.max_jerk_mps3 + _TOLERANCE:
        return f"jerks: {jerk_mps3:.3f} m/s3, at most {limits.max_jerk_mps3:g}"
    return ""


def self_check(limits: GuardLimits) -> str:
    """Try the gate with good and bad setpoints. Returns its first mistake; "" if there is none."""
    now_ns, p, nan = 10 * NS_PER_S, limits.period_s, math.nan
    before_ns = now_ns - round(p * NS_PER_S) if 0.0 < p < 1.0 else 0
    top = Setpoint(before_ns, limits.max_speed_mps, 0.0, 0.0)
    rest = Setpoint(before_ns, 0.0, 0.0, 0.0)
    drop_mps = p * limits.max_decel_mps2
    fast = Setpoint(before_ns, limits.max_speed_mps + 2.0 * (p * limits.max_accel_mps2 + drop_mps), 0.0, 0.0)
    right: dict[str, tuple[Setpoint, Setpoint | None]] = {
        "standing still": (Setpoint(now_ns, 0.0, 0.0, 0.0), rest),
        "keeping full speed": (replace(top, stamp_ns=now_ns), top),
    }
    wrong: dict[str, tuple[Setpoint, Setpoint | None]] = {
        "NaN": (Setpoint(now_ns, nan, 0.0, 0.0), rest),
        "an infinite yaw rate": (Setpoint(now_ns, 0.0, 0.0, math.inf), rest),
        "a reversal": (Setpoint(now_ns, -0.01, 0.0, 0.0), rest),
        "overspeed": (Setpoint(now_ns, 1.01 * limits.max_speed_mps, 0.0, 0.0), top),
        "too fast a turn": (Setpoint(now_ns, 0.0, 0.0, -1.01 * limits.max_yaw_rate_radps), rest),
        "a jump of speed": (Setpoint(now_ns, 1.01 * p * limits.max_accel_mps2, 0.0, 0.0), rest),
        "a drop of speed": (replace(fast, stamp_ns=now_ns, v_mps=fast.v_mps - 1.01 * drop_mps), fast),
        "a jerk": (replace(top, stamp_ns=now_ns, a_mps2=-1.01 * p * limits.max_jerk_mps3), top),
        "an old command": (replace(rest, stamp_ns=now_ns - round(1.01 * limits.max_age_s * NS_PER_S)), None),
        "a command from the future": (replace(rest, stamp_ns=now_ns + 1), rest),
    }
    numbers = tuple(getattr(limits, bound.name) for bound in fields(limits))
    if not all(0.0 < number < math.inf for number in numbers):
        return f"its limits are no limits: {limits}"
    for name, (setpoint, last) in right.items():
        if problem := objection(setpoint, last, limits, now_ns):
            return f"it objects to {name}: {problem}"
    for name, (setpoint, last) in wrong.items():
        # The speed itself must not hide what the other tests let pass.
        roomy = limits if name == "overspeed" else replace(limits, max_speed_mps=2.0 * fast.v_mps)
        if not objection(setpoint, last, roomy, now_ns):
            return f"it lets pass {name}"
    return ""


class GuardedChassis(DeviceWrapper):
    """hal.api.Chassis around another one."""

    def __init__(self, chassis: Chassis, limits: GuardLimits) -> None:
        super().__init__(chassis)
        self._chassis = chassis
        self._limits = limits
        self._last: Setpoint | None = None
        self._last_ns: int | None = None
        self._asked_zero = True
        self._armed = False
        self._violation = ""
        self._refusal = ""
        self._consented = False

    def exchange(self, setpoint: Setpoint | None, now_ns: int) -> ChassisState:
        """See hal.api.Chassis."""
        problem = self._objection(setpoint, now_ns)
        consented, self._consented = self._consented, False
        if problem and (consented or not self._violation):
            self._latch(problem, now_ns)
            consented = False
        passed = setpoint if consented or not self._violation else None
        state = self._chassis.exchange(passed, now_ns)
        if consented:
            self._unlatch_if_followed(state)
        self._armed = state.mode is ChassisMode.ARMED
        self._last = (passed or Setpoint(now_ns, 0.0, 0.0, 0.0)) if self._armed else None
        self._asked_zero = setpoint is None or (setpoint.v_mps == 0.0 and setpoint.w_radps == 0.0)
        return self._told(state)

    def arm(self, now_ns: int) -> None:
        """See hal.api.Chassis. Refused while the guard's own checks fail."""
        self._refusal = ""
        if broken := self_check(self._limits):
            self._latch(f"its own check fails: {broken}", now_ns)
        elif self._violation and not self._asked_zero:
            self._refusal = "the command is not zero"
        else:
            self._consented = True
            self._last_ns = None
            self._chassis.arm(now_ns)

    def stop(self, now_ns: int) -> None:
        """See hal.api.Chassis. Does not unlatch."""
        self._chassis.stop(now_ns)

    def _objection(self, setpoint: Setpoint | None, now_ns: int) -> str:
        last_ns, self._last_ns = self._last_ns, now_ns
        if last_ns is not None and now_ns < last_ns:
            return f"time runs backwards by {(last_ns - now_ns) / NS_PER_MS:.0f} ms"
        if setpoint is None:  # asks for the stop itself
            return ""
        return objection(setpoint, self._last, self._limits, now_ns)

    def _latch(self, problem: str, now_ns: int) -> None:
        self._violation = problem
        self._refusal = ""
        self._chassis.stop(now_ns)

    def _unlatch_if_followed(self, state: ChassisState) -> None:
        """Release the latch if the driver has accepted the consent, too; otherwise keep its refusal."""
        if state.mode in (ChassisMode.ARMING, ChassisMode.ARMED):
            self._violation = ""
        elif self._violation and state.mode not in LATCHED_MODES:  # the reason of a latch is shown too
            self._refusal = state.reason.rpartition("arming refused: ")[2]

    def _told(self, state: ChassisState) -> ChassisState:
        if not self._violation:
            return state
        refusal = f"; arming refused: {self._refusal}" if self._refusal else ""
        reason = f"output guard: {self._violation}{refusal}"
        if state.mode in LATCHED_MODES:
            return replace(state, reason=f"{reason}; {state.reason}")
        return replace(state, mode=ChassisMode.ESTOP, reason=reason)


class GuardedCanLink(DeviceWrapper):
    """hal.api.CanLink that sends nothing but the identifiers it was given, each with its length at most."""

    def __init__(self, link: CanLink, allowed: Mapping[int, int]) -> None:
        super().__init__(link)
        self._link = link
        self._allowed = allowed

    def send(self, frame: CanFrame) -> None:
        """See hal.api.CanLink. A frame that is not allowed raises LinkLost: the driver latches."""
        if len(frame.data) > self._allowed.get(frame.arbitration_id, -1):
            raise LinkLost(
                f"output guard: CAN frame 0x{frame.arbitration_id:X} of {len(frame.data)} bytes is not on "
                "the list of what may be sent"
            )
        self._link.send(frame)

    def receive(self) -> CanFrame | None:
        """See hal.api.CanLink."""
        return self._link.receive()
