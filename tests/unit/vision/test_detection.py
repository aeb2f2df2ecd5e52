"""What a frame tells of the camera's motion, as the scene reports it."""

from __future__ import annotations

import numpy as np
import pytest

from hal.types import Pose
from vision.detection import camera_motion_of
from vision.ego_motion.camera_motion import CameraEstimate
from vision.ego_motion.motion_prior import MotionPrior

STILL = Pose(np.eye(3), np.zeros(3))


def test_sigmas_are_of_rotation_and_translation_alone() -> None:
    """Not of the sweep of the rolling shutter, which comes after them: 1, 2, 2 mrad and 3, 4, 12 mm."""
    sigma = np.array([1e-3, 2e-3, 2e-3, 3e-3, 4e-3, 12e-3, 0.5, 0.5])
    nothing, unknown = np.zeros(2), np.full(2, np.inf)
    found = CameraEstimate(STILL, nothing, nothing, unknown, np.diag(sigma**2), 0.9, visual=True)
    ego = camera_motion_of(found, STILL, 0.033, MotionPrior(STILL, sigma[:6], "none")).ego
    assert ego.sigma_rotation_rad == pytest.approx(3e-3)
    assert ego.sigma_translation_m == pytest.approx(13e-3)
