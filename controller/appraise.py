"""Obstacles and what depth sees -> speed limits with their reasons, for one control step."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from config.decision import DecisionConfig
from config.robot import Limits
from controller import braking
from controller.bodies import Bodies
from controller.corridor import Placed, place, velocity_on_path
from controller.crossing import Choice, Conflict, choices, find_conflicts
from controller.decision import Reason
from controller.knowledge import Knowledge
from controller.limits import Gap, Limit, Motion, allowed, stop_before
from controller.memory import visible_from_m
from controller.profile import SpeedRamps
from controller.worst_case import WorstCase
from hal.types import CameraMount, FloatArray

_COARSE_S = 0.5
_SPEEDS = 31
_ALONGSIDE_M = 0.1
_INSIDE_BODY_M = 0.05
_DRIVES_AHEAD_MPS = 0.1
_SAME_SURFACE_M = 0.8
# Slower than this, arriving as it leaves is no better than waiting at the line.
_WORTH_ARRIVING_MPS = 0.3
_AVERAGE = 0.1
# A choice that was made is kept unless this much time would be lost or gained.
_STICKY_S = 0.5


class Appraiser:
    """Keeps what hysteresis needs from step to step: who is in the corridor, who was let pass first."""

    def __init__(self, config: DecisionConfig, limits: Limits, mount: CameraMount) -> None:
        self._config, self._limits, self._mount = config, limits, mount
        self._comfort, self._emergency = braking.comfort(limits), braking.emergency(limits)
        self._worst_case = WorstCase(config, limits)
        fine = self._worst_case.times_s
        coarse = np.arange(fine[-1] + _COARSE_S, config.prediction.horizon_s + _COARSE_S, _COARSE_S)
        self._times_s = np.concatenate((fine, coarse))
        self._speeds = np.linspace(0.0, limits.max_speed_mps, _SPEEDS)
        self._inside: set[int] = set()
        self._goes_first: set[int] = set()
        self._leaves_s: dict[int, float] = {}

    def limits(
        self, known: Knowledge, s_m: float, motion: Motion, base_mps: float, now_s: float
    ) -> list[Limit]:
        """Every limit that obstacles and depth put on the speed of a robot at s_m; base_mps: what the path
        allows."""
        found = [*self._depth(known, s_m, motion)]
        bodies = known.bodies
        if not len(bodies):
            self._inside.clear()
            self._goes_first.clear()
            return found
        since = known.age_s + self._times_s
        placed = place(bodies, known.corridor, since, s_m, self._config.sight.range_m + 2.0)
        found += self._standing(known, placed, s_m, motion)
        base_mps = min([base_mps, *(limit.speed_mps for limit in found)])
        crossing, chosen_mps = self._moving(known, placed, s_m, motion, base_mps, now_s)
        found += crossing
        go = self._ramps(motion, np.array([chosen_mps]))
        worst = self._worst_case.limit(known, placed, s_m, motion, go)
        if worst is not None:
            found.append(worst)
        self._inside &= {int(one) for one in bodies.ids}
        return found

    def _depth(self, known: Knowledge, s_m: float, motion: Motion) -> list[Limit]:
        """The nearest unexplained surface, and the end of the floor that was seen to be free."""
        margins, sight = self._config.margins, known.sight
        front_m = s_m + known.corridor.front_m
        found = []
        if math.isfinite(sight.surface_s_m):
            gap = Gap(sight.surface_s_m - front_m, obstacle_id=_owner(known, sight.surface_s_m, s_m))
            found.append(
                stop_before(gap, motion, self._comfort, margins.stop_m, margins.least_m, "depth", "stands")
            )
        if sight.known_s_m < known.corridor.path.length_m + known.corridor.front_m:
            gap = Gap(sight.known_s_m - front_m)
            limit = stop_before(gap, motion, self._comfort, margins.least_m, -math.inf, "unseen", "")
            sentence = (
                f"the floor is not seen to be free beyond {max(gap.distance_m, 0.0):.1f} m: "
                f"{allowed(limit.speed_mps)}"
            )
            reason = Reason(
                "unseen",
                sentence,
                distance_m=gap.distance_m,
                required_m=limit.reason.required_m,
                margin_m=limit.reason.margin_m,
            )
            found.append(Limit(limit.speed_mps, reason))
        return found

    def _standing(self, known: Knowledge, placed: Placed, s_m: float, motion: Motion) -> list[Limit]:
        bodies, margins = known.bodies, self._config.margins
        stop_m = self._stop_m(known, placed)
        found = []
        gaps = placed.lo_m[:, 0] - s_m
        for row in np.flatnonzero(~bodies.moving & (placed.hi_m[:, 0] > s_m)):
            number, gap_m = int(bodies.ids[row]), float(gaps[row])
            beside_m = margins.lateral_m + (margins.graze_m if number in self._inside else 0.0)
            if gap_m < -_ALONGSIDE_M:
                # The front has passed it already: only what the body would really touch counts.
                beside_m = -_INSIDE_BODY_M
            if placed.clear_m[row, 0] > beside_m:
                self._inside.discard(number)
                continue
            gap = Gap(gap_m, obstacle_id=number)
            if self._may_wait(gap, motion, float(bodies.age_s[row])):
                continue
            self._inside.add(number)
            what = "stands on the path"
            found.append(
                stop_before(gap, motion, self._comfort, float(stop_m[row]), margins.least_m, "static", what)
            )
        return found

    def _stop_m(self, known: Knowledge, placed: Placed) -> FloatArray:
        """(N,) where to stand before a body: so that it is still seen, and seen to leave."""
        sight = self._config.sight
        visible_m = visible_from_m(
            known.bodies, placed.d_m[:, 0], known.edge_tan, sight.near_m, self._mount.height_m
        )
        front_m = known.corridor.front_m - self._mount.forward_m
        return np.clip(visible_m - front_m, self._config.margins.stop_m, sight.near_m)

    def _may_wait(self, gap: Gap, motion: Motion, age_s: float) -> bool:
        """A young obstacle may be confirmed first while an emergency stop fits even if it came at V_o."""
        if age_s >= self._config.prediction.confirm_s:
            return False
        needed = braking.required_distance(
            motion.v_mps,
            motion.a_mps2,
            self._limits.max_obstacle_speed_mps,
            motion.latency_s + self._config.prediction.confirm_s,
            self._emergency,
            self._config.margins.stop_m,
        )
        return needed <= gap.distance_m

    def _moving(
        self, known: Knowledge, placed: Placed, s_m: float, motion: Motion, base_mps: float, now_s: float
    ) -> tuple[list[Limit], float]:
        """Limits by what crosses, comes or drives ahead, and the speed that remains."""
        bodies, margins = known.bodies, self._config.margins
        ahead = placed.s_m[:, 0] + placed.half_s_m[:, 0] > s_m
        rows = np.flatnonzero(bodies.moving & ahead)
        if not len(rows):
            self._goes_first.clear()
            return [], base_mps
        along, _, sigma_s, sigma_d = velocity_on_path(bodies, known.corridor, placed.s_m[:, 0])
        sigma_d = sigma_d * self._config.prediction.sigmas
        grazes = np.array([int(one) in self._inside for one in bodies.ids])
        beside = margins.lateral_m + margins.graze_m * grazes
        conflicts = [
            one
            for one in find_conflicts(placed, self._times_s, sigma_d, beside, rows)
            if one.hi_in_m > s_m and one.lo_in_m > s_m - _ALONGSIDE_M
        ]
        in_conflict = {int(bodies.ids[one.row]) for one in conflicts}
        self._inside |= in_conflict
        self._goes_first &= in_conflict
        conflicts = [self._steadied(one, int(bodies.ids[one.row]), now_s) for one in conflicts]
        self._leaves_s = {number: when for number, when in self._leaves_s.items() if number in in_conflict}
        if not conflicts:
            return [], base_mps
        ramps = self._ramps(motion, self._speeds)
        offers = []
        for one in conflicts:
            leader_mps = float(along[one.row] - sigma_s[one.row])
            limit = self._when_it_stays(one, bodies, placed, s_m, motion, float(along[one.row]), leader_mps)
            offers.append((one, *self._offer(one, int(bodies.ids[one.row]), ramps, s_m, limit)))
        return self._settle(offers, bodies, base_mps)

    def _steadied(self, conflict: Conflict, number: int, now_s: float) -> Conflict:
        """With the time of leaving averaged over some frames: it is an extrapolation of a noisy speed."""
        if math.isinf(conflict.out_s):
            self._leaves_s.pop(number, None)
            return conflict
        leaves_s = now_s + conflict.out_s
        before_s = self._leaves_s.get(number, leaves_s)
        self._leaves_s[number] = before_s + _AVERAGE * (leaves_s - before_s)
        return replace(conflict, out_s=max(self._leaves_s[number] - now_s, conflict.in_s))

    def _ramps(self, motion: Motion, targets_mps: FloatArray) -> SpeedRamps:
        """Comfortable, from now."""
        return SpeedRamps(
            motion.v_mps,
            motion.a_mps2,
            targets_mps,
            accel_mps2=self._limits.max_accel_mps2,
            decel_mps2=self._limits.max_accel_mps2,
            jerk_mps3=self._limits.max_jerk_mps3,
            latency_s=motion.latency_s,
        )

    def _when_it_stays(
        self,
        conflict: Conflict,
        bodies: Bodies,
        placed: Placed,
        s_m: float,
        motion: Motion,
        along_mps: float,
        leader_mps: float,
    ) -> Limit:
        """Stop before it, or follow it: the limit by an obstacle that does not leave the corridor."""
        margins = self._config.margins
        runs_m = 0.0
        rule, what = "oncoming", f"comes at {-along_mps:.1f} m/s"
        if along_mps > _DRIVES_AHEAD_MPS:
            runs_m = max(leader_mps, 0.0) ** 2 / (2.0 * self._config.prediction.leader_decel_mps2)
            rule, what = "leader", f"drives ahead at {along_mps:.1f} m/s"
        elif along_mps > -_DRIVES_AHEAD_MPS:
            rule, what = "crossing", "is on the path"
        gap = Gap(
            float(placed.lo_m[conflict.row, 0]) - s_m,
            closing_mps=-along_mps,
            runs_m=runs_m,
            obstacle_id=int(bodies.ids[conflict.row]),
        )
        return stop_before(gap, motion, self._comfort, margins.stop_m, margins.least_m, rule, what)

    def _offer(
        self, conflict: Conflict, number: int, ramps: SpeedRamps, s_m: float, stays: Limit
    ) -> tuple[Choice, Limit]:
        margins = self._config.margins
        first = number in self._goes_first
        enter_s = margins.crossing_s * (0.5 if first else 1.0) + (0.0 if first else _STICKY_S)
        choice = choices(conflict, ramps, self._speeds, s_m, margins.least_m, margins.crossing_s, enter_s)
        if conflict.in_s <= 0.0 or conflict.hi_in_m <= s_m:
            choice = Choice(choice.yield_mps, math.inf)
        if choice.yield_mps < min(stays.speed_mps, _WORTH_ARRIVING_MPS):
            return Choice(stays.speed_mps, choice.first_mps), stays
        sentence = (
            f"obstacle {number} crosses {max(conflict.lo_in_m - s_m, 0.0):.1f} m ahead until "
            f"{conflict.out_s:.1f} s from now: {allowed(choice.yield_mps)}"
        )
        reason = Reason(
            "crossing",
            sentence,
            number,
            conflict.lo_in_m - s_m,
            stays.reason.closing_mps,
            stays.reason.required_m,
            stays.reason.margin_m,
        )
        return choice, Limit(choice.yield_mps, reason)

    def _settle(
        self, offers: list[tuple[Conflict, Choice, Limit]], bodies: Bodies, base_mps: float
    ) -> tuple[list[Limit], float]:
        """The greatest speed up to base_mps that every conflict admits, before it or behind it."""
        speed, found = base_mps, []
        waiting = list(offers)
        while waiting:
            blocked = [one for one in waiting if one[1].yield_mps < speed < one[1].first_mps]
            if not blocked:
                break
            worst = min(blocked, key=lambda one: one[1].yield_mps)
            speed = worst[1].yield_mps
            found.append(worst[2])
            waiting.remove(worst)
        for conflict, choice, _ in offers:
            number = int(bodies.ids[conflict.row])
            if choice.yield_mps < speed and speed >= choice.first_mps:
                self._goes_first.add(number)
            else:
                self._goes_first.discard(number)
        return found, speed


def _owner(known: Knowledge, surface_s_m: float, s_m: float) -> int | None:
    """The sprawling obstacle whose surface this is, if one is tracked there."""
    if not len(known.sprawling):
        return None
    placed = place(known.sprawling, known.corridor, np.zeros(1), s_m, surface_s_m - s_m + 2.0)
    near_s = placed.s_m[:, 0] - placed.half_s_m[:, 0]
    far_s = placed.s_m[:, 0] + placed.half_s_m[:, 0]
    off = np.maximum(np.maximum(near_s - surface_s_m, surface_s_m - far_s), 0.0)
    best = int(off.argmin())
    return int(known.sprawling.ids[best]) if off[best] < _SAME_SURFACE_M else None
