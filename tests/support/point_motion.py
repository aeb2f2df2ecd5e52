"""What tests need to say of points that move before a camera."""

from __future__ import annotations

import numpy as np

from hal.types import FloatArray, Intrinsics


def static_miss(static_m: FloatArray, ray: FloatArray) -> FloatArray:
    """(N, 2) x' Z - X and y' Z - Y: how far, in metres at its depth, a point is from where it should be."""
    return ray * static_m[:, 2:3] - static_m[:, :2]


def project(points_m: FloatArray, camera: Intrinsics) -> FloatArray:
    """(N, 2) pixels of points (N, 3) before the camera."""
    focal, centre = np.array([camera.fx, camera.fy]), np.array([camera.cx, camera.cy])
    result: FloatArray = points_m[:, :2] / points_m[:, 2:] * focal + centre
    return result


def matrices(equations: FloatArray) -> FloatArray:
    """(N, 3, 3) symmetric matrices of normal equations (12, N)."""
    result: FloatArray = equations[np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])].transpose(2, 0, 1)
    return result
