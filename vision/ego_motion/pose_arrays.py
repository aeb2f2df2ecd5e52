"""Poses as arrays (3, 4), rotation and translation, for compiled steps (vision/ego_motion/robust_fit.py)."""

from __future__ import annotations

import math

import numpy as np

from hal.compiled import in_place, inlined
from hal.types import FloatArray, Pose


def as_array(pose: Pose) -> FloatArray:
    """(3, 4) rotation and translation of a pose."""
    result = np.empty((3, 4))
    result[:, :3], result[:, 3] = pose.rotation, pose.translation_m
    return result


@inlined
def moved(pose: FloatArray, step: FloatArray) -> FloatArray:
    """A pose (3, 4), rotation and translation, after a small motion step (6,) in its own axes."""
    x, y, z = step[0], step[1], step[2]
    angle = math.sqrt(x * x + y * y + z * z)
    result = pose.copy()
    for i in range(3):
        result[i, 3] += pose[i, 0] * step[3] + pose[i, 1] * step[4] + pose[i, 2] * step[5]
    if angle < 1e-15:
        return result
    # Rodrigues' formula.
    x, y, z, sine, cosine = x / angle, y / angle, z / angle, math.sin(angle), math.cos(angle)
    rest = 1.0 - cosine
    for i in range(3):
        a, b, c = pose[i, 0], pose[i, 1], pose[i, 2]
        along = rest * (a * x + b * y + c * z)
        result[i, 0] = cosine * a + along * x + sine * (b * z - c * y)
        result[i, 1] = cosine * b + along * y + sine * (c * x - a * z)
        result[i, 2] = cosine * c + along * z + sine * (a * y - b * x)
    return result


@inlined
def back_to(pose: FloatArray, start: FloatArray) -> FloatArray:
    """(6,) the small motion of a pose (3, 4) that leads back to start (3, 4)."""
    result, turn = np.zeros(6), np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            result[3 + i] += pose[j, i] * (start[j, 3] - pose[j, 3])
            for k in range(3):
                turn[i, j] += pose[k, i] * start[k, j]
    x, y, z = turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]
    sine = 0.5 * math.sqrt(x * x + y * y + z * z)
    angle = math.atan2(sine, 0.5 * (turn[0, 0] + turn[1, 1] + turn[2, 2] - 1.0))
    scale = 0.5 if sine < 1e-9 else 0.5 * angle / sine
    result[0], result[1], result[2] = x * scale, y * scale, z * scale
    return result


@in_place
def turned_back(pose: FloatArray, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A vector of the fixed frame in the axes of the camera."""
    return (
        pose[0, 0] * x + pose[1, 0] * y + pose[2, 0] * z,
        pose[0, 1] * x + pose[1, 1] * y + pose[2, 1] * z,
        pose[0, 2] * x + pose[1, 2] * y + pose[2, 2] * z,
    )


@in_place
def in_camera(pose: FloatArray, point_m: FloatArray) -> tuple[float, float, float]:
    """A point (3,) of the fixed frame in the camera frame."""
    return turned_back(pose, point_m[0] - pose[0, 3], point_m[1] - pose[1, 3], point_m[2] - pose[2, 3])
