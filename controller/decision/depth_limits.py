"""Speed limits by depth alone: a blind corner, a surface in the corridor, a covered lens, unseen floor.

controller/decision/speed_limits.py calls DepthLimits in each control step. What is known of the corridor is
in controller/decision/sight.py, blind_corners.py and lens_cover.py.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from config.decision import DecisionConfig
from config.robot import Limits
from controller import braking
from controller.decision.blind_corners import BlindCorner
from controller.decision.corridor import BEYOND_RANGE_M, place
from controller.decision.decision import Reason
from controller.decision.lens_cover import COVERED
from controller.decision.limits import (
    Gap,
    Limit,
    Motion,
    allowed_text,
    reason_before,
    standing_text,
    stopping_room,
    too_little_left,
)
from controller.decision.world_model import WorldModel

# A surface within this distance of a tracked obstacle, along the path and across it, is named after it.
_OWNED_WITHIN_M = 0.8
# A surface this far behind the robot's front is in a place where only the robot itself can be.
_INSIDE_M = 0.05
_INSIDE = (
    "a surface is inside the robot's outline: stop; is a part of the robot in view? Then give it in "
    "camera.own_parts"
)


class DepthLimits:
    """Limits by what depth shows of the corridor, whether or not an obstacle was found there."""

    def __init__(self, config: DecisionConfig, limits: Limits) -> None:
        self._config, self._comfort = config, braking.comfort(limits)

    def limits(self, known: WorldModel, s_m: float, motion: Motion) -> list[Limit]:
        """The limits for a robot at s_m."""
        sight = known.sight
        front_m = s_m + known.corridor.front_m
        corner = sight.corners.nearest(front_m)
        found = [] if corner is None else [self._corner(corner, front_m, motion)]
        if math.isfinite(sight.surface_s_m):
            found.append(self._surface(known, sight.surface_s_m, s_m, motion))
        if known.lens.covered:
            urgent = bool(known.bodies.moving.any())
            found.append(Limit(0.0, _covered, urgent=urgent))
        if sight.known_s_m < known.corridor.path.length_m + known.corridor.front_m:
            found.append(self._unseen(Gap(sight.known_s_m - front_m), motion))
        return found

    def _surface(self, known: WorldModel, surface_s_m: float, s_m: float, motion: Motion) -> Limit:
        """The limit for the nearest surface that no box explains.

        Which obstacle it belongs to is looked up for the sentence only.
        """
        margins, gap = self._config.margins, Gap(surface_s_m - (s_m + known.corridor.front_m))
        room = stopping_room(gap, motion, self._comfort, margins.stop_m)

        def why() -> Reason:
            owned = replace(gap, obstacle_id=_owner(known, surface_s_m, s_m))
            what = standing_text(known.sight.surface_clearance_m, margins.lateral_m)
            reason = reason_before(owned, room, "depth", what)
            return replace(reason, sentence=_INSIDE) if gap.distance_m < -_INSIDE_M else reason

        return Limit(room.speed_mps, why, too_little_left(room, motion, margins.stop_m, margins.least_m))

    def _unseen(self, gap: Gap, motion: Motion) -> Limit:
        """The limit for the end of the floor that was seen free."""
        room = stopping_room(gap, motion, self._comfort, self._config.margins.least_m)

        def why() -> Reason:
            beyond = f"the floor beyond {max(gap.distance_m, 0.0):.1f} m was not seen free: "
            return Reason(
                "unseen",
                beyond + allowed_text(room.speed_mps),
                distance_m=gap.distance_m,
                required_m=room.required_m,
                margin_m=room.spare_m,
            )

        return Limit(room.speed_mps, why)

    def _corner(self, corner: BlindCorner, front_m: float, motion: Motion) -> Limit:
        """The limit for passing a blind corner: slow enough for whoever steps out."""
        ahead_m = corner.s_m - front_m
        slow_mps = self._config.sight.blind_corner_mps
        rolls_m = motion.v_mps * motion.latency_s
        rolls_m += braking.letting_go_distance(motion.v_mps, motion.a_mps2, self._comfort)
        speed = braking.speed_before_section(ahead_m - rolls_m, slow_mps, self._comfort)

        def why() -> Reason:
            left_m = max(ahead_m, 0.0)  # 0 while the opening behind it is passed
            sentence = f"a blind corner {left_m:.1f} m ahead, {corner.beside_m:.1f} m beside the way: "
            return Reason("corner", sentence + allowed_text(speed), distance_m=left_m)

        return Limit(speed, why)


def _covered() -> Reason:
    return Reason("unseen", f"{COVERED}: stop", distance_m=0.0)


def _owner(known: WorldModel, surface_s_m: float, s_m: float) -> int | None:
    """Id of the obstacle whose surface this is, if an unboxed one is tracked there."""
    unboxed = known.unboxed
    if not len(unboxed):
        return None
    placed = place(unboxed, known.corridor, np.zeros(1), s_m, surface_s_m - s_m + BEYOND_RANGE_M)
    near_s = placed.s_m[:, 0] - placed.half_s_m[:, 0]
    far_s = placed.s_m[:, 0] + placed.half_s_m[:, 0]
    beside_m = placed.clearance_m[:, 0] - max(known.sight.surface_clearance_m, 0.0)
    off = np.maximum(np.maximum(near_s - surface_s_m, surface_s_m - far_s), np.maximum(beside_m, 0.0))
    best = int(off.argmin())
    return int(unboxed.ids[best]) if off[best] < _OWNED_WITHIN_M else None
