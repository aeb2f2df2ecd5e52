"""The paper's rule on the same scenes: brake while anything is within S_n = S_r + V_o T_t on the way ahead.

Daeef 2020, problem statement: S_r = V^2 / 2A, T_t = V / A, V_o the speed of an obstacle that comes towards
the robot (0 if it stands or moves away). No latency, no jerk, no prediction and no hysteresis.
"""

from __future__ import annotations

import numpy as np

from config.robot import Robot
from controller import braking
from controller.campaign.baseline_policy import decision, free_speed
from controller.decision.bodies import Bodies
from controller.decision.corridor import Corridor, path_velocities, place
from controller.decision.decision import Decision
from controller.decision.obstacle_boxes import bodies_of
from controller.decision.situation import Situation
from hal.types import CameraMount
from vision.scene import Scene

# Obstacles are looked for this far along the path: more than the paper's greatest S_n, 11.25 m.
_LOOKAHEAD_M = 14.0
_STOP_SHORT_M = 0.1  # see detection_distance()


class PaperRule:
    """The policy `paper`."""

    def __init__(self, robot: Robot, mount: CameraMount) -> None:
        self._robot, self._mount = robot, mount
        self._corridor: Corridor | None = None
        self._scene: Scene | None = None
        self._bodies: Bodies | None = None

    def step(self, at: Situation) -> Decision:
        """Stop for any obstacle within its S_n, else drive as the path allows."""
        if at.scene is None:
            return decision("paper", "nothing seen yet", 0.0, at.v_mps)
        if self._corridor is None:
            self._corridor = Corridor(at.path, self._robot.body)
        if at.scene is not self._scene:
            self._scene = at.scene
            self._bodies = bodies_of(at.scene, at.scene.robot_pose or at.pose, self._mount, 0.0)
        assert self._bodies is not None
        for distance_m, closing_mps in self._obstacles_ahead(self._bodies, self._corridor, at.on_path.s_m):
            needed_m = self.detection_distance(at.v_mps, closing_mps)
            if distance_m <= needed_m:
                sentence = f"something is {distance_m:.1f} m ahead, S_n is {needed_m:.1f} m"
                return decision("paper", sentence, 0.0, at.v_mps)
        free_mps = free_speed(at.path, at.on_path, self._robot.limits)
        return decision("paper", "nothing within S_n", free_mps, at.v_mps)

    def detection_distance(self, v_mps: float, closing_mps: float) -> float:
        """S_n plus 0.1 m, without which the robot would come to rest in contact with the obstacle."""
        limits = self._robot.limits
        towards_mps = min(max(closing_mps, 0.0), limits.max_obstacle_speed_mps)
        return _STOP_SHORT_M + braking.paper_detection_distance(v_mps, towards_mps, limits.max_accel_mps2)

    def _obstacles_ahead(self, bodies: Bodies, corridor: Corridor, s_m: float) -> list[tuple[float, float]]:
        """(free way before the front, closing speed) of each obstacle in the swept corridor ahead."""
        if not len(bodies):
            return []
        placed = place(bodies, corridor, np.zeros(1), s_m, _LOOKAHEAD_M)
        along = path_velocities(bodies, placed.heading_rad[:, 0]).along_mps
        rows = np.flatnonzero((placed.clearance_m[:, 0] <= 0.0) & (placed.block_to_s_m[:, 0] > s_m))
        return [
            (float(placed.block_from_s_m[k, 0]) - s_m, -float(along[k]) if bodies.moving[k] else 0.0)
            for k in rows
        ]
