"""Points and vectors between the inner and the outer frame of a pose (hal.types.Pose), for compiled steps.

For a camera's pose in the fixed frame, the inner frame is that of the camera, the outer one the fixed frame.
"""

from __future__ import annotations

from hal.compiled import inlined
from hal.types import FloatArray, Pose

Coordinates = tuple[float, float, float]


@inlined
def inner_vector(pose: Pose, vector: FloatArray) -> Coordinates:
    """The components of a vector (3,) of the outer frame along the axes of the inner one."""
    x, y, z = 0.0, 0.0, 0.0
    for i in range(3):
        x += pose.rotation[i, 0] * vector[i]
        y += pose.rotation[i, 1] * vector[i]
        z += pose.rotation[i, 2] * vector[i]
    return x, y, z


@inlined
def inner_point(pose: Pose, point_m: FloatArray) -> Coordinates:
    """The coordinates in the inner frame of a point (3,) of the outer one."""
    x, y, z = 0.0, 0.0, 0.0
    for i in range(3):
        offset_m = point_m[i] - pose.translation_m[i]
        x += pose.rotation[i, 0] * offset_m
        y += pose.rotation[i, 1] * offset_m
        z += pose.rotation[i, 2] * offset_m
    return x, y, z


@inlined
def outer_point(pose: Pose, point_m: FloatArray) -> Coordinates:
    """The coordinates in the outer frame of a point (3,) of the inner one."""
    x, y, z = pose.translation_m
    for i in range(3):
        x += pose.rotation[0, i] * point_m[i]
        y += pose.rotation[1, i] * point_m[i]
        z += pose.rotation[2, i] * point_m[i]
    return x, y, z
