"""Pixels to rays and back (eqs. 3, 4 of Daeef 2020, with cx, cy for w/2, h/2), and rotation vectors."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled, inlined
from hal.types import FloatArray, Intrinsics

# Images and grids are float32, geometry is float64; functions that read both take either.
RealArray = NDArray[np.float32] | NDArray[np.float64]

MIN_AHEAD_M = 0.1  # nearer points do not count as in front of the camera: their projection is meaningless


def rays(pixels: RealArray, camera: Intrinsics) -> FloatArray:
    """(N, 3) points at z = 1 m behind pixels (N, 2)."""
    # Stored coordinate by coordinate, as the code that rotates or scales the rays reads them.
    result = np.empty((3, len(pixels)))
    result[0] = (pixels[:, 0] - camera.cx) / camera.fx
    result[1] = (pixels[:, 1] - camera.cy) / camera.fy
    result[2] = 1.0
    return result.T


@inlined
def ray_through(camera: Intrinsics, u: float, v: float) -> tuple[float, float]:
    """x and y at z = 1 of the ray through a pixel, for compiled steps."""
    return (u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy


@inlined
def pixel_of(camera: Intrinsics, x: float, y: float, z: float) -> tuple[float, float]:
    """The pixel where a point of the optical frame is seen, for compiled steps."""
    return x / z * camera.fx + camera.cx, y / z * camera.fy + camera.cy


@inlined
def row_delay(camera: Intrinsics, v: float) -> float:
    """When row v is read, in read-out times: -0.5 for the first row, 0.5 for the last; for compiled steps."""
    return v / camera.height - 0.5


def rotation_from_vector(vector_rad: FloatArray) -> FloatArray:
    """(3, 3) rotation about the axis of vector_rad by its length (Rodrigues' formula)."""
    rotation, _ = cv2.Rodrigues(vector_rad)
    return np.asarray(rotation, dtype=np.float64)


@compiled("float64[:, :]")
def vector_from_rotation(rotation: FloatArray) -> FloatArray:
    """(3,) axis times angle of a rotation of less than half a turn."""
    x = 0.5 * (rotation[2, 1] - rotation[1, 2])
    y = 0.5 * (rotation[0, 2] - rotation[2, 0])
    z = 0.5 * (rotation[1, 0] - rotation[0, 1])
    sine = math.sqrt(x * x + y * y + z * z)
    angle = math.atan2(sine, 0.5 * (rotation[0, 0] + rotation[1, 1] + rotation[2, 2] - 1.0))
    scale = 1.0 if sine < 1e-9 else angle / sine
    return np.array([x * scale, y * scale, z * scale])
