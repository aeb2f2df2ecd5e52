"""What the decision knows of the way ahead: the last good scene, and what has gone out of sight since."""

from __future__ import annotations

import numpy as np

from config.decision import DecisionConfig
from config.robot import Body
from controller.bodies import Bodies, SceneError, bodies_of, no_bodies
from controller.corridor import Corridor
from controller.localise import PoseHistory
from controller.path import OnPath, Path
from controller.sight import Sight
from hal.clocks import NS_PER_S
from hal.types import CameraMount, PlanarPose
from vision.scene import CameraCondition, CameraHealth, Scene

# A wall or a rack is not a box: as a box it would reach into the corridor wherever the path bends. Its
# surface in the corridor is what depth sees (controller/sight.py).
_SPRAWLING_M = 0.8
_STANDING_MPS = 0.01
# The height of what is seen only in part is known no better.
_UNCERTAIN_M = 0.1
_FUTURE_S = 0.005
_GOOD = CameraHealth(CameraCondition.GOOD, "", float("nan"))


class Knowledge:
    """Takes in scenes along one path.

    bodies: boxes to reckon with, sprawling: those that are not boxes. fault: why the camera cannot be relied
    on now, "" if it can. age_s: of the newest scene (inf: none yet).
    """

    def __init__(
        self, path: Path, body: Body, mount: CameraMount, config: DecisionConfig, start_s_m: float
    ) -> None:
        self.corridor = Corridor(path, body)
        self.sight = Sight(self.corridor, mount, config, start_s_m)
        self.bodies = self.sprawling = no_bodies(0)
        self.health = _GOOD
        self.fault = "no scene yet"
        self.age_s = float("inf")
        self._mount, self._config = mount, config
        self._poses = PoseHistory()
        self._captured_ns: int | None = None
        self._scene_fault = ""

    def update(
        self, scene: Scene | None, pose: PlanarPose, on_path: OnPath, v_mps: float, now_ns: int
    ) -> None:
        """Take in the scene if it is new, and judge whether what is known can be relied on."""
        self._poses.append(now_ns, pose)
        if scene is not None and scene.captured_ns != self._captured_ns:
            self._scene_fault = self._order_fault(scene) or self._learn(scene, on_path, v_mps)
        if self._captured_ns is not None:
            self.age_s = (now_ns - self._captured_ns) / NS_PER_S
        self.fault = self._judge()

    def _order_fault(self, scene: Scene) -> str:
        """An older scene after a newer one is not taken in."""
        if self._captured_ns is None or scene.captured_ns > self._captured_ns:
            return ""
        return f"the camera's time went back by {(self._captured_ns - scene.captured_ns) / NS_PER_S:.3f} s"

    def _judge(self) -> str:
        if self._captured_ns is None:
            return self._scene_fault or "no scene yet"
        if self._scene_fault:
            return self._scene_fault
        if self.age_s < -_FUTURE_S:
            return f"the scene is {-self.age_s:.3f} s from the future"
        if self.age_s > self._config.sight.stale_s:
            return f"the last scene is {self.age_s:.2f} s old"
        if self.health.condition is CameraCondition.UNTRUSTWORTHY:
            return f"the camera cannot be trusted: {self.health.reason}"
        return ""

    def _learn(self, scene: Scene, on_path: OnPath, v_mps: float) -> str:
        """Returns what is wrong with the scene, "" if nothing is."""
        pose = scene.robot_pose or self._poses.at(scene.captured_ns)
        if pose is None:
            return "where the robot was when the scene was taken is not known"
        try:
            seen = bodies_of(scene, pose, self._mount, self._config.prediction.body_depth_m)
        except SceneError as error:
            return str(error)
        s_m = self.corridor.path.project(pose, on_path.s_m).s_m
        sprawling = ~seen.moving & (np.maximum(seen.half_view_m, seen.half_across_m) > _SPRAWLING_M)
        boxes = seen.select(~sprawling)
        self.bodies = boxes.joined(self._out_of_sight(seen, pose, s_m))
        self.sprawling = seen.select(sprawling)
        self.sight.look(
            scene.free_space, pose, s_m, scene.captured_ns, boxes, standing=v_mps <= _STANDING_MPS
        )
        self.health = scene.health
        self._captured_ns = scene.captured_ns
        return ""

    def _out_of_sight(self, seen: Bodies, pose: PlanarPose, s_m: float) -> Bodies:
        """Standing bodies that were known and have sunk below the camera's view, until they are passed."""
        gone = ~self.bodies.moving & ~np.isin(self.bodies.ids, seen.ids)
        if not gone.any():
            return no_bodies(seen.captured_ns)
        before = self.bodies.select(gone)
        ahead_m = (before.xy_m[:, 0] - pose.x_m) * np.cos(pose.heading_rad)
        ahead_m += (before.xy_m[:, 1] - pose.y_m) * np.sin(pose.heading_rad)
        ahead_m -= self._mount.forward_m + before.half_view_m
        near_m = self._config.sight.near_m
        lowest_seen_m = self._mount.height_m * (1.0 - ahead_m / near_m)
        below = (ahead_m < near_m) & (before.top_m < lowest_seen_m + _UNCERTAIN_M)
        body_s, _ = self.corridor.path.project_points(before.xy_m, s_m - 1.0, s_m + near_m + 2.0)
        not_passed = body_s + before.half_view_m > s_m - self.corridor.rear_m
        return before.select(below & not_passed)
