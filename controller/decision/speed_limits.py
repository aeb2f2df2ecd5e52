"""Obstacles and depth -> speed limits with their reasons, for one control step.

controller/decision/decide.py calls SpeedLimits.limits and takes the least of these limits and those by path
and camera. The advisers, in the order in which they are called:

1. depth_limits.DepthLimits: what depth shows of the corridor, whether or not it belongs to an obstacle.
2. standing_limits.StandingLimits: bodies that stand in the corridor.
3. moving_limits.MovingLimits: bodies that cross, come or drive ahead.
4. worst_case_limit.WorstCase: what bodies could do at worst.

Advisers 3 and 4 look at the watched bodies alone (controller/decision/watched.py).
"""

from __future__ import annotations

import numpy as np

from config.decision import DecisionConfig
from config.robot import Limits
from controller.decision.bodies import Bodies
from controller.decision.depth_limits import DepthLimits
from controller.decision.lateral_margin import LateralMargin
from controller.decision.limits import Limit, Motion
from controller.decision.moving_limits import MovingLimits
from controller.decision.standing_limits import StandingLimits
from controller.decision.watched import Watch
from controller.decision.world_model import WorldModel
from controller.decision.worst_case_limit import WorstCase

_COARSE_S = 0.5  # step of the times beyond those of the worst case


class SpeedLimits:
    """Asks the advisers, in this order: depth, standing bodies, moving bodies, and the worst case."""

    def __init__(self, config: DecisionConfig, limits: Limits) -> None:
        self._worst_case = WorstCase(config, limits)
        fine = self._worst_case.times_s
        coarse = np.arange(fine[-1] + _COARSE_S, config.prediction.horizon_s + _COARSE_S, _COARSE_S)
        times_s = np.concatenate((fine, coarse))
        self._depth = DepthLimits(config, limits)
        self._beside = LateralMargin(config.margins)
        self._standing = StandingLimits(config, limits, self._beside)
        self._moving = MovingLimits(config, limits, times_s, self._beside)
        self._watch = Watch(config, times_s)
        self._taken_from: Bodies | None = None

    def limits(
        self, known: WorldModel, s_m: float, motion: Motion, base_mps: float, now_s: float
    ) -> list[Limit]:
        """Every limit that obstacles and depth put on the speed of a robot at s_m.

        base_mps: what path and camera allow.
        """
        if known.bodies is not self._taken_from:
            self._take_in(known)
        found = self._depth.limits(known, s_m, motion)
        found += self._standing.limits(known, s_m, motion, now_s)
        watched = self._watch.step(known, s_m, now_s)
        if watched is None:
            self._moving.forget()
            return found
        for limit in found:
            base_mps = min(base_mps, limit.speed_mps)
        in_the_way, chosen_mps = self._moving.limits(watched, s_m, motion, base_mps, now_s)
        found += in_the_way
        worst = self._worst_case.limit(watched, s_m, motion, chosen_mps)
        if worst is not None:
            found.append(worst)
        return found

    def _take_in(self, known: WorldModel) -> None:
        """Once a scene: select the watched bodies, and forget those that are gone."""
        self._taken_from = known.bodies
        self._watch.take_in(known)
        self._beside.keep_only(known.bodies.ids)
