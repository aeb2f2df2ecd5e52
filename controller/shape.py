"""Decision -> speed: jerk-limited by ruckig, always able to end at rest, never reversing.

The only importer of ruckig. Its pitfalls (verified with 0.19.4) and what is done about them here:

* The velocity interface has no speed limit. So the target is capped, and the invariant v + a^2 / 2J <= v_max
  for a > 0 is kept whenever the jerk limit is lowered.
* It reverses to respect the jerk limit when v < a^2 / 2J. So the jerk limit is not lowered while that holds.
* A target position closer than the stopping distance makes it overshoot and come back. So the position
  interface is used only for positions that can be reached according to braking.stop.
* An error leads to the stop profile of controller/profile.py, never to the unshaped input.
"""

from __future__ import annotations

import math

from ruckig import (  # type: ignore[import-not-found]  # a compiled module without stubs
    ControlInterface,
    InputParameter,
    Result,
    Ruckig,
    RuckigError,
    Trajectory,
)

from config.robot import Limits
from controller import braking
from controller.base.chassis_lag import ChassisLag
from controller.braking import BrakeLimits
from controller.profile import stop_step
from hal.records import record

# The stop at the end of the path is planned a little gentler than allowed, so that corrections by odometry on
# the way can still be followed.
_PLAN_DECEL = 0.97
_PLAN_JERK = 0.9
_OVERRUN_M = 0.002  # if the stop ends this far beyond the end, it is no longer aimed at the end
_CORRECTION = 0.1  # share of the odometry's correction that is applied in each step
_JUMP_M = 0.5  # a larger correction is applied at once
_ARRIVED_M = 0.008  # at rest this near to the end, the robot stays
# This near to the end, and with less than this much speed left over once the deceleration has been eased out,
# v and a go to zero together.
_CLOSE_ENOUGH_M = 0.004
_LAST_EASE_MPS = 0.005
_TINY = 1e-9
_TOLERANCE = 1e-7


@record(frozen=True, slots=True)
class ShapedSpeed:
    """One point of the profile. fault: why it comes from the stop profile and not from ruckig; else ""."""

    v_mps: float
    a_mps2: float
    fault: str = ""


