"""A zone monitor like Nav2's collision monitor, with its default parameters.

nav2_collision_monitor/params/collision_monitor_params.yaml: a stop polygon that reaches 0.08 m beyond a robot
of 0.22 m radius, a slowdown polygon (ratio 0.3) that reaches 0.18 m beyond it, both on 4 points, and
"approach" with time_before_collision T = 2.0 s in steps of 0.1 s on 6 points: where the commanded speed v_in
would touch after t_c < T, the speed is v_in t_c / T. The zones are laid around this robot's own footprint.
Emergency braking is allowed.
"""

from __future__ import annotations

import numpy as np

from config.robot import Robot
from controller.campaign.baseline_policy import decision, free_speed
from controller.campaign.planar_scan import PlanarScanner, in_body
from controller.campaign.stage import Stage
from controller.decision.decision import Decision
from controller.decision.situation import Situation
from hal.clocks import NS_PER_S
from hal.geometry import advance_pose
from hal.types import FloatArray, PlanarPose

_STOP_MARGIN_M, _SLOW_MARGIN_M = 0.08, 0.18
_SLOWDOWN_RATIO = 0.3
_ZONE_POINTS, _APPROACH_POINTS = 4, 6
_TIME_BEFORE_COLLISION_S, _STEP_S = 2.0, 0.1
_HERE = PlanarPose(0.0, 0.0, 0.0)


class ZoneMonitor:
    """The policy `zones`."""

    def __init__(self, robot: Robot, stage: Stage) -> None:
        self._robot = robot
        self._scanner = PlanarScanner(stage)

    def step(self, at: Situation) -> Decision:
        """The speed that the zones allow, with as much braking as necessary."""
        points = self._scanner.points(at.pose, at.now_ns / NS_PER_S)
        desired = free_speed(at.path, at.on_path, self._robot.limits)
        curvature = at.path.curvature(at.on_path.s_m)
        target, rule = self.limit(points, desired, curvature)
        return decision("zones", rule, target, at.v_mps, hard=target < desired)

    def limit(self, points: FloatArray, desired_mps: float, curvature_1pm: float) -> tuple[float, str]:
        """The speed that the three zones allow of desired_mps, and the name of the zone that limits it."""
        body = self._robot.body
        half_width_m = 0.5 * body.width_m
        if (
            self._count(points, 0.0, body.front_m + _STOP_MARGIN_M, half_width_m + _STOP_MARGIN_M)
            >= _ZONE_POINTS
        ):
            return 0.0, "stop polygon"
        target, rule = desired_mps, "free"
        rear, front = -body.rear_m - _SLOW_MARGIN_M, body.front_m + _SLOW_MARGIN_M
        if self._count(points, rear, front, half_width_m + _SLOW_MARGIN_M) >= _ZONE_POINTS:
            target, rule = _SLOWDOWN_RATIO * desired_mps, "slowdown polygon"
        collision_s = self.collision_time(points, desired_mps, curvature_1pm)
        approach = desired_mps * collision_s / _TIME_BEFORE_COLLISION_S
        return (approach, "approach") if approach < target else (target, rule)

    def collision_time(self, points: FloatArray, v_mps: float, curvature_1pm: float) -> float:
        """The time until six points are in the footprint at constant v_mps on the present arc, at most 2.0
        s."""
        body = self._robot.body
        half_width_m = 0.5 * body.width_m
        if self._count(points, -body.rear_m, body.front_m, half_width_m) >= _APPROACH_POINTS:
            return 0.0
        for k in range(round(_TIME_BEFORE_COLLISION_S / _STEP_S)):
            then = advance_pose(_HERE, v_mps, curvature_1pm * v_mps, (k + 1) * _STEP_S)
            relative = in_body(then, points)
            if self._count(relative, -body.rear_m, body.front_m, half_width_m) >= _APPROACH_POINTS:
                # The tested pose is one step later than this time, as in Nav2.
                return k * _STEP_S
        return _TIME_BEFORE_COLLISION_S

    @staticmethod
    def _count(points: FloatArray, rear_m: float, front_m: float, half_m: float) -> int:
        inside = (points[:, 0] >= rear_m) & (points[:, 0] <= front_m) & (np.abs(points[:, 1]) <= half_m)
        return int(np.count_nonzero(inside))
