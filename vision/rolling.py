"""How a camera on a robot can move where nothing says how it did: tracks roll ahead and turn, never aside."""

from __future__ import annotations

import math

import numpy as np

from config.perception import EgoMotionSettings
from hal.types import CameraMount, Pose
from vision.ego_motion import MotionPrior
from vision.lens import rotation_from_vector, vector_from_rotation

_ASIDE_MPS = 0.10  # one sigma across the way: vibration, and slip while it turns


def rolling_prior(
    last: Pose, last_dt_s: float, dt_s: float, mount: CameraMount, settings: EgoMotionSettings
) -> MotionPrior:
    """A prior without odometry: the robot goes on ahead and turns as it did; last_dt_s 0: not even that.

    Across its way the camera moves only as the turn swings it around the turning centre, and it tilts
    only as far as it vibrates. What crosses the view therefore does not pass for the robot's own motion.
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
    speed = settings.steady_speed_mps * factor
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
