"""Anchored points all over the view, and where a camera sees them after a known motion."""

from __future__ import annotations

import numpy as np

from config.perception import EgoMotionSettings
from hal.types import FloatArray, Intrinsics, Pose
from tests.support.point_motion import project
from vision.camera.lens import rays, rotation_from_vector, vector_from_rotation
from vision.ego_motion.motion_prior import MotionPrior, SweepPrior, odometry_prior
from vision.ego_motion.reprojection import Anchors

CAMERA = Intrinsics(640, 480, 610.0, 610.0, 319.5, 239.5)
SETTINGS = EgoMotionSettings()
IDENTITY = Pose(np.eye(3), np.zeros(3))
DT_S = 1.0 / 30.0
GLOBAL_SHUTTER = SweepPrior(np.full(2, 1e-4), np.full(2, 1e-4))
# 0.6 m/s ahead with 0.3 rad/s of yaw and some vibration in pitch.
TRUE = Pose(rotation_from_vector(np.array([0.002, 0.010, -0.001])), np.array([0.001, -0.0005, 0.020]))


def anchors(count: int = 160, seed: int = 7) -> Anchors:
    """Points all over the view between 2 and 8 m, anchored by a camera in the origin."""
    rng = np.random.default_rng(seed)
    pixels = rng.uniform((20.0, 20.0), (620.0, 460.0), (count, 2))
    direction = rays(pixels, CAMERA)
    points = direction * rng.uniform(2.0, 8.0, count)[:, None]
    covariance = np.tile([0.02, 0.0, 0.02], (count, 1))
    return Anchors(
        points,
        direction,
        np.full(count, 0.02),
        covariance,
        np.ones(count, np.bool_),
        np.zeros(count, np.bool_),
    )


def seen(points_m: FloatArray, motion: Pose = TRUE, noise_px: float = 0.0) -> FloatArray:
    pixels = project(motion.inverse().apply(points_m), CAMERA)
    return pixels + noise_px * np.random.default_rng(1).standard_normal(pixels.shape)


def odometry(motion: Pose = TRUE) -> MotionPrior:
    """Dead reckoning knows no pitch and no roll."""
    level = vector_from_rotation(motion.rotation) * [0.0, 1.0, 0.0]
    return odometry_prior(Pose(rotation_from_vector(level), motion.translation_m), DT_S, SETTINGS)
