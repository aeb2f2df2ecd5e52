"""The worst case as a speed limit: how fast may the robot go and still stand before a body could touch it?

controller/decision/reachability.py has the geometry: what each body could reach, and how much room a stop
leaves. This file decides how much each body may change its velocity, tries emergency stops from many speeds,
and makes a Limit of the greatest speed that is safe. controller/decision/speed_limits.py calls it last, after
the other advisers.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from config.decision import DecisionConfig
from config.robot import Limits
from controller import braking
from controller.decision.bodies import Bodies
from controller.decision.corridor import PathVelocities, Placed
from controller.decision.decision import Reason
from controller.decision.limits import (
    ALONG_TO_SIDE_RATIO,
    ALONGSIDE_M,
    UNSEEN_ERROR_SIGMAS,
    Limit,
    Motion,
    allowed_text,
)
from controller.decision.reachability import (
    Reach,
    Stops,
    count_safe_stops,
    last_stop_before_entry,
    passes_clear,
    reach,
    room,
    stops,
)
from controller.profile import SpeedRamps, comfortable
from hal.compiled import compiled
from hal.records import record
from hal.types import FloatArray

# Times that are looked at: every 0.1 s up to 2 s, where stops from low speeds end, then every 0.2 s.
_STEP_S, _FINE_S, _COARSE_STEP_S = 0.1, 2.0, 0.2
_SPEEDS = 31  # how many speeds are tried
# Longest wait before a stop begins: the delays of the configuration plus 0.5 s, which no control period
# exceeds; at least 1 s.
_PERIOD_S, _MIN_WAIT_S = 0.5, 1.0
# The robot begins to slow for the worst case this much earlier than an emergency stop would have to, so that
# comfortable braking suffices.
_FORESIGHT_S = 0.1
# Least sideways speed that is assumed when a body's direction of motion is judged.
_MIN_SIDEWAYS_MPS = 0.1
# A body that comes towards the robot and was seen for this long has seen the robot, too.
_AWARE_AFTER_S = 1.0
# The robot does not slow yet if it is faster than the worst case allows by no more than this.
_TOLERATED_EXCESS_MPS = 0.1


@record(frozen=True, slots=True, eq=False)
class _MayDo:
    """What N bodies may do: arguments of reach(), (N,) each; along the path, and sideways."""

    since_s: FloatArray
    spread_along_mps: FloatArray
    spread_left_mps: FloatArray
    speed_mps: FloatArray
    change_along_mps2: FloatArray
    change_left_mps2: FloatArray
    uncertain_along_m: FloatArray
    uncertain_left_m: FloatArray


class WorstCase:
    """Limits the speed by what bodies could do at worst.

    times_s (K,): the times from now that are looked at; they cover any emergency stop.
    """

    def __init__(self, config: DecisionConfig, limits: Limits) -> None:
        self._config, self._limits = config, limits
        waits_s = max(config.chassis_delay_s + config.prediction.confirm_s + _PERIOD_S, _MIN_WAIT_S)
        stop = braking.stop(limits.max_speed_mps, 0.0, braking.emergency(limits))
        longest_s = stop.time_s + waits_s
        self.times_s: FloatArray = np.concatenate(
            (
                np.arange(0.0, _FINE_S, _STEP_S),
                np.arange(_FINE_S, longest_s + _COARSE_STEP_S, _COARSE_STEP_S),
            )
        )
        self._speeds = np.linspace(0.0, limits.max_speed_mps, _SPEEDS)
        self._latency_s = math.nan
        self._stops_early = self._stops_now = self._stops(self._speeds, 0.0, 0.0)
        self._stops_after_confirming = self._stops_now

    def limit(
        self,
        bodies: Bodies,
        placed: Placed,
        velocities: PathVelocities,
        enters: NDArray[np.bool_],
        s_m: float,
        motion: Motion,
        since_s: float,
        chosen_mps: float,
    ) -> Limit | None:
        """The greatest speed from which the robot at s_m could still stop in time; None: no need to slow.

        placed: the bodies, since_s after their scene; its first times are times_s.
        enters (N,): which bodies' measured motion leads into the corridor.
        chosen_mps: the speed that the other limits leave. If a comfortable ramp to it gets past all bodies,
        whatever they do, the robot need not be able to stop.

        The limit is urgent if even an emergency stop that begins now would be too late. That may hold for a
        robot that is already slowing down to a safe chosen_mps: then it has to brake harder.
        """
        position_uncertainty_m = UNSEEN_ERROR_SIGMAS * velocities.sigma_along_mps * bodies.unseen_s
        rows = placed.block_from_s_m[:, 0] + position_uncertainty_m > s_m - ALONGSIDE_M
        if not np.count_nonzero(rows):
            return None
        reached = self._reach(bodies, placed, velocities, since_s, rows)
        self._prepare(motion.latency_s)
        if min(reached.block_from_s_m[:, -1].tolist()) > s_m + self._furthest_m:
            return None
        young = bodies.age_s < self._config.prediction.confirm_s
        speed = self._speed(reached, young, enters, s_m)
        if speed >= min(chosen_mps, self._limits.max_speed_mps) and speed >= motion.v_mps:
            return None
        go = comfortable(self._limits, motion, np.array([chosen_mps]))
        if passes_clear(go, s_m, self.times_s, reached):
            return None
        urgent = False
        if motion.v_mps > speed:
            now = self._stops(np.array([motion.v_mps]), motion.a_mps2, motion.latency_s)
            urgent = bool(room(now, s_m, reached)[0] < 0.0)
            if not urgent and motion.v_mps <= speed + _TOLERATED_EXCESS_MPS:
                # An emergency stop is still in time. Braking for each small fluctuation would only cost time.
                speed = motion.v_mps
        row = int(np.where(rows, placed.block_from_s_m[:, 0], math.inf).argmin())
        track_id = int(bodies.ids[row])
        gap_m = float(placed.block_from_s_m[row, 0]) - s_m

        def why() -> Reason:
            ahead = f"obstacle {track_id}, {max(gap_m, 0.0):.1f} m ahead"
            return Reason(
                "worst case", f"{ahead}, could step into the way: {allowed_text(speed)}", track_id, gap_m
            )

        return Limit(speed, why, urgent)

    def _speed(
        self, reached: Reach, young: NDArray[np.bool_], enters: NDArray[np.bool_], s_m: float
    ) -> float:
        """The greatest safe speed; inf: no need to slow.

        For confirmed bodies the stop begins _FORESIGHT_S later, but the limit is not lower than the greatest
        speed whose immediate stop ends before any body could be in the way. For young bodies it begins
        confirm_s later: they may be confirmed first while there is time. Bodies that do not enter the
        corridor (not in enters) never limit the speed below beside_mps.
        """
        speed = self._greatest(self._stops_early, reached, ~young, s_m)
        if math.isfinite(speed):
            soon = last_stop_before_entry(self._stops_now, reached)
            if soon >= 0:
                speed = max(speed, float(self._speeds[soon]))
        if np.count_nonzero(young):
            speed = min(speed, self._greatest(self._stops_after_confirming, reached, young, s_m))
        beside_mps = self._config.prediction.beside_mps
        if speed >= beside_mps:
            return speed
        return max(speed, min(self._greatest(self._stops_early, reached, enters, s_m), beside_mps))

    def _greatest(self, stopping: Stops, reached: Reach, counts: NDArray[np.bool_], s_m: float) -> float:
        """The greatest speed whose stop stays short of all bodies in the mask counts (N,).

        inf: every stop does; 0: none does.
        """
        stand = count_safe_stops(stopping, s_m, reached, counts)
        return float(self._speeds[max(stand - 1, 0)]) if stand < len(self._speeds) else math.inf

    def _prepare(self, latency_s: float) -> None:
        if latency_s == self._latency_s:
            return
        self._latency_s = latency_s
        confirm_s = self._config.prediction.confirm_s
        self._stops_early = self._stops(self._speeds, 0.0, latency_s + _FORESIGHT_S)
        self._stops_after_confirming = self._stops(self._speeds, 0.0, latency_s + confirm_s)
        self._stops_now = self._stops(self._speeds, 0.0, latency_s)
        # Which of the two waits is longer depends on the configuration.
        waits = self._stops_early, self._stops_after_confirming
        self._furthest_m = float(max(stop.distance_m.max() for stop in waits))

    def _reach(
        self,
        bodies: Bodies,
        placed: Placed,
        velocities: PathVelocities,
        since_s: float,
        counts: NDArray[np.bool_],
    ) -> Reach:
        prediction = self._config.prediction
        fields = _may_do(
            velocities.along_mps,
            velocities.left_mps,
            velocities.sigma_along_mps,
            velocities.sigma_left_mps,
            velocities.innovation_along_mps,
            velocities.innovation_left_mps,
            placed.d_m[:, 0],
            placed.clearance_m[:, 0],
            bodies.moving,
            bodies.age_s,
            bodies.unseen_s,
            since_s,
            prediction.sigmas,
            prediction.cut_in_mps2,
            prediction.manoeuvre_mps2,
            prediction.oncoming_mps2,
            ALONG_TO_SIDE_RATIO,
            UNSEEN_ERROR_SIGMAS,
        )
        may_do = _MayDo(*fields)
        return reach(
            placed,
            self.times_s,
            may_do.since_s,
            spread_mps=(may_do.spread_along_mps, may_do.spread_left_mps),
            speed_mps=may_do.speed_mps,
            manoeuvre_mps2=(may_do.change_along_mps2, may_do.change_left_mps2),
            max_mps=self._limits.max_obstacle_speed_mps,
            margin_m=self._config.margins.least_m,
            position_uncertainty_m=(may_do.uncertain_along_m, may_do.uncertain_left_m),
            counts=counts,
        )

    def _stops(self, speeds: FloatArray, a_mps2: float, latency_s: float) -> Stops:
        ramps = SpeedRamps(
            speeds,
            a_mps2,
            np.zeros(len(speeds)),
            accel_mps2=self._limits.max_accel_mps2,
            decel_mps2=self._limits.emergency_decel_mps2,
            jerk_mps3=self._limits.emergency_jerk_mps3,
            latency_s=latency_s,
        )
        return stops(ramps, self.times_s)


@compiled(
    "float64[:], float64[:], float64[:], float64[:], float64[:], float64[:], float64[:], float64[:],"
    "boolean[:], float64[:], float64[:], float64, float64, float64, float64, float64, float64, float64"
)
def _may_do(
    along_mps: FloatArray,
    left_mps: FloatArray,
    sigma_along_mps: FloatArray,
    sigma_left_mps: FloatArray,
    innovation_along_mps: FloatArray,
    innovation_left_mps: FloatArray,
    d_m: FloatArray,
    clearance_m: FloatArray,
    moving: NDArray[np.bool_],
    age_s: FloatArray,
    unseen_s: FloatArray,
    since_s: float,
    sigmas: float,
    cut_in_mps2: float,
    manoeuvre_mps2: float,
    oncoming_mps2: float,
    along_to_side_ratio: float,
    unseen_error_sigmas: float,
) -> FloatArray:
    """(8, N) the fields of _MayDo."""
    answers = np.zeros((8, len(along_mps)))
    since, spread_along, spread_left, speed, along, sideways, uncertain_along, uncertain_left = answers
    for k in range(len(along_mps)):
        # unaware: goes in the robot's direction, so it does not see the robot coming and is beside it for
        # long. comes: comes towards the robot, sees it after a while and keeps its lane. leaves: moves away
        # from the path. All but comes and leaves may have changed their velocity since they left the view.
        aslant_mps = max(abs(left_mps[k]), _MIN_SIDEWAYS_MPS)
        outwards, beside = left_mps[k] * d_m[k] > 0.0, clearance_m[k] > 0.0
        unaware = along_mps[k] > (along_to_side_ratio if outwards else 1.0) * aslant_mps
        comes = along_mps[k] < -aslant_mps
        leaves = outwards and beside and not unaware
        if moving[k]:
            # A body that turns into the way also slows down along the path.
            along[k] = cut_in_mps2 if unaware and beside else manoeuvre_mps2
            sideways[k] = cut_in_mps2 if unaware else manoeuvre_mps2
            if comes and age_s[k] >= _AWARE_AFTER_S:
                sideways[k] = oncoming_mps2
        since[k] = since_s + (0.0 if comes or leaves else unseen_s[k])
        speed[k] = math.hypot(along_mps[k], left_mps[k])
        spread_along[k] = max(sigmas * sigma_along_mps[k], abs(innovation_along_mps[k]))
        spread_left[k] = max(sigmas * sigma_left_mps[k], abs(innovation_left_mps[k]))
        if not leaves:
            uncertain_along[k] = unseen_error_sigmas * unseen_s[k] * sigma_along_mps[k]
            uncertain_left[k] = unseen_error_sigmas * unseen_s[k] * sigma_left_mps[k]
    return answers
