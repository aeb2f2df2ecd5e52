"""Our own detector and tracker, as one of the compared methods."""

from __future__ import annotations

import math

import numpy as np

from config.perception import PerceptionConfig
from config.robot import Body
from controller.evaluation.types import CALLED_MOVING, DetectedObject, MethodOutput
from hal.types import CameraMount, FloatArray, Pose, RgbdFrame
from vision.perception import Perception
from vision.scene import Fragments, Obstacle

# The part of the confidence scale for obstacles that are called moving.
_MOVING_CONFIDENCE_SPAN = 1.0 - CALLED_MOVING
_EXTRA_SIGMA_MPS = 0.1  # standard deviation whose square is added to the velocity's covariance


class Treadwatch:
    """vision.perception as a Method. fragments: those of the last frame, for the pictures."""

    def __init__(self, config: PerceptionConfig, mount: CameraMount | None, body: Body) -> None:
        self._perception = Perception(config, mount, body.height_m, body.clearance_m)
        self.fragments: Fragments | None = None

    def observe(self, frame: RgbdFrame, odometry: Pose | None) -> MethodOutput:
        percept = self._perception.perceive(frame, odometry, None)
        self.fragments = percept.fragments
        return MethodOutput(tuple(detection_of(obstacle) for obstacle in percept.scene.obstacles))


def detection_of(obstacle: Obstacle) -> DetectedObject:
    """An obstacle as a detection for the scores."""
    return DetectedObject(
        obstacle.id,
        obstacle.bbox_px,
        obstacle.position_m,
        obstacle.velocity_mps,
        obstacle.extent_m,
        motion_confidence(obstacle),
    )


def motion_confidence(obstacle: Obstacle) -> float:
    """Confidence 0..1 that the obstacle moves; CALLED_MOVING or more exactly if it is called moving.

    For an obstacle that is called moving, it follows from the obstacle's score. For all others, it follows
    from the velocity over ground divided by its uncertainty, so that the precision-recall curve goes on
    beyond the operating point.
    """
    if obstacle.moving:
        return CALLED_MOVING + _MOVING_CONFIDENCE_SPAN * min(max(obstacle.score, 0.0), 1.0)
    sigmas = _velocity_sigmas(obstacle.velocity_mps, obstacle.velocity_cov)
    return CALLED_MOVING * 0.999 * (1.0 - math.exp(-0.5 * sigmas))


def _velocity_sigmas(velocity: FloatArray, covariance: FloatArray) -> float:
    """How many standard deviations the velocity is away from zero; 0 if it is not known."""
    if not (np.isfinite(velocity).all() and np.isfinite(covariance).all()):
        return 0.0
    inflated = covariance + np.eye(3) * _EXTRA_SIGMA_MPS**2
    return math.sqrt(max(float(velocity @ np.linalg.solve(inflated, velocity)), 0.0))
