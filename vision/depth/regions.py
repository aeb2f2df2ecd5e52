"""What each part of the view measures: box, centre, size, and what hides some of it.

Terms (cell, part, region): vision/__init__.py.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled, inlined
from hal.types import FloatArray
from vision.depth.connected import LEAST_JUMP, MOST_JUMP, IntGrid
from vision.depth.depth_grid import DepthGrid, FloatGrid

_UNIFORM = 3.46  # a uniform spread is this many standard deviations long
_FOOT_M, _FOOT_PER_METRE = 0.12, 0.015  # taken for floor: standing()'s clearance and margins
_OCCLUDED_SHARE = 0.15  # of its rows: at fewer rims it is noise that is nearer
_GAP_CELLS = 3  # beside what is nearer a stereo camera measures nothing for some cells
_HIDDEN_SHARE = 0.5  # of its width: else some of its lower end is seen, and ends there
_HEAD_M = 0.2  # a head to the chin: less is a strip of something
_RIM = 8  # one in so many columns of a part is its rim, on either side


@dataclass(frozen=True, slots=True, eq=False)
class Regions:
    """What R labelled parts of the grid measure; entries without cells have cells == 0.

    cells (R,). rows (R,) of the grid that they reach over. bbox_px (R, 4): u0, v0, u1, v1. position_m (R, 3):
    centre of the visible surface. extent_m (R, 3). wide (R,): not cut by the image's left or right border,
    tall (R,): nor above or below. overlapped (R,): by something nearer, seen from its side.
    """

    cells: NDArray[np.intp]
    rows: NDArray[np.intp]
    bbox_px: FloatArray
    position_m: FloatArray
    extent_m: FloatArray
    wide: NDArray[np.bool_]
    tall: NDArray[np.bool_]
    overlapped: NDArray[np.bool_]

    @property
    def whole(self) -> NDArray[np.bool_]:
        """(R,) parts that are cut on no side, and of which nothing nearer hides any."""
        return self.wide & self.tall & ~self.overlapped


def exchanged(regions: Regions, others: Regions, chosen: NDArray[np.bool_]) -> Regions:
    """regions, where chosen (R,) those of others."""
    return Regions(
        cells=np.where(chosen, others.cells, regions.cells),
        rows=np.where(chosen, others.rows, regions.rows),
        bbox_px=np.where(chosen[:, None], others.bbox_px, regions.bbox_px),
        position_m=np.where(chosen[:, None], others.position_m, regions.position_m),
        extent_m=np.where(chosen[:, None], others.extent_m, regions.extent_m),
        wide=np.where(chosen, others.wide, regions.wide),
        tall=np.where(chosen, others.tall, regions.tall),
        overlapped=np.where(chosen, others.overlapped, regions.overlapped),
    )


def measure(grid: DepthGrid, labels: IntGrid, count: int) -> Regions:
    """Boxes, centres and sizes of the parts 1..count of labels (h, w); entry k - 1 is part k.

    wide knows of the image's border only; see unhidden.
    """
    on_floor = grid.up is not None
    cells, rows, bbox_px, position_m, extent_m, wide, tall = _measured(
        grid.inverse_depth,
        labels,
        count,
        grid.x,
        grid.y,
        float(grid.step_px),
        grid.offset_px,
        grid.up if grid.up is not None else np.zeros(3),
        grid.camera_height_m if on_floor else np.nan,
    )
    overlapped = np.zeros(count, np.bool_)
    return Regions(cells, rows, bbox_px, position_m, extent_m, wide, tall, overlapped)


@inlined
def _edges(labels: IntGrid, count: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """(R,) cells of parts 1..count of labels (h, w), and (R, 4) their first and last columns and rows: left,
    top, right, bottom; 0, 0, 0, -1 of those without cells."""
    height, width = labels.shape
    cells, edges = np.zeros(count, np.intp), np.zeros((count, 4), np.intp)
    edges[:, 3] = -1
    for i in range(height):
        for j in range(width):
            part = labels[i, j] - 1
            if part < 0 or part >= count:
                continue
            edge = edges[part]
            if cells[part] == 0:
                edge[0], edge[1], edge[2] = j, i, j
            cells[part] += 1
            edge[0], edge[2], edge[3] = min(edge[0], j), max(edge[2], j), i
    return cells, edges


@inlined
def _foot_px(
    y: FloatGrid,
    step_px: float,
    offset_px: float,
    up: FloatArray,
    height_m: float,
    middle_x: float,
    depth_m: float,
    bottom: int,
) -> float:
    """Image row where a part that nearly reaches down to the floor stands on it; -inf for others. height_m:
    of the camera.

    The lowest hand's breadth of a body is taken for floor, as the noise of depth demands.
    """
    # On the floor: camera height = - up . ray * depth.
    floor_y = (-height_m / depth_m - up[2] - up[0] * middle_x) / up[1]
    if not (floor_y - y[bottom]) * depth_m <= _FOOT_M + _FOOT_PER_METRE * depth_m:
        return -np.inf
    row = float((floor_y - y[0]) / (y[1] - y[0])) * step_px + offset_px
    return min(row, offset_px + (len(y) - 0.5) * step_px)


@compiled(
    "float32[:, ::1], int32[:, ::1], int64, float32[::1], float32[::1], "
    "float64, float64, float64[::1], float64"
)
def _measured(
    inverse: FloatGrid,
    labels: IntGrid,
    count: int,
    x: FloatGrid,
    y: FloatGrid,
    step_px: float,
    offset_px: float,
    up: FloatArray,
    height_m: float,
) -> tuple[
    NDArray[np.intp],
    NDArray[np.intp],
    FloatArray,
    FloatArray,
    FloatArray,
    NDArray[np.bool_],
    NDArray[np.bool_],
]:
    """cells and rows (R,), bbox_px (R, 4), position_m and extent_m (R, 3), wide and tall (R,) of the parts.
    height_m: of the camera, NaN where the floor is not known; up (3,): its normal."""
    (cells, edges), rows = _edges(labels, count), np.zeros(count, np.intp)
    wide, tall = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    # Sums over each part: inverse depth, its square, x, y; and over its left and its right rim, which are
    # measured each at its own depth: cells, inverse depth. Whoever looks along a side of a body would take it
    # for wider, at the depth of its middle, than it is.
    sums, rims = np.zeros((count, 4)), np.zeros((count, 4))
    for i in range(labels.shape[0]):
        for j in range(labels.shape[1]):
            part = labels[i, j] - 1
            if part < 0 or part >= count:
                continue
            value, left, right = float(inverse[i, j]), edges[part, 0], edges[part, 2]
            rim = (right - left) // _RIM
            sums[part, 0] += value
            sums[part, 1] += value * value
            sums[part, 2] += x[j]
            sums[part, 3] += y[i]
            if j <= left + rim:
                rims[part, 0] += 1.0
                rims[part, 1] += value
            if j >= right - rim:
                rims[part, 2] += 1.0
                rims[part, 3] += value
    bbox_px, position_m, extent_m = np.zeros((count, 4)), np.zeros((count, 3)), np.zeros((count, 3))
    for part in range(count):
        if cells[part] == 0:
            continue
        left, top, right, bottom = edges[part]
        rows[part] = bottom - top + 1
        wide[part] = left > 0 and right < labels.shape[1] - 1
        tall[part] = top > 0 and bottom < labels.shape[0] - 1
        mean, mean_square, mean_x, mean_y = sums[part] / cells[part]
        depth_m = 1.0 / mean
        bbox_px[part, 0] = left * step_px + (offset_px - 0.5 * step_px)
        bbox_px[part, 1] = top * step_px + (offset_px - 0.5 * step_px)
        bbox_px[part, 2] = right * step_px + (offset_px + 0.5 * step_px)
        bbox_px[part, 3] = bottom * step_px + (offset_px + 0.5 * step_px)
        if height_m == height_m:
            foot_px = _foot_px(y, step_px, offset_px, up, height_m, mean_x, depth_m, bottom)
            bbox_px[part, 3] = max(bbox_px[part, 3], foot_px)
        position_m[part] = mean_x * depth_m, mean_y * depth_m, depth_m
        # What goes back and outwards has its far end on the inner rim.
        extent_m[part, 0] = abs(
            x[right] * rims[part, 2] / rims[part, 3] - x[left] * rims[part, 0] / rims[part, 1]
        )
        extent_m[part, 1] = (y[bottom] - y[top]) * depth_m
        extent_m[part, 2] = _UNIFORM * np.sqrt(max(mean_square - mean * mean, 0.0)) * depth_m * depth_m
    return cells, rows, bbox_px, position_m, extent_m, wide, tall


def unhidden(grid: DepthGrid, labels: IntGrid, regions: Regions) -> Regions:
    """regions as measured, wide only where nothing nearer hides a part, either, and where it ends at an edge
    in depth: what was divided from its surroundings by guess has its middle where the guess put it."""
    hidden, overlapped = _hidden_cells(grid.inverse_depth, labels, len(regions.cells), np.float32(LEAST_JUMP))
    least = _OCCLUDED_SHARE * regions.rows
    return replace(regions, wide=regions.wide & (hidden <= least), overlapped=overlapped > least)


@compiled("float32[:, ::1], int32[:, ::1], int64, float32")
def _hidden_cells(
    inverse: FloatGrid, labels: IntGrid, count: int, jump: np.float32
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """(count,) cells at the left or right rim of each part beside which something else stands nearer, or
    another part goes on at the same depth; and (count,) those that end at another part, which is nearer.

    Beside what stands nearer a stereo camera measures nothing, and the far side of a jump is of no part: what
    comes after that gap is the neighbour. jump: in 1/m; less is noise.
    """
    room = max(count, labels.max()) + 1
    hidden, overlapped = np.zeros(room, np.intp), np.zeros(room, np.intp)
    for i in range(labels.shape[0]):
        neighbour = -1  # the last cell of a part in this row
        for j in range(labels.shape[1]):
            here = labels[i, j]
            if j > 0 and labels[i, j - 1] != here:
                beside, step = labels[i, j - 1], inverse[i, j] - inverse[i, j - 1]
                if abs(step) > jump:
                    hidden[beside if step > 0 else here] += 1
                elif beside > 0 and here > 0:
                    hidden[beside] += 1
                    hidden[here] += 1
            if here == 0:
                continue
            if neighbour >= 0 and labels[i, neighbour] != here and j - neighbour <= _GAP_CELLS + 1:
                step = inverse[i, j] - inverse[i, neighbour]
                if abs(step) > jump:
                    overlapped[labels[i, neighbour] if step > 0 else here] += 1
            neighbour = j
    return hidden[1 : count + 1].copy(), overlapped[1 : count + 1].copy()


def hidden_below(grid: DepthGrid, labels: IntGrid, regions: Regions) -> NDArray[np.bool_]:
    """(R,) parts whose lower end something nearer hides, for at least half of their width: what they are
    further down is not known. A beam ends before what is farther away. A head is as tall as _HEAD_M."""
    inverse, flat = grid.inverse_depth.ravel(), labels.ravel()
    width = labels.shape[1]
    rims = ((flat[:-width] > 0) & (flat[:-width] != flat[width:])).nonzero()[0]
    below = np.zeros(len(rims), inverse.dtype)
    for step in range(1, _GAP_CELLS + 1):
        below = np.maximum(below, inverse.take(np.minimum(rims + step * width, len(flat) - 1)))
    nearer = below - inverse.take(rims) > np.float32(MOST_JUMP)
    cells = np.bincount(flat.take(rims[nearer]), minlength=len(regions.cells) + 1)[1:]
    across = (regions.bbox_px[:, 2] - regions.bbox_px[:, 0]) / grid.step_px
    tall = regions.extent_m[:, 1] >= _HEAD_M
    result: NDArray[np.bool_] = tall & (regions.cells > 0) & (cells >= _HIDDEN_SHARE * across)
    return result
