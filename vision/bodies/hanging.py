"""Which tracks hang above the robot, which drives under them: they are not reported while they are static.

A track begins as hanging or not (vision/bodies/births.py). It hangs no longer once cells of it are seen below
the robot's height. It hangs again once nothing of it has been below that height for a while, and what is
measured next below its lower end is farther away all along it: a sign or a bar over the way is one part with
the post beside it, or with somebody behind it, for some frames. Below legs that give no depth, the floor is
measured next, and it is as near as they are. What the left or right border of the image cuts is not judged:
there the legs of a table leave the view when the robot stands before it.

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
from vision.depth.regions import Regions

_ENDS_SHARE = 0.8  # of the columns: in the others something nearer hides its end, or depth is missing
_LEG_COLUMNS = 3  # adjacent ones in which it stands: a leg of 5 cm, 2.5 m away with the camera of sim.yaml
_FOR_S = 1.0  # as long as three steps, in which a leg behind the other one comes into view


def update(
    tracks: Tracks, grid: DepthGrid, labels: IntGrid, measured: Regions, body_height_m: float, dt_s: float
) -> None:
    """Update tracks.overhead by the cells labels (h, w), track index + 1, of a frame dt_s after the last one.

    measured: the regions of the tracks. body_height_m: the robot's. Without a known floor nothing hangs.
    """
    low = reaching_down(grid, labels, len(tracks), body_height_m)
    tracks.overhead &= ~low
    asked = (measured.cells > 0) & measured.sides_visible & ~(low | tracks.overhead | tracks.mover)
    if not np.count_nonzero(asked):
        tracks.ends_above_s[:] = 0.0
        return
    boxes = (measured.bbox_px / grid.step_px).astype(np.intp)
    ends = _ends_above(grid.inverse_depth, grid.beyond, labels, asked, boxes, np.float32(MAX_JUMP))
    tracks.ends_above_s = np.where(ends, tracks.ends_above_s + dt_s, 0.0)
    tracks.overhead |= tracks.ends_above_s >= _FOR_S


@compiled("float32[:, ::1], boolean[:, ::1], int32[:, ::1], boolean[::1], int64[:, ::1], float32")
def _ends_above(
    inverse: FloatGrid,
    beyond: BoolGrid,
    labels: IntGrid,
    asked: NDArray[np.bool_],
    boxes: NDArray[np.intp],
    jump: np.float32,
) -> NDArray[np.bool_]:
    """(T,) below the lowest cells of which of the tracks asked for (T,) something farther is measured first.

    In nearly all columns. boxes (T, 4): first column and row, last column and row or more. jump: 1/m; less is
    the same surface.
    """
    rows, columns = labels.shape
    ends = np.zeros(len(asked), np.bool_)
    for t in range(len(asked)):
        if not asked[t]:
            continue
        lowest, ending, standing = 0, 0, 0  # standing: adjacent columns with something as near below
        for j in range(max(boxes[t, 0], 0), min(boxes[t, 2] + 1, columns)):
            i = min(boxes[t, 3], rows - 1)
            while i >= 0 and labels[i, j] != t + 1:
                i -= 1
            if i < 0:
                continue
            lowest += 1
            k = i + 1
            while k < rows and not (beyond[k, j] or inverse[k, j] > 0.0):
                k += 1
            nearer = inverse[k, j] - inverse[i, j] if k < rows else np.float32(np.inf)
            ending += int(nearer < -jump)
            standing = standing + 1 if abs(nearer) <= jump else 0
            if standing == _LEG_COLUMNS:
                break
        ends[t] = standing < _LEG_COLUMNS and ending >= max(_ENDS_SHARE * lowest, 1.0)
    return ends
