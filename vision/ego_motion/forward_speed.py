"""The robot's forward speed without odometry: a Kalman filter over the frames.

The prior of the camera's motion (vision/ego_motion/motion_prior.py) rests on it. The images of one frame
tell the speed to about 0.1 m/s. Where people who go ahead at the robot's own pace fill the view, they tell
another speed for some frames, to which a tracked robot cannot change so fast. Nor does it go backwards: where
the images say so, they have followed something that goes ahead.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from config.perception import EgoMotionSettings
from hal.types import CameraMount, FloatArray, Pose

_FRAME_SIGMA_MPS = 0.1  # of the speed by the images of one frame
_LEAST_SIGMA_MPS = 0.05  # of the prior: vibration
_BACKWARDS_MPS = 0.05  # vibration again: more is no longer that of a robot that stands


class ForwardSpeed(NamedTuple):
    """Speed along the robot's way, and its standard deviation, which is inf if nothing is known."""

    mps: float
    sigma_mps: float

    @property
    def is_backwards(self) -> bool:
        """Whether the robot would go backwards, which it never does."""
        return self.mps < -_BACKWARDS_MPS

    def later_sigma_mps(self, dt_s: float, settings: EgoMotionSettings) -> float:
        """Standard deviation if mps is still the speed dt_s later."""
        return max(math.hypot(self.sigma_mps, settings.rolling_accel_mps2 * dt_s), _LEAST_SIGMA_MPS)

    def seen(self, step: Pose, dt_s: float, mount: CameraMount, settings: EgoMotionSettings) -> ForwardSpeed:
        """The speed after a frame in which the images tell the camera's motion, step, within dt_s."""
        measured_mps = float(step.translation_m @ ahead(mount)) / dt_s
        if math.isinf(self.sigma_mps):
            return ForwardSpeed(measured_mps, _FRAME_SIGMA_MPS)
        variance = self.later_sigma_mps(dt_s, settings) ** 2
        gain = variance / (variance + _FRAME_SIGMA_MPS**2)
        return ForwardSpeed(self.mps + gain * (measured_mps - self.mps), math.sqrt(gain) * _FRAME_SIGMA_MPS)

    def unseen(self, dt_s: float, settings: EgoMotionSettings) -> ForwardSpeed:
        """The speed after a frame that tells nothing: all of it may have gone into one direction."""
        return ForwardSpeed(self.mps, self.sigma_mps + settings.rolling_accel_mps2 * dt_s)


UNKNOWN_SPEED = ForwardSpeed(0.0, math.inf)
FORWARDS = ForwardSpeed(0.5, 0.5)  # no more is known than that the robot goes ahead, from 0 to 1 m/s


def ahead(mount: CameraMount) -> FloatArray:
    """(3,) direction of the robot's way in the camera's axes."""
    return np.array([0.0, -math.sin(mount.pitch_rad), math.cos(mount.pitch_rad)])


def down(mount: CameraMount) -> FloatArray:
    """(3,) direction of the floor, which the robot turns around, in the camera's axes."""
    return np.array([0.0, math.cos(mount.pitch_rad), math.sin(mount.pitch_rad)])
