"""How near the camera measures the floor: nearer, rows without depth tell of the camera, not of the floor.

Stereo and time-of-flight have a least depth, 0.3 to 0.5 m, often more than the data sheet says. A camera that
is low or looks far down has floor nearer than that in its lowest rows, which are never anything but a hole.
What the rows have shown so far tells where that ends. Fail closed: only close before the camera, only rows in
which hardly ever floor was seen, and only cells without any data; a drop that is measured is a hole.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray
from vision.depth.depth_grid import DepthGrid

FLOOR_EXCESS = 1.35  # a ray that goes this much farther than the floor has found a hole in it
_NEVER_BEYOND_M = 0.6  # farther away it has another reason; sight.near_m of the decision reaches farther
_MARGIN = 1.15  # the least depth is no sharp line, and the robot shakes
_SHARE = 0.25  # of a row's cells: so many have to show floor
_FRAMES_SHARE = 0.1  # so often; a bump, after which the lowest rows look farther, is much shorter
_FRAMES = 900  # of which that is a share: hours before a pallet are not counted against the floor behind it


def floor_depth_m(grid: DepthGrid) -> FloatArray:
    """(h,) depth at which the rows of grid meet the floor, inf above the horizon. Its mounting is known."""
    drop = grid.y * math.cos(grid.pitch_rad) + math.sin(grid.pitch_rad)
    with np.errstate(divide="ignore"):
        return np.where(drop > 0.0, grid.camera_height_m / np.maximum(drop, 0.0), np.inf).astype(float)


class NearFloor:
    """Looks at the lowest rows of each frame. Keeps how often each of them has shown floor."""

    def __init__(self, min_depth_m: float) -> None:
        """min_depth_m: what is nearer is not valid in the grid."""
        self._most_m = max(_NEVER_BEYOND_M, _MARGIN * min_depth_m)
        self._of: tuple[float, float, int] | None = None
        self._depth_m: FloatArray = np.empty(0)
        self._limit_m = np.empty((0, 1), np.float32)
        self._shown: NDArray[np.int64] = np.empty(0, np.int64)
        self._frames = 0

    def unmeasured_m(self, grid: DepthGrid, trusted: bool) -> float:
        """Floor whose depth is less than this may have no data; 0.0 where the lowest row has shown floor.
        trusted: what grid shows is to be learnt from."""
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
