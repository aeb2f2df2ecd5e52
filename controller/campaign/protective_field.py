"""A speed-dependent protective field, as safety laser scanners monitor it.

S_L = S_A + TZ + Z_R + Z_F + Z_B with S_A = S_Br(v) + t_R v: the stopping distance at the present speed, the
distance driven in the response time, the scanner's tolerance, and a supplement because a base lower than 120
mm could reach a foot (microScan3 8017784, p. 43). Anything in the field stops the robot with emergency
braking. It goes on two seconds after the field for walking pace has become free.
"""

from __future__ import annotations

import numpy as np

from config.robot import Robot
from controller import braking
from controller.campaign.baseline_policy import decision, free_speed
from controller.campaign.planar_scan import PlanarScanner
from controller.campaign.stage import Stage
from controller.decision.decision import Decision
from controller.decision.situation import Situation
from controller.decision.surfaces import floor_points
from hal.clocks import NS_PER_S
from hal.types import FloatArray

RESPONSE_S = 0.2  # t_R: about three scans
TOLERANCE_M = 0.1  # TZ; Z_R is 0, because the scanner here has no errors
GROUND_CLEARANCE_M = 0.15  # Z_F; Z_B is 0, because the brakes do not wear
RESTART_S, _RESTART_MPS = 2.0, 0.3  # see above: the time, and the walking pace of the field for going on
_SIDE_MARGIN_M = TOLERANCE_M  # beside the robot, which keeps its lane: the tolerance alone
_MIN_POINTS = 2  # a single point is no object


class ProtectiveField:
    """The policy `field`."""

    def __init__(self, robot: Robot, stage: Stage) -> None:
        self._robot = robot
        self._brake = braking.emergency(robot.limits)
        self._scanner = PlanarScanner(stage)
        self._stopped = False
        self._free_since_s: float | None = None

    def step(self, at: Situation) -> Decision:
        """Stop while anything is in the field; go on some time after the field has become free."""
        t_s = at.now_ns / NS_PER_S
        field_mps = max(at.v_mps, _RESTART_MPS if self._stopped else 0.0)
        if self._is_intruded(self._scanner.points(at.pose, t_s), at, field_mps):
            self._stopped, self._free_since_s = True, None
        elif self._stopped:
            self._free_since_s = t_s if self._free_since_s is None else self._free_since_s
            self._stopped = t_s - self._free_since_s < RESTART_S
        if self._stopped:
            return decision("field", "protective field", 0.0, at.v_mps, hard=True)
        free_mps = free_speed(at.path, at.on_path, self._robot.limits)
        return decision("field", "field free", free_mps, at.v_mps)

    def length(self, v_mps: float) -> float:
        """S_L in metres, from the robot's front."""
        stop_m = braking.stop(v_mps, 0.0, self._brake).distance_m
        return stop_m + RESPONSE_S * v_mps + TOLERANCE_M + GROUND_CLEARANCE_M

    def _is_intruded(self, points: FloatArray, at: Situation, v_mps: float) -> bool:
        """Whether anything is in the field for v_mps. The field follows the path, as one that is selected by
        the steering angle would.

        points: (P, 2), in the body frame.
        """
        body, pose, s_m = self._robot.body, at.pose, at.on_path.s_m
        reach = body.front_m + self.length(v_mps)
        near = (points[:, 0] > -body.rear_m) & (np.hypot(points[:, 0], points[:, 1]) < reach + 1.0)
        if not near.any():
            return False
        ahead_m, left_m = points[near].T
        floor = floor_points(pose, ahead_m, left_m)
        s, d = at.path.project_points(floor, s_m - 1.0, s_m + reach + 1.0)
        ahead = s - s_m
        inside = (ahead > 0.0) & (ahead < reach) & (np.abs(d) < 0.5 * body.width_m + _SIDE_MARGIN_M)
        return int(np.count_nonzero(inside)) >= _MIN_POINTS
