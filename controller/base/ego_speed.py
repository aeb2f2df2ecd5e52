"""The robot's speed by the images alone, where no base reports it."""

from __future__ import annotations

import numpy as np

from hal.geometry import camera_in_body
from hal.types import CameraMount
from vision.scene import EgoMotion

_SPEED_FRAMES = 5  # the speed is the median of this many frames


class EgoSpeed:
    """Forward speed of the robot that carries the camera: the median over the last frames' ego-motion."""

    def __init__(self, mount: CameraMount | None) -> None:
        self._to_body = camera_in_body(mount or CameraMount(0.0, 0.0, 0.0, 0.0)).rotation
        self._recent_mps: list[float] = []

    def step(self, ego: EgoMotion) -> float:
        """The speed in m/s, never negative; 0 until something was measured."""
        if ego.source != "none" and ego.dt_s > 0.0:
            ahead_m = float((self._to_body @ ego.motion.translation_m)[0])
            self._recent_mps = [*self._recent_mps[1 - _SPEED_FRAMES :], ahead_m / ego.dt_s]
        return max(float(np.median(self._recent_mps)), 0.0) if self._recent_mps else 0.0
