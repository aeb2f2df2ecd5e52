"""The prior of vision/ego_motion/camera_motion.py: how the camera moved since the frame before, as known
before looking.

A prior has a mean (a Pose) and six standard deviations. From odometry: odometry_prior. Without odometry:
rolling_prior for a camera on a robot (a tracked base rolls ahead and turns, never sideways), steady_prior for
any other camera (it goes on as it did). A gyro (vision/camera/gyro.py) replaces the rotation of any of them:
with_gyro. The sweep, the camera's turn while the rows of one image are read, has its own: SweepPrior.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from config.perception import EgoMotionSettings
from hal.types import CameraMount, FloatArray, Pose
from vision.camera.lens import rotation_from_vector, vector_from_rotation

_ASIDE_MPS = 0.10  # one sigma across the way: vibration, and slip while it turns


@dataclass(frozen=True, slots=True, eq=False)
class MotionPrior:
    """What is known before looking: motion (the camera now in the camera before) and the standard
    deviation (6,) of a small motion of the camera now: rotation about, translation along x, y, z.
    binding: it is known that well, so that data which contradict it follow something large that moves."""

    motion: Pose
    sigma: FloatArray
    source: str
    binding: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class SweepPrior:
    """What is known of how far the camera turns about x and y while an image is read: one sigma of what is
    certain, sigma_rad (2,), and of what is possible, most_rad (2,)."""

    sigma_rad: FloatArray
    most_rad: FloatArray


def odometry_prior(motion: Pose, dt_s: float, settings: EgoMotionSettings) -> MotionPrior:
    """A prior from dead reckoning: good in translation, slipping in yaw, blind to vibration."""
    turn_rad = math.hypot(*vector_from_rotation(motion.rotation).tolist())
    way_m = math.hypot(*motion.translation_m.tolist())
    yaw = settings.odometry_yaw_ratio * turn_rad + settings.odometry_rotation_radps * dt_s
    tilt = settings.vibration_radps * dt_s + 0.1 * turn_rad
    way = settings.odometry_speed_ratio * way_m + settings.odometry_speed_mps * dt_s
    return MotionPrior(motion, np.array([tilt, yaw, tilt, way, way, way]), "odometry", True)


def steady_prior(last: Pose, last_dt_s: float, dt_s: float, settings: EgoMotionSettings) -> MotionPrior:
    """A prior where nothing else is known: the camera goes on as it did. last_dt_s 0: not even that."""
    known = last_dt_s > 0
    share = dt_s / last_dt_s if known else 0.0
    turn = rotation_from_vector(vector_from_rotation(last.rotation) * share)
    sigma = np.array([settings.steady_rotation_radps] * 3 + [settings.steady_speed_mps] * 3) * dt_s
    sigma *= 1.0 if known else settings.unknown_factor
    return MotionPrior(Pose(turn, last.translation_m * share), sigma, "none")


def rolling_prior(
    last: Pose, last_dt_s: float, dt_s: float, mount: CameraMount, settings: EgoMotionSettings
) -> MotionPrior:
    """A prior without odometry: the robot goes on ahead and turns as it did; last_dt_s 0: not even that.

    Across its way the camera moves only as the turn swings it around the turning centre, and it tilts
    only as far as it vibrates. What crosses the view therefore does not pass for the robot's own motion; nor
    does, since tracks gather and lose speed slowly, what goes ahead of it at its own pace.
    """
    known = last_dt_s > 0
    share = dt_s / last_dt_s if known else 0.0
    ahead = np.array([0.0, -math.sin(mount.pitch_rad), math.cos(mount.pitch_rad)])
    down = np.array([0.0, math.cos(mount.pitch_rad), math.sin(mount.pitch_rad)])
    turn_rad = share * float(vector_from_rotation(last.rotation) @ down)
    way_m = share * float(last.translation_m @ ahead)
    motion = Pose(
        rotation_from_vector(turn_rad * down), way_m * ahead + [mount.forward_m * turn_rad, 0.0, 0.0]
    )
    factor = 1.0 if known else settings.unknown_factor
    turn = settings.steady_rotation_radps * factor
    speed = settings.rolling_speed_mps if known else settings.steady_speed_mps * factor
    swing = abs(mount.forward_m) * turn
    sigma = np.array(
        [
            settings.vibration_radps,
            turn,
            settings.vibration_radps,
            math.hypot(_ASIDE_MPS, swing),
            math.hypot(_ASIDE_MPS, speed * math.sin(mount.pitch_rad)),
            speed,
        ]
    )
    return MotionPrior(motion, sigma * dt_s, "none", True)


def with_gyro(
    prior: MotionPrior, turn_rad: FloatArray, dt_s: float, settings: EgoMotionSettings
) -> MotionPrior:
    """The prior with its rotation taken from turn_rad (3,), what a gyro told of the interval dt_s."""
    sigma = prior.sigma.copy()
    sigma[:3] = settings.gyro_radps * dt_s
    motion = Pose(rotation_from_vector(turn_rad), prior.motion.translation_m)
    return MotionPrior(motion, sigma, prior.source, prior.binding)
