"""What the decision knows of the way ahead: the last good scene, and what is remembered of those before.

WorldModel takes in each new scene: the obstacles as boxes (controller/decision/obstacle_boxes.py) and what is
known of these bodies (known_bodies.py), the surfaces that depth sees (surfaces.py), whether the lens is
covered (lens_cover.py), and free floor and unexplained surfaces along the path (sight.py). In each control
step it says whether the camera can be relied on (the field fault). controller/decision/speed_limits.py turns
what is known into speed limits.
"""

from __future__ import annotations

import math

import numpy as np

from config.decision import DecisionConfig
from config.perception import TYPICAL_DEPTH_NOISE, DepthNoise
from config.robot import Robot
from controller.base.localise import PoseHistory
from controller.decision.bodies import Bodies
from controller.decision.corridor import Corridor
from controller.decision.known_bodies import KnownBodies
from controller.decision.lens_cover import LensCover
from controller.decision.limits import STANDING_MPS
from controller.decision.obstacle_boxes import bodies_of
from controller.decision.sight import Sight
from controller.decision.situation import SceneError
from controller.decision.surfaces import NO_SURFACES, check_scan, surfaces_of
from controller.decision.view_edges import CurrentView, view_from
from controller.path.path import OnPath, Path
from hal.clocks import NS_PER_S
from hal.compiled import compiled
from hal.types import CameraMount, Flags, FloatArray, PlanarPose
from vision.scene import CameraCondition, CameraHealth, FreeSpace, Scene

_FUTURE_S = 0.005  # tolerance of the scene's time stamp
# Until a scene tells where the view ends to the sides; that of an ordinary camera.
_EDGE_TAN = 0.5
_UNKNOWN_POSE = PlanarPose(math.nan, math.nan, math.nan)
_GOOD = CameraHealth(CameraCondition.GOOD, "", float("nan"))


class WorldModel:
    """Takes in scenes along one path. Points are in metres, in the frame of the path.

    surfaces: P points that depth saw, and how far it saw in each band (controller/decision/surfaces.py).
    corridor: the floor that the robot sweeps along the path.
    sight: how much of the corridor was seen free, and the nearest unexplained surface in it.
    lens: whether something is too near to the lens to be seen.
    view: what the camera had in view in that scene.
    age_s: time since the newest scene was captured; inf: none yet.
    since_s: time since the scene of bodies was captured, the last one of a trustworthy camera; inf: none yet.
    health: of the camera in the newest scene.
    fault: why the camera cannot be relied on now; "" if it can.
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
        self.surfaces = NO_SURFACES
        self.health = _GOOD
        self.fault = "no scene yet"
        self.age_s = self.since_s = float("inf")
        self._mount, self._config, self._noise = mount, config, noise
        self._poses = PoseHistory()
        self._around = KnownBodies(config, robot)
        self.view = view_from(_UNKNOWN_POSE, mount, _EDGE_TAN, config.sight.near_m, math.inf)
        self._captured_ns: int | None = None
        self._scene_fault = ""

    @property
    def has_seen(self) -> bool:
        """Whether any scene has been taken in."""
        return self._captured_ns is not None

    def has_taken_in(self, scene: Scene) -> bool:
        """Whether this scene, or a later one, was already looked at."""
        return self._captured_ns is not None and scene.captured_ns <= self._captured_ns

    def take_over(self, before: WorldModel) -> None:
        """Take over what does not depend on the path: bodies, surfaces, the camera's state."""
        self._around, self.surfaces = before._around, before.surfaces
        self._poses, self.lens = before._poses, before.lens
        self.health, self.view = before.health, before.view
        self._captured_ns, self._scene_fault = before._captured_ns, before._scene_fault

    @property
    def bodies(self) -> Bodies:
        """N boxes that count, those in view before those out of view (controller/decision/bodies.py)."""
        return self._around.bodies

    @property
    def remembered(self) -> Flags:
        """(N,) which of the bodies are out of view."""
        return self._around.remembered

    @property
    def pausing(self) -> Flags:
        """(N,) which of the bodies stand, but moved a moment ago."""
        return self._around.pausing

    @property
    def unboxed(self) -> Bodies:
        """M more bodies in view that count as surfaces only."""
        return self._around.unboxed

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
        """Why the scene is not taken in, if it is older than the last one; else ""."""
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
        """Take in a new scene; return what is wrong with it, "" if nothing is.

        From an untrustworthy camera only its health is taken in: the bodies known before are kept.
        """
        if scene.health.condition is CameraCondition.UNTRUSTWORTHY:
            self.health, self._captured_ns = scene.health, scene.captured_ns
            return ""
        pose = scene.robot_pose or self._poses.at(scene.captured_ns)
        if pose is None or not pose.finite:
            return "the robot's pose at the time of the scene is not known"
        try:
            check_scan(scene.free_space)
            seen = bodies_of(scene, pose, self._mount, self._config.prediction.body_depth_m)
        except SceneError as error:
            return str(error)
        free, s_m = scene.free_space, self.corridor.path.project(pose, on_path.s_m).s_m
        standing = v_mps <= STANDING_MPS
        self.view = view = self._view_of(free, pose)
        self.surfaces = surfaces = surfaces_of(free, pose, self._mount, self._noise)
        self._around.look(seen, view, free, surfaces, standing)
        self.lens.look(free, self.corridor.half_width_at(s_m), self._mount.left_m)
        self.sight.look(free, surfaces, pose, s_m, scene.captured_ns, self._around.in_view, standing)
        self.health = scene.health
        self._captured_ns = scene.captured_ns
        return ""

    def _view_of(self, free: FreeSpace, pose: PlanarPose) -> CurrentView:
        """The view in a scene; its side edges are the last ones if the scene does not tell."""
        edge_tan = self.view.edge_tan
        if len(free.bearing_tan):
            edge_tan = _outermost(free.bearing_tan) + free.half_width_tan
        near_m = max(self._config.sight.near_m, free.floor_from_m)
        return view_from(pose, self._mount, edge_tan, near_m, free.up_tan)


@compiled("float64[:]")
def _outermost(bearing_tan: FloatArray) -> float:
    """The greatest bearing of the bands (B,), to either side."""
    return float(np.abs(bearing_tan).max())
