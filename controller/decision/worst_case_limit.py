"""The worst case as a speed limit: how fast may the robot go and still stand before a body could touch it?

controller/decision/manoeuvres.py tells how far each body may change its velocity, and
controller/decision/reachability.py what it could reach by that. This file tries emergency stops from many
speeds, and makes a Limit of the greatest speed that is safe. controller/decision/speed_limits.py calls it
last, after the other advisers.
"""

from __future__ import annotations

import math

import numpy as np

from config.decision import DecisionConfig
from config.robot import Limits
from controller import braking
from controller.decision.decision import Reason
from controller.decision.limits import (
    ALONGSIDE_M,
    UNSEEN_ERROR_SIGMAS,
    Gap,
    Limit,
    Motion,
    allowed_text,
)
from controller.decision.manoeuvres import manoeuvres_of
from controller.decision.reachability import (
    Reach,
    Stops,
    count_safe_stops,
    passes_clear,
    reach,
    stops,
)
from controller.decision.watched import Watched
from controller.profile import SpeedRamps, ramps_from
from hal.types import Flags, FloatArray

# Times that are looked at: every 0.1 s up to 2 s, where stops from low speeds end, then every 0.2 s.
_STEP_S, _FINE_S, _COARSE_STEP_S = 0.1, 2.0, 0.2
_SPEEDS = 31  # how many speeds are tried
# Longest wait before a stop begins: the delays of the configuration plus 0.5 s, which no control period
# exceeds; at least 1 s.
_PERIOD_S, _MIN_WAIT_S = 0.5, 1.0
# The robot begins to slow for the worst case this much earlier than an emergency stop would have to, so that
# comfortable braking suffices.
_FORESIGHT_S = 0.1
# The robot does not slow yet if it is faster than the worst case allows by no more than this.
_TOLERATED_EXCESS_MPS = 0.1


