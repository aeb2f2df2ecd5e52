"""What the frames before tell of the camera's motion to the next one: chooses and feeds the prior of it."""

from __future__ import annotations

import numpy as np

from config.perception import EgoMotionSettings
from hal.types import CameraMount, FloatArray, Pose
from vision.camera.lens import vector_from_rotation
from vision.ego_motion.forward_speed import FORWARDS, UNKNOWN_SPEED, down
from vision.ego_motion.motion_prior import MotionPrior, odometry_prior, rolling_prior, steady_prior, with_gyro

_IDENTITY = Pose(np.eye(3), np.zeros(3))


class MotionMemory:
    """Keeps the last motion, the robot's speed, and the odometry of the last frame."""

    def __init__(self, mount: CameraMount | None, settings: EgoMotionSettings) -> None:
        self._mount = mount
        self._settings = settings
        self._last, self._last_dt_s = _IDENTITY, 0.0
        self._speed = UNKNOWN_SPEED
        self._odometry: Pose | None = None

    def prior(self, odometry: Pose | None, turn_rad: FloatArray | None, dt_s: float) -> MotionPrior:
        """Prior of the motion within the next dt_s.

        odometry: the camera by dead reckoning at the end. turn_rad (3,): rotation by a gyro. None where not
        known.
        """
        settings = self._settings
        if odometry is not None and self._odometry is not None:
            prior = odometry_prior(self._odometry.inverse() @ odometry, dt_s, settings)
        elif self._mount is not None:
            prior = self._rolling_prior(self._mount, turn_rad, dt_s)
        else:
            prior = steady_prior(self._last, self._last_dt_s, dt_s, settings)
        return prior if turn_rad is None else with_gyro(prior, turn_rad, dt_s, settings)

    def _rolling_prior(self, mount: CameraMount, turn_rad: FloatArray | None, dt_s: float) -> MotionPrior:
        if turn_rad is None:
            return rolling_prior(self._turn_radps(mount), self._speed, dt_s, mount, self._settings)
        turn_radps = float(turn_rad @ down(mount)) / dt_s
        return rolling_prior(turn_radps, self._speed, dt_s, mount, self._settings, self._settings.gyro_radps)

    def _turn_radps(self, mount: CameraMount) -> float | None:
        if self._last_dt_s == 0.0:
            return None
        return float(vector_from_rotation(self._last.rotation) @ down(mount)) / self._last_dt_s

    def refutes(self, step: Pose, dt_s: float, source: str) -> bool:
        """Whether step, which images without odometry tell of the last dt_s, takes a robot backwards.

        Then something has been followed that goes ahead of the robot. source: of the prior, as in EgoMotion.
        """
        if self._mount is None or source != "none":
            return False
        return self._speed.seen(step, dt_s, self._mount, self._settings).is_backwards

    def learn(self, step: Pose, dt_s: float, source: str) -> None:
        """Note the motion of a frame, step, within dt_s. source: as in EgoMotion."""
        self._last, self._last_dt_s = step, dt_s if source != "none" else 0.0
        if self._mount is None:
            return
        if source == "visual":
            self._speed = self._speed.seen(step, dt_s, self._mount, self._settings)
        else:
            self._speed = self._speed.unseen(dt_s, self._settings)

    def note_odometry(self, odometry: Pose | None) -> None:
        """Note the camera by dead reckoning in a frame that the next one will be compared with."""
        self._odometry = odometry

    def begin_again(self) -> None:
        """Forget a motion that was refuted: the robot goes ahead, at what speed is not known."""
        self.forget()
        self._speed = FORWARDS

    def forget(self) -> None:
        """Forget the motion, after a gap or a step back of time."""
        self._last, self._last_dt_s = _IDENTITY, 0.0
        self._speed = UNKNOWN_SPEED
