"""Points and vectors between the frames of a pose, against the arithmetic of hal.types.Pose."""

from __future__ import annotations

import numpy as np

from hal.compiled import compiled
from hal.types import FloatArray, Pose
from vision.camera.lens import rotation_from_vector
from vision.numerics.pose_axes import Coordinates, inner_point, inner_vector, outer_point

POSE = Pose(rotation_from_vector(np.array([0.3, -0.7, 1.1])), np.array([1.0, -2.0, 0.5]))
POINT = np.array([0.4, 3.0, -1.5])


@compiled(Pose, "float64[:]")
def _all(pose: Pose, point_m: FloatArray) -> tuple[Coordinates, Coordinates, Coordinates]:
    return inner_vector(pose, point_m), inner_point(pose, point_m), outer_point(pose, point_m)


def test_vector_is_rotated_into_the_inner_frame() -> None:
    vector, _, _ = _all(POSE, POINT)
    np.testing.assert_allclose(vector, POSE.rotation.T @ POINT, rtol=1e-12)


def test_point_is_moved_into_the_inner_frame_and_back() -> None:
    _, inner, _ = _all(POSE, POINT)
    np.testing.assert_allclose(inner, POSE.inverse().apply(POINT), rtol=1e-12)
    _, _, outer = _all(POSE, np.array(inner))
    np.testing.assert_allclose(outer, POINT, rtol=1e-12)
