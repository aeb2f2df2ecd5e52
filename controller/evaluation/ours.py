"""Our own detector and tracker among the methods."""

from __future__ import annotations

import math

import numpy as np

from config.perception import PerceptionConfig
from config.robot import Body
from controller.evaluation.types import CALLED_MOVING, Answer, DetectedObject
from hal.types import CameraMount, FloatArray, Pose, RgbdFrame
from vision.perception import Perception
from vision.scene import Fragments, Obstacle

# Half of the scale belongs to each verdict.
_ROOM = 1.0 - CALLED_MOVING
_DOUBT_SPEED_MPS = 0.1  # a speed of this size says as much against rest as one standard deviation


class Treadwatch:
    """vision.perception as a Method; keeps the last fragments for the pictures."""

    def __init__(self, config: PerceptionConfig, mount: CameraMount | None, body: Body) -> None:
        self._perception = Perception(config, mount, body.height_m, body.clearance_m)
        self.fragments: Fragments | None = None

    def observe(self, frame: RgbdFrame, odometry: Pose | None) -> Answer:
        percept = self._perception.perceive(frame, odometry, None)
        self.fragments = percept.fragments
        return Answer(tuple(detection_of(obstacle) for obstacle in percept.scene.obstacles))


def detection_of(obstacle: Obstacle) -> DetectedObject:
    """An obstacle as the scores take it."""
    return DetectedObject(
        obstacle.id,
        obstacle.bbox_px,
        obstacle.position_m,
        obstacle.velocity_mps,
        obstacle.extent_m,
        motion_confidence(obstacle),
    )


def motion_confidence(obstacle: Obstacle) -> float:
    """0..1 that the obstacle moves; CALLED_MOVING and above exactly where it is called moving.

    The score of an obstacle that is called moving is its confidence in that. Below the verdict the
    evidence is its velocity over ground by its own uncertainty, so that a precision-recall
    curve goes on beyond the working point.
    """
    if obstacle.moving:
        return CALLED_MOVING + _ROOM * min(max(obstacle.score, 0.0), 1.0)
    doubt = _velocity_sigmas(obstacle.velocity_mps, obstacle.velocity_cov)
    return CALLED_MOVING * 0.999 * (1.0 - math.exp(-0.5 * doubt))


def _velocity_sigmas(velocity: FloatArray, covariance: FloatArray) -> float:
    """How many standard deviations the velocity is away from rest; 0 where it is not known."""
    if not (np.isfinite(velocity).all() and np.isfinite(covariance).all()):
        return 0.0
    widened = covariance + np.eye(3) * _DOUBT_SPEED_MPS**2
    return math.sqrt(max(float(velocity @ np.linalg.solve(widened, velocity)), 0.0))
