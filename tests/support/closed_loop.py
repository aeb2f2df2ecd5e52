"""A mission without a renderer: boxes that move, a camera that knows them with noise, a chassis with lag."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from config.decision import DecisionConfig
from config.path import ArcSpec, LineSpec, PathSpec
from config.robot import Robot
from controller.decision.decide import DecisionMaker
from controller.decision.decision import Action, Decision
from controller.decision.situation import Situation
from controller.follow import PathFollower
from controller.path.path import Path
from controller.shape import SpeedShaper
from hal.clocks import NS_PER_S
from hal.geometry import advance_pose, camera_in_floor
from hal.types import CameraMount, FloatArray, Pose
from vision.scene import CameraCondition, CameraHealth, EgoMotion, FreeSpace, Obstacle, Scene

PERIOD_S = 0.02
FRAME_S = 1.0 / 30.0
LATENCY_S = 0.06
MOUNT = CameraMount(0.45, 0.0, 0.60, math.radians(4.0))
BANDS = 80
EDGE_TAN = 0.687
STILL = EgoMotion(Pose(np.eye(3), np.zeros(3)), FRAME_S, "none", math.nan, math.nan, math.nan)
GOOD = CameraHealth(CameraCondition.GOOD, "", 0.9)

Trajectory = Callable[[float], tuple[float, float]]


def bend(radius_m: float, angle_deg: float, before_m: float = 6.0, after_m: float = 8.0) -> Path:
    segments = (
        LineSpec(kind="line", length_m=before_m),
        ArcSpec(kind="arc", radius_m=radius_m, angle_deg=angle_deg),
        LineSpec(kind="line", length_m=after_m),
    )
    return Path(PathSpec(segments=segments), Robot())


def standing_at(x_m: float, y_m: float) -> Trajectory:
    return lambda _: (x_m, y_m)


def walking(
    x_m: float, y_m: float, vx_mps: float, vy_mps: float, from_s: float = 0.0, to_s: float = math.inf
) -> Trajectory:
    """At (x, y) until from_s, then with constant velocity until to_s, then standing."""

    def position_at(t_s: float) -> tuple[float, float]:
        moving_s = min(max(t_s - from_s, 0.0), to_s - from_s)
        return x_m + vx_mps * moving_s, y_m + vy_mps * moving_s

    return position_at


@dataclass(frozen=True)
class Box:
    """A box along the axes of the floor. seen_by_edges: False for a plain wall, which only depth sees."""

    position_at: Trajectory
    length_m: float = 0.4
    width_m: float = 0.5
    height_m: float = 1.7
    seen_by_edges: bool = True

    def velocity(self, t_s: float) -> tuple[float, float]:
        (x0, y0), (x1, y1) = self.position_at(t_s - 0.01), self.position_at(t_s + 0.01)
        return (x1 - x0) / 0.02, (y1 - y0) / 0.02


@dataclass
class Noise:
    """depth_1pm: sigma of a single depth = this * z^2, of which the tracker leaves a quarter in positions."""

    depth_1pm: float = 0.0
    velocity_mps: float = 0.0
    seed: int = 1


@dataclass
class Log:
    """One entry a control step."""

    v_mps: list[float] = field(default_factory=list)
    a_mps2: list[float] = field(default_factory=list)
    decisions: list[Decision] = field(default_factory=list)
    s_m: list[float] = field(default_factory=list)
    clearance_m: list[float] = field(default_factory=list)
    offset_m: list[float] = field(default_factory=list)


class Mission:
    """Drives a path among things; alter(scene, t) may spoil what the camera says (None: no scene)."""

    def __init__(
        self,
        path: Path,
        boxes: list[Box],
        noise: Noise | None = None,
        config: DecisionConfig | None = None,
        alter: Callable[[Scene, float], Scene | None] | None = None,
        lag_s: float = 0.1,
        yaw_ratio: float = 1.0,
    ) -> None:
        self.robot = Robot()
        self.path, self.boxes, self.noise = path, boxes, noise or Noise()
        self.decide = DecisionMaker(config or DecisionConfig(), self.robot, MOUNT, PERIOD_S)
        self.shape = SpeedShaper(self.robot.limits, PERIOD_S, 0.15)
        self.follow = PathFollower(path, self.robot.limits, preview_s=0.1)
        self.alter, self.lag_s, self.yaw_ratio = alter, lag_s, yaw_ratio
        self.pose, self.v, self.w, self.s, self.t = path.start, 0.0, 0.0, 0.0, 0.0
        self.log = Log()
        self._random = np.random.default_rng(self.noise.seed)
        self._first_seen_s: dict[int, float] = {}
        self._drift: dict[int, FloatArray] = {}
        self._frames = 0
        self._in_transit: deque[tuple[float, Scene]] = deque()
        self._scene: Scene | None = None

    def run(self, limit_s: float = 90.0) -> Log:
        """Until it rests at the target or the time is up."""
        while self.t < limit_s:
            self.step()
            at_target = self.path.length_m - self.s < 0.03
            if at_target and self.log.v_mps[-1] == 0.0 and self.v < 1e-3:
                break
        return self.log

    @property
    def reached(self) -> bool:
        return self.path.length_m - self.s < 0.03

    def step(self) -> None:
        if self.t >= self._frames * FRAME_S - 1e-9:
            self._frames += 1
            scene = self.look()
            altered = self.alter(scene, self.t) if self.alter else scene
            if altered is not None:
                self._in_transit.append((self.t + LATENCY_S, altered))
        while self._in_transit and self._in_transit[0][0] <= self.t:
            self._scene = self._in_transit.popleft()[1]
        on_path = self.path.project(self.pose, self.s)
        self.s = on_path.s_m
        now_ns = round(self.t * NS_PER_S)
        decision = self.decide.step(
            Situation(self._scene, self.path, self.pose, on_path, self.shape.v_mps, self.shape.a_mps2, now_ns)
        )
        shaped = self.shape.step(
            decision.target_speed_mps,
            emergency=decision.emergency,
            distance_to_end_m=self.path.length_m - self.s,
        )
        w = self.follow.step(on_path, shaped.v_mps)
        gain = 1.0 - math.exp(-PERIOD_S / self.lag_s)
        self.v += gain * (shaped.v_mps - self.v)
        self.w += gain * (w - self.w)
        self.pose = advance_pose(self.pose, self.v, self.yaw_ratio * self.w, PERIOD_S)
        self.t += PERIOD_S
        log = self.log
        log.v_mps.append(shaped.v_mps)
        log.a_mps2.append(shaped.a_mps2)
        log.decisions.append(decision)
        log.s_m.append(self.s)
        log.offset_m.append(on_path.d_m)
        log.clearance_m.append(self.clearance())

    def clearance(self) -> float:
        """Between the robot's rectangle and the nearest thing; 0 when they overlap."""
        body = self.robot.body
        c, s = math.cos(self.pose.heading_rad), math.sin(self.pose.heading_rad)
        min_clearance_m = math.inf
        for box in self.boxes:
            x, y = box.position_at(self.t)
            u = np.linspace(-0.5, 0.5, 9)
            edge = np.concatenate(
                [np.stack((u, np.full(9, side)), 1) for side in (-0.5, 0.5)]
                + [np.stack((np.full(9, side), u), 1) for side in (-0.5, 0.5)]
            )
            px, py = x + edge[:, 0] * box.length_m, y + edge[:, 1] * box.width_m
            ahead = (px - self.pose.x_m) * c + (py - self.pose.y_m) * s
            left = (py - self.pose.y_m) * c - (px - self.pose.x_m) * s
            outside_x = np.maximum(np.maximum(-body.rear_m - ahead, ahead - body.front_m), 0.0)
            outside_y = np.maximum(np.abs(left) - body.width_m / 2, 0.0)
            min_clearance_m = min(min_clearance_m, float(np.hypot(outside_x, outside_y).min()))
        return min_clearance_m

    def look(self) -> Scene:
        captured_ns = round(self.t * NS_PER_S)
        obstacles = tuple(
            seen for k, box in enumerate(self.boxes) if (seen := self._observe(k, box)) is not None
        )
        return Scene(captured_ns, self._frames, obstacles, self._free_space(), STILL, GOOD, self.pose)

    def _observe(self, k: int, box: Box) -> Obstacle | None:
        x, y = box.position_at(self.t)
        vx, vy = box.velocity(self.t)
        camera = camera_in_floor(self.pose, MOUNT).inverse()
        position = camera.apply(np.array([[x, y, box.height_m / 2]]))[0]
        c, s = abs(math.cos(self.pose.heading_rad)), abs(math.sin(self.pose.heading_rad))
        depth_m = c * box.length_m + s * box.width_m
        width_m = s * box.length_m + c * box.width_m
        half_tan = (abs(position[0]) - width_m / 2) / max(position[2], 1e-6)
        hidden_below = box.height_m < MOUNT.height_m * (1.0 - position[2] / 1.3)
        if (
            not box.seen_by_edges
            or position[2] < 0.2
            or position[2] > 10.0
            or half_tan > EDGE_TAN
            or hidden_below
        ):
            self._first_seen_s.pop(k, None)
            return None
        age_s = self.t - self._first_seen_s.setdefault(k, self.t)
        sigma_m = 0.25 * self.noise.depth_1pm * position[2] ** 2
        drift = self._drift.setdefault(k, np.zeros(3))
        drift[:] = 0.9 * drift + math.sqrt(1 - 0.81) * self._random.normal(size=3)
        position = position + np.array([0.1 * sigma_m, 0.0, sigma_m]) * drift
        # Only the near half is seen: the centre of the visible surface is nearer than the body's.
        position[2] -= 0.25 * depth_m
        velocity_mps = camera.rotation @ np.array([vx, vy, 0.0])
        sigma_mps = max(self.noise.velocity_mps, 0.1)
        is_new = age_s < 0.2
        moving = not is_new and math.hypot(vx, vy) > 0.15
        if moving:
            velocity_mps = velocity_mps + self.noise.velocity_mps * drift[[1, 0, 2]]
        return Obstacle(
            id=k + 1,
            bbox_px=(0.0, 0.0, 1.0, 1.0),
            position_m=position,
            extent_m=np.array([width_m, box.height_m, 0.5 * depth_m]),
            velocity_mps=velocity_mps if moving else np.zeros(3),
            velocity_cov=np.eye(3) * (1.5 if is_new else sigma_mps) ** 2,
            moving=moving,
            score=0.9,
            fragments=8,
            age_s=age_s,
            unseen_s=0.0,
        )

    def _free_space(self) -> FreeSpace:
        half = EDGE_TAN / BANDS
        bearing = np.linspace(-EDGE_TAN + half, EDGE_TAN - half, BANDS)
        nearest = np.full(BANDS, np.inf)
        c, s = math.cos(self.pose.heading_rad), math.sin(self.pose.heading_rad)
        # Rays of unit forward distance from the camera, in floor axes.
        dx, dy = c + bearing * s, s - bearing * c
        ox, oy = self.pose.x_m + c * MOUNT.forward_m, self.pose.y_m + s * MOUNT.forward_m
        for box in self.boxes:
            x, y = box.position_at(self.t)
            with np.errstate(divide="ignore", invalid="ignore"):
                tx = np.sort(np.stack([(x + e * box.length_m / 2 - ox) / dx for e in (-1, 1)]), axis=0)
                ty = np.sort(np.stack([(y + e * box.width_m / 2 - oy) / dy for e in (-1, 1)]), axis=0)
            near, far = np.maximum(tx[0], ty[0]), np.minimum(tx[1], ty[1])
            below = box.height_m < MOUNT.height_m * (1.0 - near / 1.3)
            hit = (near < far) & (near > 0.25) & (near < 10.0) & ~below
            nearest = np.where(hit, np.minimum(nearest, near), nearest)
        if self.noise.depth_1pm:
            z = np.where(np.isfinite(nearest), nearest, 0.0)
            nearest = nearest + self.noise.depth_1pm * z**2 * (self._random.normal(size=BANDS) - 1.0)
            nearest = np.maximum(nearest, 0.25)
        return FreeSpace(bearing, half, nearest, np.minimum(nearest, 10.0))


def reversals(log: Log) -> int:
    """The greatest number of decrease/increase turns of the decision within any 2 s."""
    turns, last = [], None
    for k, decision in enumerate(log.decisions):
        if decision.action is Action.KEEP:
            continue
        if last is not None and decision.action is not last:
            turns.append(k * PERIOD_S)
        last = decision.action
    return max((sum(t <= u < t + 2.0 for u in turns) for t in turns), default=0)


def optimum_s(path: Path, mission: Mission) -> float:
    """The shortest time of a jerk-limited drive over an empty straight path."""
    from controller import braking

    limits = mission.robot.limits
    stop = braking.stop(limits.max_speed_mps, 0.0, braking.comfort(limits))
    return 2 * stop.time_s + (path.length_m - 2 * stop.distance_m) / limits.max_speed_mps
