"""The arc that the governor looks along, and what is known of the way along it.

It stands in for a mission's path: the decision (controller/decision/decide.py) gets it as the path ahead.
"""

from __future__ import annotations

from collections import deque

from config.robot import Robot
from controller.decision.decide import DecisionMaker
from controller.decision.world_model import WorldModel
from controller.governor.arcs import SAME_MPS, arc_path
from controller.path.path import OnPath, Path
from hal.types import PlanarPose
from vision.scene import Scene

# A new arc is laid out when the robot is this far beside the old one, turned this far from it, or has come
# this far along it.
_OFF_M = 0.02
_OFF_RAD = 0.02
_ALONG_M = 0.25
# Curvatures that differ by no more than this count as equal: it displaces the arc by 10 cm at the end of the
# camera's range, and by 1 cm where the robot may have to stop.
_SAME_1PM = 0.002
# As many scenes as controller/decision/sight.py compares before it believes a surface.
_SCENES = 5


class ArcAhead:
    """The arc of the present motion, laid out anew when it no longer fits.

    path: None before the first step.
    known: what is known along it.
    on_path: where the robot is on it.
    """

    def __init__(self, decide: DecisionMaker, robot: Robot, range_m: float, known_from_m: float) -> None:
        self.path: Path | None = None
        self.known: WorldModel | None = None
        self.on_path = OnPath(0.0, 0.0, 0.0)
        self._decide, self._robot = decide, robot
        self._range_m, self._known_from_m = range_m, known_from_m
        self._laid_out = (0.0, 0.0)
        self._scenes: deque[Scene] = deque(maxlen=_SCENES)

    def remember(self, scene: Scene) -> None:
        """Keep a scene, with its robot_pose, for the next arcs."""
        self._scenes.append(scene)

    def is_new(self, scene: Scene) -> bool:
        """Whether scene was captured after all that are remembered."""
        return not self._scenes or scene.captured_ns > self._scenes[-1].captured_ns

    def with_pose(self, scene: Scene | None) -> Scene | None:
        """The scene as it is remembered, with its robot_pose, if it is the newest one."""
        if scene is not None and self._scenes and scene.captured_ns == self._scenes[-1].captured_ns:
            return self._scenes[-1]
        return scene

    def lay_out(self, pose: PlanarPose, curvature_1pm: float, speed_mps: float, v_mps: float) -> Path:
        """The arc for a robot at pose that drives v_mps; a new one if the last no longer fits.

        The last scenes are then taken in again along the new arc. speed_mps: requested.
        """
        if not pose.finite:
            pose = PlanarPose(0.0, 0.0, 0.0) if self.path is None else self.path.start
        wanted = curvature_1pm, speed_mps
        if self.path is not None:
            self.on_path = on = self.path.project(pose, self.on_path.s_m)
            fits = abs(on.d_m) <= _OFF_M and abs(on.heading_rad) <= _OFF_RAD and on.s_m <= _ALONG_M
            bends = abs(wanted[0] - self._laid_out[0]) <= _SAME_1PM
            if fits and bends and abs(wanted[1] - self._laid_out[1]) < SAME_MPS:
                return self.path
        path = arc_path(pose, curvature_1pm, speed_mps, self._range_m, self._robot)
        known = self._look_again(path, v_mps)
        self._decide.continue_along(path, known)
        self.path, self.known, self._laid_out = path, known, wanted
        self.on_path = OnPath(0.0, 0.0, 0.0)
        return path

    def _look_again(self, path: Path, v_mps: float) -> WorldModel:
        """A world model for path, from the last scenes and the world model of the arc before."""
        before = self.known
        known = self._decide.new_world_model(path, self._known_from_m)
        for scene in self._scenes:
            assert scene.robot_pose is not None
            if before is None or before.has_taken_in(scene):
                known.update(scene, scene.robot_pose, OnPath(0.0, 0.0, 0.0), v_mps, scene.captured_ns)
        if before is not None:
            known.take_over(before)
        return known
