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

import numpy as np
from numpy.typing import NDArray

from config.camera import SimulatedCameraConfig
from config.robot import Robot
from controller.campaign.noise_model import NoiseModel
from controller.campaign.noisy_tracks import NoisyTracks
from controller.campaign.stage import Stage
from controller.campaign.view import PlanarEye, PlanarView
from hal.clocks import NS_PER_S
from hal.compiled import compiled
from hal.geometry import camera_in_body
from hal.types import CameraMount, FloatArray, PlanarPose, Pose
from vision.scene import CameraCondition, CameraHealth, EgoMotion, FreeSpace, Scene

__all__ = ["NoiseModel", "NoisyCamera", "mount_of"]

_GOOD = CameraHealth(CameraCondition.GOOD, "", 0.95)


class NoisyCamera:
    """One camera's perception. look() once a frame; all randomness is the seed's."""

    def __init__(
        self, stage: Stage, camera: SimulatedCameraConfig, seed: int, noise: NoiseModel | None = None
    ) -> None:
        self._stage, self._noise = stage, noise or NoiseModel()
        self._least_m = camera.depth_min_m
        unmoved = Pose(np.eye(3), np.zeros(3))
        self._ego_motion = EgoMotion(unmoved, 1.0 / camera.fps, "none", math.nan, math.nan, math.nan)
        mount = stage.robot.camera_mount
        self.eye = PlanarEye(stage.world, camera, mount, stage.robot.body.height_m)
        self._random = np.random.default_rng((seed, 0xCA))
        glass = np.array([name in stage.case.faults.glass for name in stage.world.names], np.bool_)
        self._glass, self._scanned = glass, stage.in_height & ~glass
        # What hangs above the robot is no obstacle.
        listed = ~glass & (stage.world.z_m[:, 0] < stage.robot.body.height_m)
        to_optical = camera_in_body(mount_of(stage.robot)).rotation.T
        self._tracks = NoisyTracks(
            stage.world.z_m, listed, to_optical, self.eye, mount.height_m, camera, self._noise
        )

    def look(self, t_s: float, sequence: int, true_pose: PlanarPose, known_pose: PlanarPose) -> Scene:
        """The scene of an exposure at t_s. known_pose: where the robot believes to be."""
        polygons, velocity = self._stage.world.look(t_s)
        view = self.eye.look(polygons, true_pose)
        self._tracks.advance(velocity, t_s, self._random)
        self._tracks.sight(view, t_s, self._random)
        return Scene(
            captured_ns=round(t_s * NS_PER_S),
            sequence=sequence,
            obstacles=self._tracks.obstacles(view, t_s),
            free_space=self._free_space(view),
            ego_motion=self._ego_motion,
            health=_GOOD,
            robot_pose=known_pose,
        )

    def _free_space(self, view: PlanarView) -> FreeSpace:
        """What the bands show: the nearest thing in the robot's height, and how far the floor is free."""
        noise, eye = self._noise, self.eye
        distances, blind = _scanned(
            view.bodies,
            view.forward_m,
            view.free_m,
            self._scanned,
            self._glass,
            self._random.standard_normal(len(view.free_m)),
            noise.surface_bias_sigmas,
            noise.surface_sigmas,
            noise.depth_sigma_1pm,
            eye.range_m,
            self._least_m,
        )
        return FreeSpace(
            eye.bearing_tan,
            eye.half_width_tan,
            distances[0],
            distances[1],
            floor_from_m=eye.floor_from_m,
            up_tan=eye.up_tan,
            blank=blind,
        )


def mount_of(robot: Robot) -> CameraMount:
    """Where the camera sits."""
    mount = robot.camera_mount
    return CameraMount(mount.forward_m, mount.left_m, mount.height_m, mount.pitch_rad)


@compiled(
    "int64[::1], float64[:, ::1], float64[::1], boolean[::1], boolean[::1], float64[::1],"
    "float64, float64, float64, float64, float64"
)
def _scanned(
    bodies: NDArray[np.intp],
    forward_m: FloatArray,
    free_m: FloatArray,
    scanned: NDArray[np.bool_],
    glass: NDArray[np.bool_],
    errors: FloatArray,
    bias_sigmas: float,
    sigmas: float,
    depth_sigma_1pm: float,
    range_m: float,
    least_m: float,
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """(2, B) nearest_m and known_m, and (B,) blank of FreeSpace. scanned, glass (N,): which bodies depth is
    measured of, and which are of glass; errors (B,): of depth, as normal as can be."""
    bands = len(free_m)
    distances, blind = np.empty((2, bands)), np.zeros(bands, np.bool_)
    nearest, known = distances
    for b in range(bands):
        near, hidden = math.inf, math.inf
        for row in range(len(bodies)):
            if scanned[bodies[row]]:
                near = min(near, forward_m[row, b])
            elif glass[bodies[row]]:
                hidden = min(hidden, forward_m[row, b])
        if free_m[b] <= min(near, range_m) and hidden > free_m[b]:
            near = free_m[b]  # the building
        # Through glass nothing is measured, neither it nor what is behind it.
        if hidden < near:
            near = math.inf
        if near < math.inf:
            near += depth_sigma_1pm * near * near * (sigmas * errors[b] - bias_sigmas)
        if not near < range_m:
            near = math.inf
        blind[b] = near < least_m
        nearest[b] = math.inf if blind[b] else near
        known[b] = 0.0 if blind[b] else min(free_m[b], hidden, range_m, near)
    return distances, blind
