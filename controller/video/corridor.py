"""The planned path as it is drawn: evenly spaced, with the edges of the corridor that the robot sweeps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controller.video.moment import VideoMoment
from hal.types import FloatArray

_STEP_M = 0.2


@dataclass(frozen=True, slots=True, eq=False)
class DrawnCorridor:
    """The path and the edges of the corridor.

    centre_m, left_m, right_m: (N, 2) in the body frame, nearest first.
    normal: (N, 2) unit vectors to the left of the path.
    """

    centre_m: FloatArray
    left_m: FloatArray
    right_m: FloatArray
    normal: FloatArray

    @property
    def outline_m(self) -> FloatArray:
        """The outline of the corridor, (2 N, 2)."""
        return np.concatenate([self.left_m, self.right_m[::-1]])

    def ribbon_m(self, half_width_m: float) -> FloatArray:
        """The outline of the path itself, (2 N, 2): filled, it looks smoother than a stroke of many
        pieces."""
        offset_m = self.normal * half_width_m
        return np.concatenate([self.centre_m + offset_m, (self.centre_m - offset_m)[::-1]])


def corridor_ahead(moment: VideoMoment, range_m: float) -> DrawnCorridor | None:
    """The corridor up to range_m along the path; None if no path is planned. An unknown width counts as
    zero."""
    path_m = moment.path_ahead_m
    if path_m is None or len(path_m) < 2:
        return None
    steps_m = np.hypot(*np.diff(path_m, axis=0).T)
    along_m = np.concatenate([[0.0], np.cumsum(steps_m)])
    length_m = min(float(along_m[-1]), range_m)
    if length_m <= 0.0:
        return None
    at_m = np.linspace(0.0, length_m, 2 + int(length_m / _STEP_M))
    centre_m = np.stack(
        [np.interp(at_m, along_m, path_m[:, 0]), np.interp(at_m, along_m, path_m[:, 1])], axis=1
    )
    forward = np.gradient(centre_m, at_m, axis=0)
    normal = np.stack([-forward[:, 1], forward[:, 0]], axis=1)
    normal /= np.maximum(np.hypot(normal[:, 0], normal[:, 1]), 1e-9)[:, np.newaxis]
    offset_m = normal * (moment.corridor_half_width_m or 0.0)
    return DrawnCorridor(centre_m, centre_m + offset_m, centre_m - offset_m, normal)
