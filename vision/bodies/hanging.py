"""Which tracks hang above the robot, which drives under them: they are not reported while they are static.

A track begins as hanging or not (vision/bodies/births.py). It hangs no longer once cells of it are seen below
the robot's height. It hangs again once nothing of it has been below that height for a while, and what is
measured next below its lower end is farther away all along it: a sign or a bar over the way is one part with
the post beside it, or with somebody behind it, for some frames. Below legs that give no depth, the floor is
measured next, and it is as near as they are.

vision/tracker.py calls it once the tracks have their cells. Terms: vision/__init__.py.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled
from vision.bodies.births import reaching_down
from vision.bodies.tracks import Tracks
from vision.depth.connected import MAX_JUMP, IntGrid
from vision.depth.depth_grid import BoolGrid, DepthGrid, FloatGrid

_ENDS_SHARE = 0.8  # of the columns; two legs take up more than the rest of the lower end of a coat
_FOR_S = 1.0  # as long as three steps, in which a leg behind the other one comes into view


def update(tracks: Tracks, grid: DepthGrid, labels: IntGrid, body_height_m: float, dt_s: float) -> None:
    """Update tracks.overhead by the cells labels (h, w), track index + 1, of a frame dt_s after the last one.

    body_height_m: the robot's. Without a known floor nothing hangs.
    """
    low = reaching_down(grid, labels, len(tracks), body_height_m)
    tracks.overhead &= ~low
    standing = ~(low | tracks.overhead | tracks.mover)
    if not np.count_nonzero(standing):
        tracks.ends_above_s[:] = 0.0
        return
    ends = standing & _ends_above(grid.inverse_depth, grid.beyond, labels, len(tracks), np.float32(MAX_JUMP))
    tracks.ends_above_s = np.where(ends, tracks.ends_above_s + dt_s, 0.0)
    tracks.overhead |= tracks.ends_above_s >= _FOR_S


@compiled("float32[:, ::1], boolean[:, ::1], int32[:, ::1], int64, float32")
def _ends_above(
    inverse: FloatGrid, beyond: BoolGrid, labels: IntGrid, count: int, jump: np.float32
) -> NDArray[np.bool_]:
    """(count,) below the lowest cells of which tracks something farther is measured first.

    In nearly all columns. jump: 1/m; less is the same surface.
    """
    rows, columns = labels.shape
    lowest, ends = np.zeros(count), np.zeros(count)
    seen = np.zeros((count, columns), np.bool_)
    below = np.full(columns, np.float32(np.inf))  # inverse depth of what is measured next below; inf: nothing
    for i in range(rows - 1, -1, -1):
        for j in range(columns):
            t = labels[i, j] - 1
            if t >= 0 and not seen[t, j]:
                seen[t, j] = True
                lowest[t] += 1
                ends[t] += below[j] < inverse[i, j] - jump
            if beyond[i, j] or inverse[i, j] > 0.0:
                below[j] = inverse[i, j]
    return (lowest > 0) & (ends >= _ENDS_SHARE * lowest)
