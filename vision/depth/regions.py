"""Regions: box, centre and size of each labelled set of cells (part).

Used for connected parts (vision/depth/connected.py) and for the surfaces of tracks. Terms (cell, part,
region): vision/__init__.py.
"""

from __future__ import annotations

import math

import numpy as np

from hal.compiled import compiled, inlined
from hal.records import record
from hal.types import Flags, FloatArray, Integers, Matrix
from vision.depth.connected import IntGrid
from vision.depth.depth_grid import DepthGrid, FloatGrid

_UNIFORM = 3.46  # the length of a uniform distribution in standard deviations: square root of 12
# A part this close to the floor, in metres and per metre of depth, stands on it: the lowest part of a body is
# taken for floor because of the clearance and the margins of above_floor().
_FOOT_M, _FOOT_PER_METRE = 0.12, 0.015
_RIM = 8  # the rim of a part on either side is 1/8 of its columns


@record(frozen=True, slots=True, eq=False)
class Regions:
    """Measures of R labelled parts of the grid. An entry without cells has cells == 0.

    cells: number of cells, (R,).
    rows: number of rows from its first to its last cell, (R,).
    bbox_px: box in the image, u0, v0, u1, v1, (R, 4).
    position_m: centre of the visible surface in the camera axes, (R, 3).
    extent_m: size along the camera axes, (R, 3).
    sides_visible: not cut by the left or right border of the image, (R,). See also vision/depth/occlusion.py.
    top_and_bottom_visible: not cut by its upper or lower border, (R,).
    overlapped: something nearer begins at its left or right rim, (R,).
    """

    cells: Integers
    rows: Integers
    bbox_px: Matrix
    position_m: Matrix
    extent_m: Matrix
    sides_visible: Flags
    top_and_bottom_visible: Flags
    overlapped: Flags

    @property
    def whole(self) -> Flags:
        """(R,) parts that are cut on no side and not hidden in part by something nearer."""
        return self.sides_visible & self.top_and_bottom_visible & ~self.overlapped


def exchanged(regions: Regions, others: Regions, chosen: Flags) -> Regions:
    """regions with the chosen (R,) entries taken from others."""
    return Regions(
        cells=np.where(chosen, others.cells, regions.cells),
        rows=np.where(chosen, others.rows, regions.rows),
        bbox_px=np.where(chosen[:, None], others.bbox_px, regions.bbox_px),
        position_m=np.where(chosen[:, None], others.position_m, regions.position_m),
        extent_m=np.where(chosen[:, None], others.extent_m, regions.extent_m),
        sides_visible=np.where(chosen, others.sides_visible, regions.sides_visible),
        top_and_bottom_visible=np.where(
            chosen, others.top_and_bottom_visible, regions.top_and_bottom_visible
        ),
        overlapped=np.where(chosen, others.overlapped, regions.overlapped),
    )


def measure(grid: DepthGrid, labels: IntGrid, count: int) -> Regions:
    """Regions of the parts 1..count of labels (h, w); entry k - 1 is part k.

    sides_visible accounts for the image border only, and overlapped is False: vision/depth/occlusion.py adds
    what hides a part.
    """
    up, height_m = (np.zeros(3), np.nan) if grid.up is None else (grid.up, grid.camera_height_m)
    return Regions(*_measured(grid, labels, count, up, height_m), overlapped=np.zeros(count, np.bool_))


@inlined
def _runs_of(labels: IntGrid, count: int) -> IntGrid:
    """(K, 4) runs of cells of one of the parts 1..count of labels (h, w) that lie side by side in a row.

    Of each: the part's index, the row, the first column, and the one after the last.
    """
    height, width = labels.shape
    runs, number = np.empty((labels.size, 4), np.int32), 0
    for i in range(height):
        before = 0
        for j in range(width):
            here = labels[i, j]
            if here == before:
                continue
            if 0 < before <= count:
                runs[number, 3] = j
                number += 1
            if 0 < here <= count:
                runs[number, 0], runs[number, 1], runs[number, 2] = here - 1, i, j
            before = here
        if 0 < before <= count:
            runs[number, 3] = width
            number += 1
    return runs[:number]


@inlined
def _edges(runs: IntGrid, count: int) -> tuple[Integers, Integers]:
    """(R,) number of cells of each part with runs (K, 4), and (R, 4) their left, top, right, bottom.

    These are columns and rows of the grid; 0, 0, 0, -1 for parts without cells.
    """
    cells, edges = np.zeros(count, np.intp), np.zeros((count, 4), np.intp)
    edges[:, 3] = -1
    for part, row, first, end in runs:
        edge = edges[part]
        if cells[part] == 0:
            edge[0], edge[1], edge[2] = first, row, first
        cells[part] += end - first
        edge[0], edge[2], edge[3] = min(edge[0], first), max(edge[2], end - 1), row
    return cells, edges


