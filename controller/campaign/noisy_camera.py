"""Scenes made from the ground truth with the errors of a real perception, which is faster than rendering.

What is modelled, and the source of the numbers:
* the field of view, the depth range and occlusion (controller/campaign/view.py); bodies nearer than the
  minimum depth are not measured;
* depth noise with sigma = 0.0075 z^2 per pixel (measured on a real RealSense). A tracked body keeps a quarter
  of it as a slowly varying error. The nearest surface of a band is the third smallest of some twenty cells,
  so it is biased towards the camera;
* a body is reported from its third sighting on, is missed in some frames (more often far away), is predicted
  while it is not seen, and is forgotten after half a second, as in vision/tracker.py;
* velocity follows the truth with the lag of the measuring window and a slowly varying error. Its standard
  deviation is as large as V_omax at the first sighting.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from config.camera import SimulatedCameraConfig
from controller.campaign.noise_model import NoiseModel
from controller.campaign.noisy_tracks import NoisyTracks
from controller.campaign.stage import Stage
from controller.campaign.view import PlanarCamera, PlanarView
from hal.clocks import NS_PER_S
from hal.compiled import compiled
from hal.geometry import camera_in_body, mount_of
from hal.types import FloatArray, PlanarPose, Pose
from vision.scene import CameraCondition, CameraHealth, EgoMotion, FreeSpace, Scene

_GOOD = CameraHealth(CameraCondition.GOOD, "", 0.95)  # depth is valid in most of the image


class NoisyCamera:
    """The perception of one camera; call look() once a frame. All random numbers come from the seed."""

    def __init__(
        self, stage: Stage, camera: SimulatedCameraConfig, seed: int, noise: NoiseModel | None = None
    ) -> None:
        self._stage, self._noise = stage, noise or NoiseModel()
        identity = Pose(np.eye(3), np.zeros(3))
        self._ego_motion = EgoMotion(identity, 1.0 / camera.fps, "none", math.nan, math.nan, math.nan)
        mount = stage.robot.camera_mount
        self.planar_camera = PlanarCamera(stage.world, camera, mount, stage.robot.body.height_m)
        self._random = np.random.default_rng((seed, 0xCA))
        glass = np.array([name in stage.case.glass for name in stage.world.names], np.bool_)
        self._glass, self._has_depth = glass, stage.in_height & ~glass
        # A body that hangs above the robot is not an obstacle.
        is_obstacle = ~glass & (stage.world.z_m[:, 0] < stage.robot.body.height_m)
        to_optical = camera_in_body(mount_of(stage.robot)).rotation.T
        self._tracks = NoisyTracks(is_obstacle, to_optical, self.planar_camera, 1.0 / camera.fps, self._noise)

    def look(self, t_s: float, sequence: int, true_pose: PlanarPose, odometry_pose: PlanarPose) -> Scene:
        """The scene of an exposure at t_s. odometry_pose: the robot's pose by odometry."""
        polygons, velocity = self._stage.world.snapshot(t_s)
        view = self.planar_camera.look(polygons, true_pose)
        self._tracks.step(view, velocity, t_s, self._random)
        return Scene(
            captured_ns=round(t_s * NS_PER_S),
            sequence=sequence,
            obstacles=self._tracks.obstacles(view, t_s),
            free_space=self._free_space(view),
            ego_motion=self._ego_motion,
            health=_GOOD,
            robot_pose=odometry_pose,
        )

    def _free_space(self, view: PlanarView) -> FreeSpace:
        """The free space: for each band, the nearest surface at the robot's height, and how far the floor is
        free."""
        planar_camera = self.planar_camera
        distances, blank = _scan_bands(
            view,
            planar_camera,
            self._noise,
            self._has_depth,
            self._glass,
            self._random.standard_normal(len(view.free_m)),
        )
        return FreeSpace(
            planar_camera.bearing_tan,
            planar_camera.half_width_tan,
            nearest_m=distances[0],
            known_m=distances[1],
            floor_from_m=planar_camera.floor_from_m,
            up_tan=planar_camera.up_tan,
            blank=blank,
        )


@compiled(PlanarView, PlanarCamera, NoiseModel, "boolean[::1], boolean[::1], float64[::1]")
def _scan_bands(
    view: PlanarView,
    camera: PlanarCamera,
    noise: NoiseModel,
    has_depth: NDArray[np.bool_],
    glass: NDArray[np.bool_],
    errors: FloatArray,
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """nearest_m and known_m (2, B), and blank (B,) of FreeSpace.

    has_depth, glass: (N,), which bodies have depth, and which are made of glass.
    errors: (B,), standard normal errors of depth.
    """
    bands, free_m, range_m = len(view.free_m), view.free_m, camera.range_m
    distances, blank = np.empty((2, bands)), np.zeros(bands, np.bool_)
    nearest, known = distances
    for b in range(bands):
        surface, nearest_glass = math.inf, math.inf
        for row in range(len(view.bodies)):
            if has_depth[view.bodies[row]]:
                surface = min(surface, view.forward_m[row, b])
            elif glass[view.bodies[row]]:
                nearest_glass = min(nearest_glass, view.forward_m[row, b])
        if free_m[b] <= min(surface, range_m) and nearest_glass > free_m[b]:
            surface = free_m[b]  # the building
        # There is no depth of glass, nor of anything behind it.
        if nearest_glass < surface:
            surface = math.inf
        if surface < math.inf:
            sigmas = noise.surface_sigmas * errors[b] - noise.surface_bias_sigmas
            surface += noise.depth_sigma_1pm * surface * surface * sigmas
        if not surface < range_m:
            surface = math.inf
        blank[b] = surface < camera.min_depth_m
        nearest[b] = math.inf if blank[b] else surface
        known[b] = 0.0 if blank[b] else min(free_m[b], nearest_glass, range_m, surface)
    return distances, blank
