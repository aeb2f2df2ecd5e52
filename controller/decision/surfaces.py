"""The free space of a scene as points on the floor, in the frame of the path: the nearest surfaces around."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.perception import TYPICAL_DEPTH_NOISE, DepthNoise
from controller.decision.bodies import Bodies
from hal.types import CameraMount, FloatArray, PlanarPose
from vision.scene import FreeSpace

# A point this near to an obstacle's box is part of it: swinging limbs, a box that lags a little.
AROUND_M = 0.3
_DEPTH_SIGMAS = 3.5


@dataclass(frozen=True, slots=True, eq=False)
class Surfaces:
    """P points, left to right. bands (P,): of the B bands of the free space, which they are of. forward_m
    (P,) from the camera. half_band_m (P,): half of the width that a point stands for. points_m (P, 2). seen_m
    (B,): how far each band was seen through, to a surface or over free floor; 0: nothing was measured.
    noise: of the camera's depth."""

    seen_m: FloatArray
    bands: NDArray[np.intp]
    forward_m: FloatArray
    half_band_m: FloatArray
    points_m: FloatArray
    noise: DepthNoise = TYPICAL_DEPTH_NOISE

    def of(self, bodies: Bodies) -> NDArray[np.bool_]:
        """(P, N) which points belong to which bodies: along the view, depth may be off."""
        reach_m = AROUND_M + _DEPTH_SIGMAS * self.noise.quadratic_per_m * self.forward_m**2
        return bodies.covers(self.points_m, reach_m, AROUND_M)


NO_SURFACES = Surfaces(np.zeros(0), np.zeros(0, np.intp), np.zeros(0), np.zeros(0), np.zeros((0, 2)))


def surfaces_of(
    free: FreeSpace, pose: PlanarPose, mount: CameraMount, noise: DepthNoise = TYPICAL_DEPTH_NOISE
) -> Surfaces:
    """What was seen of free by a camera that a body at pose carried. noise: of its depth."""
    shows = np.isfinite(free.nearest_m)
    bands = (shows & np.isfinite(free.bearing_tan)).nonzero()[0]
    forward = free.nearest_m[bands]
    ahead = forward + mount.forward_m
    left = mount.left_m - forward * free.bearing_tan[bands]
    seen_m = np.where(shows, free.nearest_m, np.fmax(free.known_m, 0.0))
    points = floor_points(pose, ahead, left)
    return Surfaces(seen_m, bands, forward, forward * free.half_width_tan, points, noise)


def floor_points(pose: PlanarPose, ahead_m: FloatArray, left_m: FloatArray) -> FloatArray:
    """(..., 2) the floor points that lie ahead_m (...) and left_m (...) of a body at pose."""
    cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    points = np.empty((*ahead_m.shape, 2))
    points[..., 0] = pose.x_m + ahead_m * cos - left_m * sin
    points[..., 1] = pose.y_m + ahead_m * sin + left_m * cos
    return points


def bands_at(
    free: FreeSpace, pose: PlanarPose, mount: CameraMount, x_m: FloatArray, y_m: FloatArray
) -> tuple[FloatArray, NDArray[np.intp]]:
    """(...) each: how far ahead of the camera floor points x_m (...), y_m (...) lie, in metres, and in which
    band of free. A number that none of them has is beside the view; behind the camera it means nothing."""
    cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    dx, dy = x_m - pose.x_m, y_m - pose.y_m
    forward: FloatArray = dx * cos + dy * sin - mount.forward_m
    right = mount.left_m + dx * sin - dy * cos
    left_edge = free.bearing_tan[0] - free.half_width_tan
    band = np.floor((right / np.maximum(forward, 1e-3) - left_edge) / (2.0 * free.half_width_tan))
    return forward, band.astype(np.intp)
