from __future__ import annotations

import numpy as np
import pytest

from hal.types import Intrinsics
from vision.camera.lens import rays, rotation_from_vector, vector_from_rotation

CAMERA = Intrinsics(640, 480, 600.0, 500.0, 320.0, 240.0)


def test_rays_by_numbers() -> None:
    result = rays(np.array([[320.0, 240.0], [620.0, 140.0]]), CAMERA)
    np.testing.assert_allclose(result, [[0.0, 0.0, 1.0], [0.5, -0.2, 1.0]])


def test_a_quarter_turn_about_each_axis() -> None:
    quarter = np.pi / 2
    about_z = rotation_from_vector(np.array([0.0, 0.0, quarter]))
    np.testing.assert_allclose(about_z @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-15)
    about_y = rotation_from_vector(np.array([0.0, quarter, 0.0]))
    np.testing.assert_allclose(about_y @ [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], atol=1e-15)


@pytest.mark.parametrize("angle_rad", [0.0, 1e-12, 1e-6, 0.1, 3.0])
def test_rotation_vectors_come_back_also_at_zero(angle_rad: float) -> None:
    vector = angle_rad * np.array([0.6, 0.0, -0.8])
    rotation = rotation_from_vector(vector)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(vector_from_rotation(rotation), vector, rtol=1e-9, atol=1e-15)
