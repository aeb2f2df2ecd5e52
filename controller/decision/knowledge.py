"""What the decision knows of the way ahead: the last good scene, and the bodies out of sight since then.

For each new scene, Knowledge makes boxes of the obstacles (controller/decision/bodies.py), averages their
velocities (controller/decision/steadying.py), adds bodies that have left the view
(controller/decision/memory.py), and notes free floor and unexplained surfaces along the path
(controller/decision/sight.py). In each control step it says whether the camera can be relied on: the field
fault. controller/decision/appraise.py makes speed limits of what is known.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from config.decision import DecisionConfig
from config.perception import TYPICAL_DEPTH_NOISE, DepthNoise
from config.robot import Robot
from controller.decision.bodies import Bodies, SceneError, bodies_of, no_bodies
from controller.decision.corridor import Corridor
from controller.decision.going import SETTLED_S
from controller.decision.lens_cover import LensCover
from controller.decision.limits import STANDING_MPS
from controller.decision.memory import OutOfView
from controller.decision.sight import Sight
from controller.decision.steadying import SteadyVelocities
from controller.decision.surfaces import NO_SURFACES, check_scan, surfaces_of
from controller.localise import PoseHistory
from controller.path.path import OnPath, Path
from hal.clocks import NS_PER_S
from hal.compiled import compiled
from hal.types import CameraMount, FloatArray, PlanarPose
from vision.scene import CameraCondition, CameraHealth, Scene

# A wall or a rack is not a box: as a box it would reach into the corridor wherever the path bends. Its
# surface in the corridor is what depth sees (controller/decision/sight.py).
_SPRAWLING_M = 0.8
# Nor is a strip of a centimetre or two: a rack that is looked along has dozens of them, others in each frame.
# Half of its width; poles are wider.
_STRIP_M = 0.015
_BEFORE_NS = 200_000_000
_SAME_PLACE_M = 0.25
_FUTURE_S = 0.005
_GOOD = CameraHealth(CameraCondition.GOOD, "", float("nan"))


class Knowledge:
    """Takes in scenes along one path. Points are in metres, in the frame of the path.

    bodies: N boxes to reckon with, those in view before those out of sight; remembered (N,) says which these
    are, and controller/decision/bodies.py what arrays tell of them. unboxed: M more in view, as surfaces
    only. surfaces: P points (P, 2) that depth saw, and how far it saw in each of B bands
    (controller/decision/surfaces.py). corridor: what the robot sweeps along the path; sight: what was seen of
    that; lens: whether somebody stands too near to be seen. edge_tan: how far the camera looks to either
    side, as the tangent of the angle. near_m: nearer than this ahead of it the floor is below its view;
    up_tan: so much a metre rises the upper edge of that.

    age_s: since the newest scene was captured; since_s: since the one that bodies are of, which was taken in
    while the camera could be trusted; inf: none yet. health: of the camera in the newest scene. fault: why
    the camera cannot be relied on now, "" if it can.
    """

    def __init__(
        self,
        path: Path,
        robot: Robot,
        mount: CameraMount,
        config: DecisionConfig,
        start_s_m: float,
        noise: DepthNoise = TYPICAL_DEPTH_NOISE,
    ) -> None:
        self.corridor = Corridor(path, robot.body)
        self.sight = Sight(self.corridor, mount, config, start_s_m)
        self.lens = LensCover()
        self.bodies = self._seen = no_bodies(0)
        self.surfaces = NO_SURFACES
        self.health = _GOOD
        self.fault = "no scene yet"
        self.age_s = self.since_s = float("inf")
        self._mount, self._config, self._noise = mount, config, noise
        self._poses = PoseHistory()
        # Of the K bodies that were seen, which became boxes (K,), and those, steadied.
        self._boxed = np.zeros(0, np.bool_)
        self._unboxed: Bodies | None = None
        self._boxes = no_bodies(0)
        self._steady = SteadyVelocities()
        self._memory = OutOfView(mount, config.sight.near_m, robot.limits.max_obstacle_speed_mps)
        self.edge_tan, self.near_m, self.up_tan = 0.5, config.sight.near_m, math.inf
        # Of the last scenes: when they were captured, and floor points (K, 2) and (M, 2) where something was.
        self._places: deque[tuple[int, FloatArray, FloatArray]] = deque()
        self._captured_ns: int | None = None
        self._scene_fault = ""

    @property
    def has_seen(self) -> bool:
        """Whether any scene was taken in yet."""
        return self._captured_ns is not None

    def has_taken_in(self, scene: Scene) -> bool:
        """Whether this scene, or one after it, was looked at already."""
        return self._captured_ns is not None and scene.captured_ns <= self._captured_ns

    def go_on_from(self, before: Knowledge) -> None:
        """Take over what does not hang on the path: who is seen, who was seen and may come back, how fast
        they go, what hides them, and what the camera is worth."""
        self.bodies, self._boxes = before.bodies, before._boxes
        self._seen, self._boxed, self._unboxed = before._seen, before._boxed, before._unboxed
        self._steady, self._memory, self._places = before._steady, before._memory, before._places
        self._poses, self.surfaces, self.lens = before._poses, before.surfaces, before.lens
        self.health, self.edge_tan = before.health, before.edge_tan
        self.near_m, self.up_tan = before.near_m, before.up_tan
        self._captured_ns, self._scene_fault = before._captured_ns, before._scene_fault

    @property
    def remembered(self) -> NDArray[np.bool_]:
        """(N,) which of the bodies are out of sight."""
        return np.arange(len(self.bodies)) >= len(self._boxes)

    @property
    def unboxed(self) -> Bodies:
        """Seen, but as surfaces only."""
        if self._unboxed is None:
            self._unboxed = self._seen.select(~self._boxed)
        return self._unboxed

    def update(
        self, scene: Scene | None, pose: PlanarPose, on_path: OnPath, v_mps: float, now_ns: int
    ) -> None:
        """Take in the scene if it is new, and judge whether what is known can be relied on."""
        self._poses.append(now_ns, pose)
        if scene is not None and scene.captured_ns != self._captured_ns:
            self._scene_fault = self._order_fault(scene) or self._learn(scene, on_path, v_mps)
        if self._captured_ns is not None:
            self.age_s = (now_ns - self._captured_ns) / NS_PER_S
            self.since_s = max((now_ns - self.bodies.captured_ns) / NS_PER_S, 0.0)
        self.fault = self._judge()
        self.age_s = max(self.age_s, 0.0)

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
        """Returns what is wrong with the scene, "" if nothing is.

        Of a camera that cannot be trusted nothing but that is taken in: who was seen before goes on.
        """
        if scene.health.condition is CameraCondition.UNTRUSTWORTHY:
            self.health, self._captured_ns = scene.health, scene.captured_ns
            return ""
        pose = scene.robot_pose or self._poses.at(scene.captured_ns)
        if pose is None or not pose.finite:
            return "where the robot was when the scene was taken is not known"
        try:
            check_scan(scene.free_space)
            seen = bodies_of(scene, pose, self._mount, self._config.prediction.body_depth_m)
        except SceneError as error:
            return str(error)
        free, s_m = scene.free_space, self.corridor.path.project(pose, on_path.s_m).s_m
        boxed = _boxed(seen.half_view_m, seen.half_across_m, seen.moving)
        if len(free.bearing_tan):
            self.edge_tan = _outermost(free.bearing_tan) + free.half_width_tan
        self.near_m = self._memory.near_m = max(self._config.sight.near_m, free.floor_from_m)
        self.up_tan = self._memory.up_tan = free.up_tan
        self.surfaces = surfaces = surfaces_of(free, pose, self._mount, self._noise)
        boxes = self._steady.update(self._recognise(seen.select(boxed)))
        boxes = self._memory.leaving(boxes, pose, self.edge_tan)
        standing = v_mps <= STANDING_MPS
        remembered = self._memory.update(self._boxes, boxes, pose, self.edge_tan, standing, free)
        self.bodies = boxes.joined(remembered)
        self._boxes, self._seen, self._boxed, self._unboxed = boxes, seen, boxed, None
        self.lens.look(free, self.corridor.half_width_at(s_m), self._mount.left_m)
        self.sight.look(free, surfaces, pose, s_m, scene.captured_ns, boxes, standing)
        self._places.append((scene.captured_ns, surfaces.points_m, seen.xy_m))
        self.health = scene.health
        self._captured_ns = scene.captured_ns
        return ""

    def _recognise(self, bodies: Bodies) -> Bodies:
        """What stands where something stood before is no newcomer, whatever number it has now: its age_s is
        that of what is settled, its tracked_s stays."""
        while len(self._places) > 1 and self._places[1][0] <= bodies.captured_ns - _BEFORE_NS:
            self._places.popleft()
        if not self._places or not np.count_nonzero(bodies.age_s < SETTLED_S):
            return bodies
        captured_ns, *places = self._places[0]
        if captured_ns > bodies.captured_ns - _BEFORE_NS:
            return bodies
        points = np.concatenate(places)
        there = bodies.covers(points, np.full(len(points), _SAME_PLACE_M), _SAME_PLACE_M).any(axis=0)
        return replace(bodies, age_s=np.where(there, np.maximum(bodies.age_s, SETTLED_S), bodies.age_s))


@compiled("float64[:], float64[:], boolean[:]")
def _boxed(
    half_view_m: FloatArray, half_across_m: FloatArray, moving: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """(N,) who is reckoned with as a box: who moves, and what neither sprawls nor is a strip."""
    boxed = np.empty(len(moving), np.bool_)
    for k in range(len(moving)):
        sprawls = max(half_view_m[k], half_across_m[k]) > _SPRAWLING_M
        boxed[k] = moving[k] or (half_across_m[k] > _STRIP_M and not sprawls)
    return boxed


@compiled("float64[:]")
def _outermost(bearing_tan: FloatArray) -> float:
    """How far to either side the bands (B,) lie at most."""
    return float(np.abs(bearing_tan).max())
