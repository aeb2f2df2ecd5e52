"""Speed limits for bodies that cross, come towards the robot or drive ahead of it.

controller/decision/crossing.py finds the conflicts and the speeds that solve each one. This file compares
letting the body pass with stopping before it (or following it), finds one speed that solves all conflicts,
and keeps each choice from step to step (hysteresis), so that noise does not change it.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from config.decision import DecisionConfig
from config.robot import Limits
from controller import braking
from controller.decision.bodies import Bodies
from controller.decision.crossing import Choice, Conflict, choices, find_conflicts
from controller.decision.decision import Reason, Rule
from controller.decision.lateral_margin import LateralMargin
from controller.decision.limits import (
    ALONGSIDE_M,
    STANDING_MPS,
    Gap,
    Limit,
    Motion,
    allowed_text,
    stop_before,
)
from controller.decision.watched import Watched
from controller.profile import SpeedRamps, ramps_from
from hal.records import record
from hal.types import FloatArray

_SPEEDS = 31  # how many speeds are tried
# Above this speed along the path a body drives ahead; above it in the other direction it is oncoming.
_DRIVES_AHEAD_MPS = 0.1
# Slowing down so as to arrive when a body leaves that has yet to come in is worth it only above this speed;
# below it, stopping before the body is as good.
_MIN_ARRIVAL_MPS = 0.3
# Nor is it worth it if the body leaves later than this: most bodies change their velocity before, and the
# robot can still stop.
_MAX_FORESEEN_LEAVE_S = 4.0
_LEAVE_TIME_WEIGHT = 0.2  # weight of the newest estimate in the average of a time of leaving
# A standing robot does not start until a body has passed that is beside it or will be within this time.
_WAIT_FOR_PASSING_S = 2.0
# Hysteresis: choosing to pass before a body needs this much more time than keeping that choice.
_SWITCH_MARGIN_S = 0.5


@record(frozen=True, slots=True, eq=False)
class _Offer:
    """What may be done about one body: the speeds that solve its conflict, and the limit if it goes first."""

    track_id: int
    choice: Choice
    limit: Limit


class MovingLimits:
    """Limits for moving bodies; keeps what hysteresis needs.

    times_s (K,): times from now at which bodies are placed.
    beside: which bodies are in the way; shared with StandingLimits.
    """

    def __init__(
        self, config: DecisionConfig, limits: Limits, times_s: FloatArray, beside: LateralMargin
    ) -> None:
        self._config, self._limits, self._times_s = config, limits, times_s
        self._comfort = braking.comfort(limits)
        self._speeds = np.linspace(0.0, limits.max_speed_mps, _SPEEDS)
        self._beside = beside
        self._robot_passes_first: set[int] = set()
        self._leaves_s: dict[int, float] = {}

    def forget(self) -> None:
        """Forget all choices: nothing moves."""
        self._robot_passes_first.clear()
        self._leaves_s.clear()

    def limits(
        self, watched: Watched, s_m: float, motion: Motion, base_mps: float, now_s: float
    ) -> tuple[list[Limit], float]:
        """The limits for a robot at s_m whose speed is otherwise base_mps, and the speed that they leave."""
        standing = motion.v_mps <= STANDING_MPS
        rows = self._in_the_way(watched, s_m, standing)
        if not len(rows):
            self.forget()
            self._note_inside(watched, set())
            return [], base_mps
        conflicts = self._conflicts(watched, rows, s_m, -math.inf if standing else s_m - ALONGSIDE_M, now_s)
        if not conflicts:
            return [], base_mps
        ramps = ramps_from(motion, self._speeds, self._comfort)
        offers = []
        for one in conflicts:
            stays = self._when_it_stays(one, watched, s_m, motion)
            offers.append(self._offer(one, watched.bodies, ramps, s_m, stays))
        return self._settle(offers, base_mps)

    def _in_the_way(self, watched: Watched, s_m: float, standing: bool) -> NDArray[np.intp]:
        """(R,) rows of the moving bodies ahead that enter.

        A standing robot also waits for a body that is about to walk into its side, or to pass along it within
        the lateral margin. A driving robot is past before that happens.
        """
        placed, enters = watched.placed, watched.enters
        ahead = placed.s_m[:, 0] + placed.half_s_m[:, 0] > s_m
        if standing:
            gap_m = placed.block_from_s_m[:, 0] - s_m
            passes = gap_m <= np.maximum(-watched.velocities.along_mps, 0.0) * _WAIT_FOR_PASSING_S
            enters = enters | (passes & (placed.clearance_m[:, 0] <= self._config.margins.lateral_m))
        return (watched.bodies.moving & ahead & enters).nonzero()[0]

    def _conflicts(
        self, watched: Watched, rows: NDArray[np.intp], s_m: float, from_s_m: float, now_s: float
    ) -> list[Conflict]:
        """The conflicts with the bodies rows that are not behind s_m and begin beyond from_s_m.

        Notes whose they are, and forgets the choices and times of all others.
        """
        ids = watched.bodies.ids
        needed_m = self._beside.all_needed_m(ids)
        sigma_mps = watched.velocities.sigma_left_mps * self._config.prediction.sigmas
        found = [
            one
            for one in find_conflicts(watched.placed, self._times_s, sigma_mps, needed_m, rows)
            if one.hi_in_m > s_m and one.lo_in_m > from_s_m
        ]
        track_ids = {int(ids[one.row]) for one in found}
        self._note_inside(watched, track_ids)
        self._robot_passes_first &= track_ids
        found = [self._steadied(one, int(ids[one.row]), now_s) for one in found]
        self._leaves_s = {
            track_id: when for track_id, when in self._leaves_s.items() if track_id in track_ids
        }
        return found

    def _note_inside(self, watched: Watched, in_the_way: set[int]) -> None:
        """The bodies with these ids count as in the corridor; of the others, those that moved away do not."""
        if not self._beside.is_empty:
            bodies = watched.bodies
            away = bodies.moving & (watched.placed.clearance_m[:, 0] > self._beside.farthest_m)
            self._beside.goes_out(bodies.ids[away].tolist())
        self._beside.comes_in(in_the_way)

    def _steadied(self, conflict: Conflict, track_id: int, now_s: float) -> Conflict:
        """The conflict with its time of leaving averaged: each estimate extrapolates a noisy speed."""
        if math.isinf(conflict.out_s):
            self._leaves_s.pop(track_id, None)
            return conflict
        leaves_s = now_s + conflict.out_s
        before_s = self._leaves_s.get(track_id, leaves_s)
        self._leaves_s[track_id] = before_s + _LEAVE_TIME_WEIGHT * (leaves_s - before_s)
        return replace(conflict, out_s=max(self._leaves_s[track_id] - now_s, conflict.in_s))

    def _when_it_stays(self, conflict: Conflict, watched: Watched, s_m: float, motion: Motion) -> Limit:
        """The limit if the body does not leave the corridor: stop before it, or follow it."""
        margins, velocities = self._config.margins, watched.velocities
        along_mps = float(velocities.along_mps[conflict.row])
        leader_stop_m = 0.0
        rule: Rule
        rule, what = "oncoming", f"approaches at {-along_mps:.1f} m/s,"
        if along_mps > _DRIVES_AHEAD_MPS:
            leader_mps = along_mps - float(velocities.sigma_along_mps[conflict.row])
            leader_stop_m = max(leader_mps, 0.0) ** 2 / (2.0 * self._config.prediction.leader_decel_mps2)
            rule, what = "leader", f"drives the same way at {along_mps:.1f} m/s,"
        elif along_mps > -_DRIVES_AHEAD_MPS:
            rule, what = "crossing", "is on the path"
        gap = Gap(
            float(watched.placed.block_from_s_m[conflict.row, 0]) - s_m,
            closing_mps=-along_mps,
            leader_stop_m=leader_stop_m,
            obstacle_id=int(watched.bodies.ids[conflict.row]),
            unseen_s=float(watched.bodies.unseen_s[conflict.row]),
        )
        return stop_before(gap, motion, self._comfort, margins.stop_m, margins.least_m, rule, what)

    def _offer(
        self, conflict: Conflict, bodies: Bodies, ramps: SpeedRamps, s_m: float, stays: Limit
    ) -> _Offer:
        """The offer for one conflict.

        stays: the limit if the body does not leave the corridor; it counts where waiting is not worth it.
        """
        margins, track_id = self._config.margins, int(bodies.ids[conflict.row])
        first = track_id in self._robot_passes_first
        enter_s = margins.crossing_s * (0.5 if first else 1.0) + (0.0 if first else _SWITCH_MARGIN_S)
        choice = choices(conflict, ramps, s_m, margins.least_m, margins.crossing_s, enter_s)
        if conflict.in_s <= 0.0 or conflict.hi_in_m <= s_m:
            choice = Choice(choice.yield_mps, math.inf)
        worth_mps = _MIN_ARRIVAL_MPS if _is_foreseen(conflict) else math.inf
        if choice.yield_mps < min(stays.speed_mps, worth_mps):
            return _Offer(track_id, Choice(stays.speed_mps, choice.first_mps), stays)

        def why() -> Reason:
            ahead_m, waits = conflict.lo_in_m - s_m, stays.reason
            name = Gap(ahead_m, obstacle_id=track_id, unseen_s=float(bodies.unseen_s[conflict.row])).name
            leaves = f", gone in {conflict.out_s:.1f} s" if math.isfinite(conflict.out_s) else " and stays"
            sentence = (
                f"{name} crosses {max(ahead_m, 0.0):.1f} m ahead{leaves}: {allowed_text(choice.yield_mps)}"
            )
            return Reason(
                "crossing", sentence, track_id, ahead_m, waits.closing_mps, waits.required_m, waits.margin_m
            )

        return _Offer(track_id, choice, Limit(choice.yield_mps, why))

    def _settle(self, offers: list[_Offer], base_mps: float) -> tuple[list[Limit], float]:
        """The limits that apply, and the greatest speed up to base_mps that solves every conflict.

        At that speed the robot passes each body either before it or after it. Which bodies it passes before
        is remembered for the next step.
        """
        speed, found = base_mps, []
        waiting = list(offers)
        while waiting:
            blocked = [one for one in waiting if one.choice.yield_mps < speed < one.choice.first_mps]
            if not blocked:
                break
            worst = min(blocked, key=lambda one: one.choice.yield_mps)
            speed = worst.choice.yield_mps
            found.append(worst.limit)
            waiting.remove(worst)
        for one in offers:
            if one.choice.yield_mps < speed and speed >= one.choice.first_mps:
                self._robot_passes_first.add(one.track_id)
            else:
                self._robot_passes_first.discard(one.track_id)
        return found, speed


def _is_foreseen(conflict: Conflict) -> bool:
    """Whether the robot slows down early for what a body will do, not only so that it can stop before it.

    Of a body that is in the way already, only the time is known at which it has certainly left. It mostly
    leaves sooner, and then the robot would have slowed down too much.
    """
    return conflict.in_s > 0.0 and conflict.out_s <= _MAX_FORESEEN_LEAVE_S
