"""Priors of the camera's motion since the frame before, for vision/ego_motion/camera_motion.py.

A prior has a mean (a Pose) and six standard deviations. It does not depend on the present image.

* odometry_prior: from odometry.
* rolling_prior: without odometry, for a camera on a robot. A tracked base moves forward and turns, but never
  moves sideways.
* steady_prior: without odometry, for any other camera. Its motion continues as before.
* with_gyro: replaces the rotation of any of these by that of a gyro (vision/camera/gyro.py).
* SweepPrior: prior of the sweep, the camera's rotation while the rows of one image are read.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from config.perception import EgoMotionSettings
from hal.records import record
from hal.types import CameraMount, FloatArray, Pose
from vision.camera.lens import rotation_from_vector, vector_from_rotation
from vision.ego_motion.forward_speed import ForwardSpeed, ahead, down

_STEADY_RADPS = 0.02  # added to what slip explains of a turn: noise of the turn that the images tell
_SIDEWAYS_MPS = 0.10  # one sigma across the direction of travel: vibration, and slip while turning


@record(frozen=True, slots=True, eq=False)
class MotionPrior:
    """Prior of the camera's motion.

    motion: the camera now, in the camera frame before.
    sigma: standard deviations of a small motion of the camera now: rotation about x, y, z, then translation
        along x, y, z, (6,).
    source: "odometry" or "none"; see EgoMotion.
    trusted: so reliable that image data which contradict it must have followed something large that moves.
    slip_rad: how far the turn about y may differ because tracks slip, or a gyro drifts; inf: nothing but the
        images tells the turn.
    """

    motion: Pose
    sigma: FloatArray
    source: str
    trusted: bool = False
    slip_rad: float = math.inf

    @property
    def knows_turn(self) -> bool:
        """Whether odometry or a gyro tells the turn, which one body in view must not overrule."""
        return math.isfinite(self.slip_rad)


@record(frozen=True, slots=True, eq=False)
class SweepPrior:
    """Prior of how far the camera turns about x and y while an image is read; its mean is 0.

    sigma_rad (2,): one sigma of the sweep that is certain. max_rad (2,): one sigma of the sweep that is
    possible.
    """

    sigma_rad: FloatArray
    max_rad: FloatArray


def odometry_prior(motion: Pose, dt_s: float, settings: EgoMotionSettings) -> MotionPrior:
    """A prior from dead reckoning: good in translation, subject to slip in yaw, blind to vibration."""
    turn_rad = math.hypot(*vector_from_rotation(motion.rotation).tolist())
    displacement_m = math.hypot(*motion.translation_m.tolist())
    slip_rad = settings.odometry_yaw_ratio * turn_rad
    yaw = slip_rad + settings.odometry_rotation_radps * dt_s
    tilt = settings.vibration_radps * dt_s + 0.1 * turn_rad
    way = settings.odometry_speed_ratio * displacement_m + settings.odometry_speed_mps * dt_s
    sigma = np.array([tilt, yaw, tilt, way, way, way])
    return MotionPrior(motion, sigma, "odometry", trusted=True, slip_rad=slip_rad + _STEADY_RADPS * dt_s)


def steady_prior(last: Pose, last_dt_s: float, dt_s: float, settings: EgoMotionSettings) -> MotionPrior:
    """A prior of constant velocity, where nothing else is known.

    last, last_dt_s: the last motion and its duration; last_dt_s is 0 if it is not known.
    """
    known = last_dt_s > 0
    share = dt_s / last_dt_s if known else 0.0
    turn = rotation_from_vector(vector_from_rotation(last.rotation) * share)
    sigma = np.array([settings.steady_rotation_radps] * 3 + [settings.steady_speed_mps] * 3) * dt_s
    sigma *= 1.0 if known else settings.unknown_factor
    return MotionPrior(Pose(turn, last.translation_m * share), sigma, "none")


def rolling_prior(
    turn_radps: float | None,
    speed: ForwardSpeed,
    dt_s: float,
    mount: CameraMount,
    settings: EgoMotionSettings,
    turn_sigma_radps: float | None = None,
) -> MotionPrior:
    """A prior without odometry: the robot keeps its forward speed and its rate of turn.

    Sideways the camera moves only as a turn swings it around the turning centre, and it tilts only by
    vibration. Therefore something that crosses the view is not taken for the robot's own motion. Nor is
    something that moves ahead of the robot at its own speed, since a tracked robot changes its speed slowly.
    turn_radps: rate of turn in the frame before, None if it is not known. speed: of the robot then.
    turn_sigma_radps: standard deviation of turn_radps where a gyro measured it now.
    """
    turn_rad = 0.0 if turn_radps is None else turn_radps * dt_s
    swing_m = np.array([mount.forward_m * turn_rad, 0.0, 0.0])
    motion = Pose(rotation_from_vector(turn_rad * down(mount)), speed.mps * dt_s * ahead(mount) + swing_m)
    factor = settings.unknown_factor
    sigma_radps = settings.steady_rotation_radps * (factor if turn_radps is None else 1.0)
    if turn_sigma_radps is not None:
        sigma_radps = turn_sigma_radps
    sigma_mps = min(speed.later_sigma_mps(dt_s, settings), settings.steady_speed_mps * factor)
    sigma = np.array(
        [
            settings.vibration_radps,
            sigma_radps,
            settings.vibration_radps,
            math.hypot(_SIDEWAYS_MPS, mount.forward_m * sigma_radps),
            math.hypot(_SIDEWAYS_MPS, sigma_mps * math.sin(mount.pitch_rad)),
            sigma_mps,
        ]
    )
    return MotionPrior(motion, sigma * dt_s, "none", trusted=True)


def with_gyro(
    prior: MotionPrior, turn_rad: FloatArray, dt_s: float, settings: EgoMotionSettings
) -> MotionPrior:
    """The prior with its rotation replaced by turn_rad (3,), which a gyro measured over the interval dt_s.

    A gyro does not slip, so a turn of the images that differs from it is an error of one of the two.
    """
    sigma = prior.sigma.copy()
    sigma[:3] = settings.gyro_radps * dt_s
    motion = Pose(rotation_from_vector(turn_rad), prior.motion.translation_m)
    return replace(prior, motion=motion, sigma=sigma, slip_rad=settings.gyro_radps * dt_s)
