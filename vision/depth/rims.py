"""Free rims: where a part ends in front of something farther, so that the end is its own outline.

Where a part ends beside something nearer, the end is the outline of what hides it. Such an end moves with
what is in front and tells nothing of the part. Used after the cells have been labelled;
vision/bodies/rim_motion.py measures with the rims how fast a half hidden body goes sideways.
Terms (cell, part): vision/__init__.py.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled, in_place
from hal.records import record
from hal.types import FloatArray, Matrix
from vision.depth.connected import IntGrid
from vision.depth.depth_grid import DepthGrid

LEFT, RIGHT = 0, 1
NO_RIM = -1
# Beside a nearer surface a stereo camera measures nothing in a band whose width is the difference of the two
# disparities: 24 px for a surface 1.3 m away (baseline 5 cm, focal length 611 px), less farther away. So what
# hides a part begins within this many cells of its rim. No depth for longer means that the view goes on
# behind the part: beyond the range, or on to a wall without texture.
_SHADOW_CELLS = 6
# The depth camera may see less than the colour camera: a Kinect's depth ends 7 % before either side.
_BAND_SHARE = 0.125
_FARTHER = 0.012  # 1/m: three standard deviations of the depth of a cell, or 0.3 m at 5 m


@record(frozen=True, slots=True, eq=False)
class FreeRims:
    """The free rims of R parts, LEFT and RIGHT of each.

    column: of the outermost cell in each row; NO_RIM where the part has no cell, or is not free on that side,
        (R, 2, h).
    inverse: mean inverse depth of each rim, 1/m; 0 where there is none, (R, 2).
    """

    column: Annotated[NDArray[np.int32], "int32[:, :, ::1]"]
    inverse: Matrix


def free_rims(grid: DepthGrid, labels: IntGrid, count: int) -> FreeRims:
    """The free rims of the parts 1..count of labels (h, w)."""
    return FreeRims(*_free_rims(grid, labels, count))


@in_place
def _outermost(grid: DepthGrid, border: int, inwards: int) -> int:
    """The column at which the view of the depth camera ends; border, a side of the image, or further inwards.

    The view ends beside columns without any depth if these are a narrow band. A wide one is an empty part of
    the scene.
    """
    width = grid.inverse_depth.shape[1]
    for band in range(int(_BAND_SHARE * width) + 1):
        j = border + inwards * band
        if grid.inverse_depth[:, j].any() or grid.beyond[:, j].any():
            return j
    return border


@in_place
def _is_free(
    grid: DepthGrid, row: int, rim: int, outwards: int, farthest: np.float32, first: int, last: int
) -> bool:
    """Whether what is next beside the cell at rim is farther, or too far away to be measured.

    outwards: -1 for a left rim, 1 for a right one. farthest: 1/m, at the end of the range. first, last: where
    the view of the depth camera ends; its border moves with the camera, and what is cut there with it.
    """
    j = rim
    for _ in range(_SHADOW_CELLS):
        j += outwards
        if j < first or j > last:
            return False
        beside = farthest if grid.beyond[row, j] else grid.inverse_depth[row, j]
        if beside > 0.0:
            return bool(grid.inverse_depth[row, rim] - beside > np.float32(_FARTHER))
    return True


@compiled(DepthGrid, "int32[:, ::1], int64")
def _free_rims(grid: DepthGrid, labels: IntGrid, count: int) -> tuple[NDArray[np.int32], FloatArray]:
    """The fields of FreeRims."""
    farthest = np.float32(1.0 / grid.range_m)
    height, width = labels.shape
    column = np.full((count, 2, height), NO_RIM, np.int32)
    sums, rows = np.zeros((count, 2)), np.zeros((count, 2))
    latest = np.empty(count, np.int32)  # the last cell of each part in this row; NO_RIM before its first
    first, last = _outermost(grid, 0, 1), _outermost(grid, width - 1, -1)
    for i in range(height):
        latest[:] = NO_RIM
        before = 0
        for j in range(width):
            here = labels[i, j]
            if here == before:
                continue
            if 0 < before <= count:
                latest[before - 1] = j - 1
            if 0 < here <= count and latest[here - 1] == NO_RIM:
                column[here - 1, LEFT, i] = j
            before = here
        if 0 < before <= count:
            latest[before - 1] = width - 1
        for part in range(count):
            column[part, RIGHT, i] = latest[part]
            for side in range(2):
                rim = column[part, side, i]
                if rim == NO_RIM:
                    continue
                if _is_free(grid, i, rim, 2 * side - 1, farthest, first, last):
                    sums[part, side] += grid.inverse_depth[i, rim]
                    rows[part, side] += 1.0
                else:
                    column[part, side, i] = NO_RIM
    return column, sums / np.maximum(rows, 1.0)