@inlined
def _foot_px(
    grid: DepthGrid, up: FloatArray, height_m: float, middle_x: float, depth_m: float, bottom: int
) -> float:
    """Image row where a part that nearly reaches the floor stands on it; -inf for other parts.

    The lowest hand's breadth of a body is taken for floor, because of the noise of depth. up (3,): the
    floor's normal. height_m: of the camera. middle_x: ray x of the part's middle. bottom: its last row.
    """
    y, step_px = grid.y, grid.step_px
    # On the floor: camera height = - up . ray * depth.
    floor_y = (-height_m / depth_m - up[2] - up[0] * middle_x) / up[1]
    if not (floor_y - y[bottom]) * depth_m <= _FOOT_M + _FOOT_PER_METRE * depth_m:
        return -np.inf
    row = float((floor_y - y[0]) / (y[1] - y[0])) * step_px + grid.offset_px
    return min(row, grid.offset_px + (len(y) - 0.5) * step_px)


@inlined
def _sums(
    inverse: FloatGrid, runs: IntGrid, x: FloatGrid, y: FloatGrid, edges: Integers
) -> tuple[FloatArray, FloatArray]:
    """Sums over each part with runs (K, 4) and edges (R, 4), (R, 4): inverse depth, its square, x, y.

    And sums over its left and over its right rim, (R, 4): cells, inverse depth. The width is measured with
    each rim at its own depth, since a body seen along one of its sides would seem too wide at the depth of
    its middle.
    """
    count = len(edges)
    sums, rims = np.zeros((count, 4)), np.zeros((count, 4))
    for part, row, first, end in runs:
        left, right = edges[part, 0], edges[part, 2]
        rim = (right - left) // _RIM
        total, squares, total_x, total_y = sums[part]
        for j in range(first, end):
            value = float(inverse[row, j])
            total += value
            squares += value * value
            total_x += x[j]
            total_y += y[row]
        sums[part] = total, squares, total_x, total_y
        for j in range(first, min(end, left + rim + 1)):
            rims[part, 0] += 1.0
            rims[part, 1] += inverse[row, j]
        for j in range(max(first, right - rim), end):
            rims[part, 2] += 1.0
            rims[part, 3] += inverse[row, j]
    return sums, rims


@compiled(DepthGrid, "int32[:, ::1], int64, float64[::1], float64")
def _measured(
    grid: DepthGrid, labels: IntGrid, count: int, up: FloatArray, height_m: float
) -> tuple[Integers, Integers, FloatArray, FloatArray, FloatArray, Flags, Flags]:
    """cells and rows (R,), bbox_px (R, 4), position_m and extent_m (R, 3), sides_visible and
    top_and_bottom_visible (R,) of the parts.

    height_m: of the camera, NaN where the floor is not known. up (3,): the floor's normal.
    """
    x, y, step_px, offset_px = grid.x, grid.y, grid.step_px, grid.offset_px
    runs, rows = _runs_of(labels, count), np.zeros(count, np.intp)
    cells, edges = _edges(runs, count)
    sides_visible, top_and_bottom_visible = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    sums, rims = _sums(grid.inverse_depth, runs, x, y, edges)
    bbox_px, position_m, extent_m = np.zeros((count, 4)), np.zeros((count, 3)), np.zeros((count, 3))
    for part in range(count):
        if cells[part] == 0:
            continue
        left, top, right, bottom = edges[part]
        rows[part] = bottom - top + 1
        sides_visible[part] = left > 0 and right < labels.shape[1] - 1
        top_and_bottom_visible[part] = top > 0 and bottom < labels.shape[0] - 1
        mean, mean_square, mean_x, mean_y = sums[part] / cells[part]
        depth_m = 1.0 / mean
        bbox_px[part, 0] = left * step_px + (offset_px - 0.5 * step_px)
        bbox_px[part, 1] = top * step_px + (offset_px - 0.5 * step_px)
        bbox_px[part, 2] = right * step_px + (offset_px + 0.5 * step_px)
        bbox_px[part, 3] = bottom * step_px + (offset_px + 0.5 * step_px)
        if not math.isnan(height_m):
            foot_px = _foot_px(grid, up, height_m, mean_x, depth_m, bottom)
            bbox_px[part, 3] = max(bbox_px[part, 3], foot_px)
        position_m[part] = mean_x * depth_m, mean_y * depth_m, depth_m
        # abs: of a surface that recedes outwards, the rim at the left may be farther right in space.
        extent_m[part, 0] = abs(
            x[right] * rims[part, 2] / rims[part, 3] - x[left] * rims[part, 0] / rims[part, 1]
        )
        extent_m[part, 1] = (y[bottom] - y[top]) * depth_m
        extent_m[part, 2] = _UNIFORM * np.sqrt(max(mean_square - mean * mean, 0.0)) * depth_m * depth_m
    return cells, rows, bbox_px, position_m, extent_m, sides_visible, top_and_bottom_visible