class WorstCase:
    """Limits the speed by what bodies could do at worst.

    times_s (K,): the times from now that are looked at; they cover any emergency stop.
    """

    def __init__(self, config: DecisionConfig, limits: Limits) -> None:
        self._config, self._limits = config, limits
        self._comfort, self._emergency = braking.comfort(limits), braking.emergency(limits)
        waits_s = max(config.chassis_delay_s + config.prediction.confirm_s + _PERIOD_S, _MIN_WAIT_S)
        stop = braking.stop(limits.max_speed_mps, 0.0, self._emergency)
        longest_s = stop.time_s + waits_s
        self.times_s: FloatArray = np.concatenate(
            (
                np.arange(0.0, _FINE_S, _STEP_S),
                np.arange(_FINE_S, longest_s + _COARSE_STEP_S, _COARSE_STEP_S),
            )
        )
        self._speeds = np.linspace(0.0, limits.max_speed_mps, _SPEEDS)
        self._latency_s = math.nan
        self._prepare(latency_s=0.0)

    def limit(self, watched: Watched, s_m: float, motion: Motion, chosen_mps: float) -> Limit | None:
        """The greatest speed from which the robot at s_m could still stop in time; None: no need to slow.

        watched: the bodies; the first times of watched.placed are times_s.
        chosen_mps: the speed that the other limits leave. If a comfortable ramp to it gets past all bodies,
        whatever they do, the robot need not be able to stop.

        The limit is urgent if even an emergency stop that begins now would be too late. That may hold for a
        robot that is already slowing down to a safe chosen_mps: then it has to brake harder.
        """
        bodies, placed = watched.bodies, watched.placed
        position_uncertainty_m = UNSEEN_ERROR_SIGMAS * watched.velocities.sigma_along_mps * bodies.unseen_s
        rows = placed.block_from_s_m[:, 0] + position_uncertainty_m > s_m - ALONGSIDE_M
        if not np.count_nonzero(rows):
            return None
        reached = self._reach(watched, rows)
        self._prepare(motion.latency_s)
        if min(reached.block_from_s_m[:, -1].tolist()) > s_m + self._furthest_m:
            return None
        young = bodies.age_s < self._config.prediction.confirm_s
        speed = self._speed(reached, young, watched.could_enter, s_m)
        if speed >= min(chosen_mps, self._limits.max_speed_mps) and speed >= motion.v_mps:
            return None
        go = ramps_from(motion, np.array([chosen_mps]), self._comfort)
        if passes_clear(go, s_m, self.times_s, reached):
            return None
        urgent = False
        if motion.v_mps > speed:
            urgent = self._too_late(motion, s_m, reached, rows)
            if not urgent and motion.v_mps <= speed + _TOLERATED_EXCESS_MPS:
                # An emergency stop is still in time. Braking for each small fluctuation would only cost time.
                speed = motion.v_mps
        nearest = int(np.where(rows, placed.block_from_s_m[:, 0], math.inf).argmin())
        gap = Gap(
            float(placed.block_from_s_m[nearest, 0]) - s_m,
            obstacle_id=int(bodies.ids[nearest]),
            unseen_s=float(bodies.unseen_s[nearest]),
        )
        return Limit(speed, lambda: _reason(gap, speed), urgent)

    def _too_late(self, motion: Motion, s_m: float, reached: Reach, counts: Flags) -> bool:
        """Whether even an emergency stop that begins now would touch a body in the mask counts (N,)."""
        now = self._stops(np.array([motion.v_mps]), motion.a_mps2, motion.latency_s)
        return count_safe_stops(now, s_m, reached, counts) == 0

    def _speed(self, reached: Reach, young: Flags, enters: Flags, s_m: float) -> float:
        """The greatest safe speed; inf: no need to slow.

        For confirmed bodies the stop begins _FORESIGHT_S later. For young bodies it begins confirm_s later:
        they may be confirmed first while there is time. Bodies that do not enter the corridor (not in enters)
        never limit the speed below beside_mps.
        """
        speed = self._greatest(self._stops_early, reached, ~young, s_m)
        if np.count_nonzero(young):
            speed = min(speed, self._greatest(self._stops_after_confirming, reached, young, s_m))
        beside_mps = self._config.prediction.beside_mps
        if speed >= beside_mps:
            return speed
        return max(speed, min(self._greatest(self._stops_early, reached, enters, s_m), beside_mps))

    def _greatest(self, stopping: Stops, reached: Reach, counts: Flags, s_m: float) -> float:
        """The greatest speed whose stop stays short of all bodies in the mask counts (N,).

        inf: every stop does; 0: none does.
        """
        stand = count_safe_stops(stopping, s_m, reached, counts)
        return float(self._speeds[max(stand - 1, 0)]) if stand < len(self._speeds) else math.inf

    def _prepare(self, latency_s: float) -> None:
        """Make the stops that all decisions with this latency compare, and how far the longest one leads."""
        if latency_s == self._latency_s:
            return
        self._latency_s = latency_s
        confirm_s = self._config.prediction.confirm_s
        self._stops_early = self._stops(self._speeds, 0.0, latency_s + _FORESIGHT_S)
        self._stops_after_confirming = self._stops(self._speeds, 0.0, latency_s + confirm_s)
        # Which of the two waits is longer depends on the configuration.
        waits = self._stops_early, self._stops_after_confirming
        self._furthest_m = float(max(stop.distance_m.max() for stop in waits))

    def _reach(self, watched: Watched, counts: Flags) -> Reach:
        manoeuvres = manoeuvres_of(watched, self._config.prediction)
        margin_m = self._config.margins.least_m
        max_mps = self._limits.max_obstacle_speed_mps
        return reach(watched.placed, self.times_s, manoeuvres, max_mps, margin_m, counts)

    def _stops(self, speeds: FloatArray, a_mps2: float, latency_s: float) -> Stops:
        ramps = SpeedRamps(
            speeds,
            a_mps2,
            np.zeros(len(speeds)),
            self._emergency,
            accel_mps2=self._limits.max_accel_mps2,
            latency_s=latency_s,
        )
        return stops(ramps, self.times_s)


def _reason(gap: Gap, speed_mps: float) -> Reason:
    ahead = f"{gap.name}, {max(gap.distance_m, 0.0):.1f} m ahead"
    sentence = f"{ahead}, could step into the way: {allowed_text(speed_mps)}"
    return Reason("worst case", sentence, gap.obstacle_id, gap.distance_m)
