"""Scenes made from the truth, with the errors of a real perception: fast, in place of camera and vision.

What is modelled, and from where the numbers are:
* the field of view, the depth range, what stands before what (controller/campaign/view.py); of what is nearer
  than the least depth nothing is measured;
* depth noise sigma = 0.0075 z^2 per pixel (measured on a real RealSense), of which a tracked body keeps a
  quarter as a wandering error, and of which the nearest surface of a band, being the third smallest of some
  twenty cells, shows its near tail;
* a body is reported from its third sighting on, is missed in some frames (more of them far away), is
  predicted while it is not seen, and forgotten after half a second, as vision/tracker.py does;
* velocity follows the truth with a lag of the measuring window, with an error that wanders, and with a
  spread that is as wide as V_omax at first sight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from config.camera import SimulatedCameraConfig
from config.robot import Robot
from controller.campaign.stage import Stage
from controller.campaign.view import PlanarEye, PlanarView
from hal.clocks import NS_PER_S
from hal.geometry import camera_in_body
from hal.types import CameraMount, FloatArray, PlanarPose, Pose
from vision.scene import CameraCondition, CameraHealth, EgoMotion, FreeSpace, Obstacle, Scene

_GOOD = CameraHealth(CameraCondition.GOOD, "", 0.95)
_BOX_PX = (0.0, 0.0, 1.0, 1.0)
# How well it is known that nothing goes up or down.
_UP_MPS = 0.1
# What was in view in the frame before was so within this many of its periods.
_SEEN_FRAMES = 1.5


@dataclass(frozen=True, slots=True)
class NoiseModel:
    """Standard deviations, times and shares; z is the distance in metres."""

    depth_sigma_1pm: float = 0.0075
    kept_by_tracker: float = 0.25
    side_sigma_m: float = 0.01
    side_velocity_mps: float = 0.05
    side_velocity_per_m: float = 0.010
    radial_velocity_mps: float = 0.07
    radial_velocity_per_m: float = 0.025
    first_velocity_mps: float = 1.5
    first_velocity_fades_s: float = 0.12
    velocity_lag_s: float = 0.15
    wander_s: float = 0.25
    sightings: int = 3
    missed_share: float = 0.03
    missed_share_at_range: float = 0.4
    forget_s: float = 0.5
    moving_mps: float = 0.15
    moving_per_m: float = 0.02
    rise_s: float = 0.1
    fall_s: float = 0.3
    surface_bias_sigmas: float = 1.0
    surface_sigmas: float = 0.5


class NoisyCamera:
    """One camera's perception. look() once a frame; all randomness is the seed's."""

    def __init__(
        self, stage: Stage, camera: SimulatedCameraConfig, seed: int, noise: NoiseModel | None = None
    ) -> None:
        self._stage, self._noise = stage, noise or NoiseModel()
        # Of velocities along the view, to its side and upwards: so much, and so much more a metre away.
        self._sigma_mps = np.array([self._noise.radial_velocity_mps, self._noise.side_velocity_mps, _UP_MPS])
        self._sigma_per_m = np.array(
            [self._noise.radial_velocity_per_m, self._noise.side_velocity_per_m, 0.0]
        )
        self._period_s, self._least_m = 1.0 / camera.fps, camera.depth_min_m
        unmoved = Pose(np.eye(3), np.zeros(3))
        self._ego_motion = EgoMotion(unmoved, self._period_s, "none", math.nan, math.nan, math.nan)
        mount = stage.robot.camera_mount
        self._mount = mount
        self.eye = PlanarEye(stage.world, camera, mount, stage.robot.body.height_m)
        self._random = np.random.default_rng((seed, 0xCA))
        self._glass = np.array([name in stage.case.faults.glass for name in stage.world.names], np.bool_)
        self._scanned = stage.in_height & ~self._glass
        # What hangs above the robot is no obstacle.
        self._listed = ~self._glass & (stage.world.z_m[:, 0] < stage.robot.body.height_m)
        self._to_optical = camera_in_body(mount_of(stage.robot)).rotation.T
        low_m, high_m = stage.world.z_m.T
        self._middle_m = 0.5 * (low_m + high_m) - mount.height_m
        n = len(stage.world)
        self._ids = np.zeros(n, np.int64)
        self._next_id = 1
        self._first_s, self._seen_s = np.full(n, np.nan), np.full(n, -np.inf)
        self._sightings = np.zeros(n, np.int64)
        self._velocity = np.zeros((n, 2))
        self._evidence_s, self._moving = np.zeros(n), np.zeros(n, np.bool_)
        self._wander = np.zeros((n, 4))
        self._centre, self._extent = np.zeros((n, 2)), np.zeros((n, 3))
        self._extent[:, 1] = high_m - low_m
        self._started = False

    def look(self, t_s: float, sequence: int, true_pose: PlanarPose, known_pose: PlanarPose) -> Scene:
        """The scene of an exposure at t_s. known_pose: where the robot believes to be."""
        polygons, velocity = self._stage.world.look(t_s)
        view = self.eye.look(polygons, true_pose)
        self._advance(velocity, t_s)
        self._sight(view, t_s, true_pose)
        return Scene(
            captured_ns=round(t_s * NS_PER_S),
            sequence=sequence,
            obstacles=self._obstacles(t_s, true_pose),
            free_space=self._free_space(view),
            ego_motion=self._ego_motion,
            health=_GOOD,
            robot_pose=known_pose,
        )

    def _advance(self, velocity: FloatArray, t_s: float) -> None:
        """Errors wander, measured velocities follow the true ones; what is not seen goes on as it did, or as
        it was thought to."""
        noise, dt_s = self._noise, self._period_s
        keep = math.exp(-dt_s / noise.wander_s) if self._started else 0.0
        self._started = True
        fresh = self._random.standard_normal(self._wander.shape)
        self._wander = keep * self._wander + math.sqrt(1.0 - keep * keep) * fresh
        follows = -math.expm1(-dt_s / noise.velocity_lag_s)
        seen = self._seen_s > t_s - _SEEN_FRAMES * dt_s
        self._velocity += np.where(seen[:, None], follows * (velocity - self._velocity), 0.0)
        self._centre += self._velocity * dt_s

    def _sight(self, view: PlanarView, t_s: float, pose: PlanarPose) -> None:
        """Take in what this frame shows."""
        noise = self._noise
        missed = self._random.random(len(self._ids)).tolist()
        hits = np.where(view.forward_m >= self._least_m, view.forward_m, np.inf)
        rows = ((hits.min(axis=1) < np.inf) & self._listed[view.bodies]).nonzero()[0]
        z = hits.take(rows, 0)
        shown = z < np.inf
        x = z * self.eye.bearing_tan
        low_z, high_z = z.min(axis=1), np.where(shown, z, -np.inf).max(axis=1)
        low_x = np.where(shown, x, np.inf).min(axis=1) - low_z * self.eye.half_width_tan
        high_x = np.where(shown, x, -np.inf).max(axis=1) + low_z * self.eye.half_width_tan
        right, forward = (0.5 * (low_x + high_x)).tolist(), (0.5 * (low_z + high_z)).tolist()
        far = (low_z / self.eye.range_m).tolist()
        for k, body in enumerate(view.bodies[rows].tolist()):
            share = noise.missed_share_at_range * (2.0 * far[k] - 1.0)
            if missed[body] < max(noise.missed_share, share):
                continue
            self._see(body, right[k], forward[k], t_s, pose)
            self._extent[body, ::2] = high_x[k] - low_x[k], high_z[k] - low_z[k]
        gone = self._seen_s < t_s - noise.forget_s
        self._sightings[gone] = 0
        self._moving[gone] = False
        self._evidence_s[gone] = 0.0

    def _see(self, body: int, right_m: float, forward_m: float, t_s: float, pose: PlanarPose) -> None:
        if self._sightings[body] == 0:
            self._ids[body], self._next_id = self._next_id, self._next_id + 1
            self._first_s[body] = t_s
            self._velocity[body] = 0.0
        self._sightings[body] += 1
        self._seen_s[body] = t_s
        cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        ahead, left = forward_m + self._mount.forward_m, self._mount.left_m - right_m
        self._centre[body] = pose.x_m + ahead * cos - left * sin, pose.y_m + ahead * sin + left * cos
        self._judge(body, forward_m)

    def _judge(self, body: int, z_m: float) -> None:
        noise = self._noise
        fast = math.hypot(*self._velocity[body].tolist()) > noise.moving_mps + noise.moving_per_m * z_m
        step_s = self._period_s
        if fast:
            self._evidence_s[body] = min(self._evidence_s[body] + step_s, noise.rise_s + step_s)
            self._moving[body] |= self._evidence_s[body] >= noise.rise_s
        else:
            self._evidence_s[body] -= step_s * noise.rise_s / noise.fall_s
            if self._evidence_s[body] <= 0.0:
                self._evidence_s[body], self._moving[body] = 0.0, False

    def _obstacles(self, t_s: float, pose: PlanarPose) -> tuple[Obstacle, ...]:
        noise = self._noise
        cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        dx, dy = self._centre[:, 0] - pose.x_m, self._centre[:, 1] - pose.y_m
        all_ahead = dx * cos + dy * sin - self._mount.forward_m
        rows = ((self._sightings >= noise.sightings) & (all_ahead > 0.0)).nonzero()[0]
        if not len(rows):
            return ()
        ahead, left = all_ahead[rows], dy[rows] * cos - dx[rows] * sin
        wander = self._wander.take(rows, 0)
        sigma_m = noise.kept_by_tracker * noise.depth_sigma_1pm * ahead * ahead
        in_camera = np.empty((len(rows), 3))
        in_camera[:, 0] = ahead + sigma_m * wander[:, 0]
        in_camera[:, 1] = left - self._mount.left_m + noise.side_sigma_m * wander[:, 1]
        in_camera[:, 2] = self._middle_m[rows]
        sigma = self._sigma_mps + self._sigma_per_m * ahead[:, None]
        vx, vy = self._velocity.take(rows, 0).T
        velocity = np.zeros((len(rows), 3))
        velocity[:, 0], velocity[:, 1] = vx * cos + vy * sin, vy * cos - vx * sin
        velocity[:, :2] += sigma[:, :2] * wander[:, 2:]
        age_s = t_s - self._first_s[rows]
        sigma += (noise.first_velocity_mps * np.exp(-age_s / noise.first_velocity_fades_s))[:, None]
        turn = self._to_optical
        columns = zip(
            self._ids[rows].tolist(),
            in_camera @ turn.T,
            self._extent.take(rows, 0),
            velocity @ turn.T,
            (turn * (sigma * sigma)[:, None, :]) @ turn.T,
            self._moving[rows].tolist(),
            age_s.tolist(),
            (t_s - self._seen_s[rows]).tolist(),
            strict=True,
        )
        return tuple(
            Obstacle(
                id=number,
                bbox_px=_BOX_PX,
                position_m=position,
                extent_m=extent,
                velocity_mps=speed,
                velocity_cov=covariance,
                moving=moves,
                score=0.9 if moves else 0.5,
                fragments=8,
                age_s=age,
                unseen_s=unseen,
            )
            for number, position, extent, speed, covariance, moves, age, unseen in columns
        )

    def _free_space(self, view: PlanarView) -> FreeSpace:
        """What the bands show: the nearest thing in the robot's height, and how far the floor is free."""
        noise, eye = self._noise, self.eye
        nearest = view.forward_m.take(self._scanned[view.bodies].nonzero()[0], 0).min(axis=0, initial=np.inf)
        hidden = view.forward_m.take(self._glass[view.bodies].nonzero()[0], 0).min(axis=0, initial=np.inf)
        building = view.free_m <= np.minimum(nearest, eye.range_m)
        nearest = np.where(building & (hidden > view.free_m), view.free_m, nearest)
        nearest = np.where(hidden < nearest, np.inf, nearest)
        z = np.where(np.isfinite(nearest), nearest, 0.0)
        errors = noise.surface_sigmas * self._random.standard_normal(len(z)) - noise.surface_bias_sigmas
        nearest = nearest + noise.depth_sigma_1pm * z * z * errors
        nearest = np.where(nearest < eye.range_m, nearest, np.inf)
        known = np.minimum(np.minimum(np.minimum(view.free_m, hidden), eye.range_m), nearest)
        blind = nearest < self._least_m
        nearest, known = np.where(blind, np.inf, nearest), np.where(blind, 0.0, known)
        return FreeSpace(
            eye.bearing_tan,
            eye.half_width_tan,
            nearest,
            known,
            floor_from_m=eye.floor_from_m,
            up_tan=eye.up_tan,
            blank=blind,
        )


def mount_of(robot: Robot) -> CameraMount:
    """Where the camera sits."""
    mount = robot.camera_mount
    return CameraMount(mount.forward_m, mount.left_m, mount.height_m, mount.pitch_rad)
