"""The minimum distance at which the camera can measure the floor, learned from the frames.

Stereo and time-of-flight cameras have a minimum depth of 0.3 to 0.5 m, often more than the data sheet says. A
camera that is low or looks far down has floor nearer than that in its lowest rows. These rows never have
data, which does not mean that there is a hole in the floor. How often each row has shown floor so far tells
where the floor begins to be measurable.

Fail closed: missing data is excused only close in front of the camera, only in rows that have hardly ever
shown floor, and only in cells without any data. A drop that is measured is always a hole
(vision/depth/free_space.py).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray
from vision.depth.depth_grid import DepthGrid, floor_ray

FLOOR_EXCESS = 1.35  # a depth of more than this times that of the floor is a hole in it
# Maximum depth at which missing data is excused; farther away it has another reason. sight.near_m of the
# decision reaches farther.
_NEVER_BEYOND_M = 0.6
_MARGIN = 1.15  # on the nearest measured depth: the minimum depth is no sharp limit, and the robot shakes
_SHARE = 0.25  # a row shows floor if at least this share of its cells do
# A row counts as measurable if it shows floor in more than this share of the frames. A bump, after which the
# lowest rows look farther, takes a much smaller share.
_FRAMES_SHARE = 0.1
# After this many frames the counts are halved, so that hours in front of a pallet do not outweigh the floor
# that is seen afterwards.
_FRAMES = 900


def floor_depth_m(grid: DepthGrid) -> FloatArray:
    """(h,) depth at which the rows of grid meet the floor, inf above the horizon. Needs a known mounting."""
    _, drop = floor_ray(grid.y, grid.pitch_rad)
    with np.errstate(divide="ignore"):
        return np.where(drop > 0.0, grid.camera_height_m / np.maximum(drop, 0.0), np.inf).astype(float)


class NearFloor:
    """Counts in how many frames each of the lowest rows has shown floor."""

    def __init__(self, min_depth_m: float) -> None:
        """min_depth_m: nearer depths are not valid in the grid."""
        self._most_m = max(_NEVER_BEYOND_M, _MARGIN * min_depth_m)
        self._of: tuple[float, float, int] | None = None
        self._depth_m: FloatArray = np.empty(0)
        self._limit_m = np.empty((0, 1), np.float32)
        self._shown: NDArray[np.int64] = np.empty(0, np.int64)
        self._frames = 0

    def measurable_from_m(self, grid: DepthGrid, trusted: bool) -> float:
        """Depth up to which the floor may have no data; 0.0 if the lowest row has shown floor.

        trusted: the frame is used for learning.
        """
        view = (grid.camera_height_m, grid.pitch_rad, len(grid.y))
        if view != self._of:
            self._begin(grid, view)
        rows = len(self._depth_m)
        if rows == 0:
            return 0.0
        low = slice(len(grid.y) - rows, None)
        if trusted:
            floor = grid.valid[low] & (grid.depth_m[low] <= self._limit_m)
            self._shown += np.count_nonzero(floor, axis=1) >= _SHARE * floor.shape[1]
            self._frames += 1
            if self._frames >= _FRAMES:
                self._shown, self._frames = self._shown // 2, self._frames // 2
        often = (self._shown > _FRAMES_SHARE * self._frames).nonzero()[0]
        if len(often) == 0:
            return self._most_m
        return 0.0 if often[-1] == rows - 1 else min(_MARGIN * float(self._depth_m[often[-1]]), self._most_m)

    def _begin(self, grid: DepthGrid, view: tuple[float, float, int]) -> None:
        self._of = view
        near = np.empty(0)
        if math.isfinite(grid.pitch_rad):
            near = floor_depth_m(grid)
            near = near[near <= self._most_m]
        self._depth_m, self._limit_m = near, (FLOOR_EXCESS * near[:, None]).astype(np.float32)
        self._shown, self._frames = np.zeros(len(near), np.int64), 0