class SpeedShaper:
    """Steps the commanded speed towards a target, one control period a step.

    It feeds back its own state, since the noise of the measured speed would be differentiated twice.
    chassis_delay_s: assumed lag of the chassis behind its command until it has been learnt. The distance that
    the chassis still travels because of the lag is subtracted from the distance to the end.
    """

    def __init__(self, limits: Limits, period_s: float, chassis_delay_s: float = 0.0) -> None:
        if not (0.0 < period_s <= 0.5 and 0.0 <= chassis_delay_s <= 2.0):
            raise ValueError(f"impossible period {period_s} s or chassis delay {chassis_delay_s} s")
        self._limits = limits
        self._period_s = period_s
        self._lag = ChassisLag(chassis_delay_s)
        self._stepped_m = 0.0
        self._comfort = braking.comfort(limits)
        self._emergency = braking.emergency(limits)
        self._plan = BrakeLimits(_PLAN_DECEL * limits.max_accel_mps2, _PLAN_JERK * limits.max_jerk_mps3)
        self._active = self._comfort
        self._to_end_m = math.inf
        self._v, self._a = 0.0, 0.0
        self._otg = Ruckig(1)
        self._problem, self._trajectory = _problem_within(limits), Trajectory(1)
        self._solves_within: BrakeLimits | None = None

    @property
    def v_mps(self) -> float:
        """The speed commanded last."""
        return self._v

    @property
    def a_mps2(self) -> float:
        """The acceleration commanded last."""
        return self._a

    def reset(self) -> None:
        """Start again from rest: the chassis does not follow now."""
        self._v, self._a = 0.0, 0.0
        self._active, self._to_end_m = self._comfort, math.inf
        self._lag.restart()

    def unlearn_lag(self) -> None:
        """The chassis does not follow now: of its lag nothing counts that was learnt lately."""
        self._lag.take_back()

    def begin_anew(self) -> None:
        """Start again from rest, after a while in which the chassis did not follow: see unlearn_lag()."""
        self.unlearn_lag()
        self.reset()

    def step(
        self, target_speed_mps: float, *, emergency: bool = False, distance_to_end_m: float = math.inf
    ) -> ShapedSpeed:
        """The speed and acceleration one period later.

        If the target or the distance is NaN, the robot stops. distance_to_end_m: to the end of the path, by
        odometry; the robot stops there.
        """
        if math.isnan(distance_to_end_m) or math.isnan(target_speed_mps):
            target_speed_mps = 0.0
        target = min(max(target_speed_mps, 0.0), self._limits.max_speed_mps)
        self._choose_limits(emergency)
        self._track_end(distance_to_end_m)
        fault = ""
        try:
            v, a = self._follow(target)
            self._check(v, a)
        except (RuckigError, ArithmeticError) as error:
            fault = f"ruckig: {' '.join(str(error).split())[:200]}"
            v, a = stop_step(self._v, self._a, self._active, self._period_s)
        self._stepped_m = 0.5 * (self._v + v) * self._period_s
        self._to_end_m -= self._stepped_m
        self._v, self._a = max(v, 0.0), a
        return ShapedSpeed(self._v, self._a, fault)

    def _choose_limits(self, emergency: bool) -> None:
        """Harder limits at once; back to comfort in two steps, each only if it causes no reversal."""
        if emergency:
            self._active = self._emergency
            return
        let_go_mps = self._a * self._a / (2.0 * self._comfort.jerk_mps3)
        if self._a >= 0.0:
            gentle_jerk = self._v + let_go_mps <= self._limits.max_speed_mps + _TINY
        else:
            gentle_jerk = self._v >= let_go_mps and self._a >= -self._comfort.decel_mps2
        if gentle_jerk:
            self._active = self._comfort
        else:
            self._active = BrakeLimits(self._comfort.decel_mps2, self._active.jerk_mps3)

    def _track_end(self, distance_to_end_m: float) -> None:
        """Update the distance still to be commanded: the own integral, slowly corrected by odometry."""
        if math.isnan(distance_to_end_m):
            return
        if math.isfinite(distance_to_end_m):
            self._lag.update(self._stepped_m, self._v, self._a, distance_to_end_m)
        measured_m = self._lag.to_command_m(distance_to_end_m, self._v, self._a)
        error_m = measured_m - self._to_end_m
        if abs(error_m) < _JUMP_M:
            self._to_end_m += _CORRECTION * error_m
        else:
            self._to_end_m = measured_m

    def _follow(self, target_mps: float) -> tuple[float, float]:
        """Go to the target speed while a stop at the end still fits afterwards; else towards that stop."""
        if math.isinf(self._to_end_m):
            return self._ramp_to(target_mps, self._active)
        needed_m = braking.stop(self._v, self._a, self._plan).distance_m
        spare_m = self._to_end_m - needed_m
        if self._v == 0.0 and self._a == 0.0 and spare_m < _ARRIVED_M:
            return 0.0, 0.0
        let_go_mps = self._a * self._a / (2.0 * self._plan.jerk_mps3)
        if self._a < 0.0 and self._v < let_go_mps + _LAST_EASE_MPS and abs(spare_m) < _CLOSE_ENOUGH_M:
            return self._ease_out()
        v, a = self._ramp_to(target_mps, self._active)
        left_m = self._to_end_m - 0.5 * (self._v + v) * self._period_s
        if braking.stop(max(v, 0.0), a, self._plan).distance_m <= left_m:
            return v, a
        if spare_m < -_OVERRUN_M or (self._a < 0.0 and self._v < let_go_mps):
            return self._ramp_to(0.0, self._active)
        self._problem.control_interface = ControlInterface.Position
        self._problem.target_position = [max(self._to_end_m, needed_m)]
        return self._solve(0.0, self._plan)

    def _ease_out(self) -> tuple[float, float]:
        """Stop with the jerk that brings v and a to zero together; more precision would make it creep."""
        exact = self._a * self._a / (2.0 * max(self._v, _TINY))
        jerk = min(max(exact, self._plan.jerk_mps3), self._active.jerk_mps3)
        return self._ramp_to(0.0, BrakeLimits(self._active.decel_mps2, jerk))

    def _ramp_to(self, target_mps: float, brake: BrakeLimits) -> tuple[float, float]:
        if self._v == target_mps and self._a == 0.0:
            return target_mps, 0.0
        self._problem.control_interface = ControlInterface.Velocity
        return self._solve(target_mps, brake)

    def _solve(self, target_mps: float, brake: BrakeLimits) -> tuple[float, float]:
        """One period on the way from the present state to target_mps."""
        problem, trajectory = self._problem, self._trajectory
        problem.current_velocity, problem.current_acceleration = [self._v], [self._a]
        problem.target_velocity = [target_mps]
        if brake is not self._solves_within:
            problem.min_acceleration, problem.max_jerk = [-brake.decel_mps2], [brake.jerk_mps3]
            self._solves_within = brake
        result = self._otg.calculate(problem, trajectory)
        if result not in (Result.Working, Result.Finished):
            raise ArithmeticError(f"no profile, result {result}")
        _, velocity, acceleration = trajectory.at_time(self._period_s)
        if trajectory.duration <= self._period_s:
            return target_mps, 0.0
        return float(velocity[0]), float(acceleration[0])

    def _check(self, v: float, a: float) -> None:
        """Raise ArithmeticError for what no chassis may get; written so that NaN is refused, too."""
        jerk = abs(a - self._a) / self._period_s
        hardest = max(self._active.decel_mps2, -self._a)
        if not (
            -_TOLERANCE <= v <= self._limits.max_speed_mps + _TOLERANCE
            and -hardest - _TOLERANCE <= a <= self._limits.max_accel_mps2 + _TOLERANCE
            and jerk <= self._active.jerk_mps3 + _TOLERANCE
        ):
            raise ArithmeticError(f"outside the limits: {v:.6f} m/s, {a:.6f} m/s2, {jerk:.6f} m/s3")


def _problem_within(limits: Limits) -> InputParameter:
    """What is the same in each step: it starts at position 0 and ends without acceleration."""
    problem = InputParameter(1)
    problem.current_position, problem.target_acceleration = [0.0], [0.0]
    problem.max_velocity, problem.max_acceleration = [limits.max_speed_mps], [limits.max_accel_mps2]
    return problem
