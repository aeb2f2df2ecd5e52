"""Surfaces that have arrived in space that was seen free a moment ago. In a static world there are none.

All space that the camera saw through, from any position, was empty. A surface that is there now has arrived.
The test needs neither texture nor segmentation. A new viewpoint and the surfaces that it uncovers cannot
mislead it, since space that was hidden or not measured proves nothing. The same memory shows which surfaces
have stayed, as far as the noise of depth allows; a person close to a wall may count as stayed.

It takes the depth grid and the camera's pose. vision/tracker.py calls it first in each frame.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from operator import attrgetter

import cv2
import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise
from hal.compiled import compiled, inlined
from hal.records import record
from hal.types import FloatArray, Pose
from vision.depth.cells import lattice_of, place_of
from vision.depth.connected import IntGrid
from vision.depth.depth_grid import BoolGrid, DepthGrid, FloatGrid
from vision.numerics.relative_pose import NEAREST_M, Rows, coordinate_m, relative_rows

# Every second view at 30 frames a second is kept. A look back takes the view closest to the wanted time.
_KEEP_EVERY_S, _KEPT_FOR_S = 0.06, 1.2
# For so long may the surface of something that has come to rest count as arrived.
ARRIVED_UP_TO_S = 0.9
_OLDEST = 1.5  # of the wanted time of a look back: an older view does not serve
# In the longer time, 0.6 s, a walking person moves by more than his own width. In the shorter time less error
# of the camera's own motion has added up.
_LOOK_BACK_S = (0.2, ARRIVED_UP_TO_S / _OLDEST)
_MARGIN_M = 0.10  # besides the noise: error of the camera's motion over the longer look back
_SIGMAS = 3.5  # of the difference compared: exceeded by chance in 2 of 10000 cells; neighbours must agree too
# Noise of a cell between two frames relative to that of a pixel, as measured over time. A cell is a median
# over 25 cells of four samples each, and neighbours share their noise. Within one frame, for heights over the
# floor, the factor is CELL_HEIGHT_NOISE (vision/depth/depth_grid.py).
CELL_NOISE_OVER_TIME = 0.55
_SURELY = 0.5  # share of the margin within which a surface surely is the same
_NEIGHBOURS = 5  # at least this many of a cell and its eight neighbours must have arrived
# Of one surface: fewer arrived cells, or a smaller share of it, come and go with noise at a rim. A walking
# person arrives with one side.
ARRIVED_CELLS, ARRIVED_SHARE = 8, 0.05
MUCH_ARRIVED_CELLS = 20  # about a forearm 4 m away
MUCH_ARRIVED_SHARE = 0.2  # more than a rim that noise widens
_UNKNOWN = np.float32(1e3)  # 1/m, where nothing was measured: no surface is nearer, so none can arrive there
NEIGHBOURHOOD = np.ones((3, 3), np.uint8)  # of a cell: the cells that can confirm it
_stamp_ns = attrgetter("stamp_ns")


def arriving(arrived: NDArray[np.intp], cells: NDArray[np.intp]) -> NDArray[np.bool_]:
    """(T,) surfaces of which enough of the cells (T,) have arrived (T,)."""
    result: NDArray[np.bool_] = (arrived >= ARRIVED_CELLS) & (arrived >= ARRIVED_SHARE * cells)
    return result


@record(frozen=True, slots=True, eq=False)
class EarlierView:
    """What was seen a moment ago.

    pose: of the camera in the fixed frame.
    nearest_inverse: 1/m, of the nearest surface in 3x3 cells; _UNKNOWN where not measured, (h, w).
    inverse: 1/m, of the surface in the cell itself; 0 where not measured, (h, w).
    """

    stamp_ns: int
    pose: Pose
    nearest_inverse: FloatGrid
    inverse: FloatGrid

    def ago_s(self, now_ns: int) -> float:
        """How long ago it was seen."""
        return (now_ns - self.stamp_ns) * 1e-9


@record(frozen=True, slots=True, eq=False)
class Changes:
    """Cells whose surface has arrived, and cells whose surface has stayed.

    arrived: cells of surfaces in space that was seen free, (h, w).
    arrived_cells: the same as flat indices, (K,).
    stayed: cells of surfaces that were seen at the same place stayed_s ago, (h, w).
    stayed_s: 0.0 if there was no view of that time.

    Cells that were hidden or not measured then are in neither.
    """

    arrived: BoolGrid
    arrived_cells: NDArray[np.intp]
    stayed: BoolGrid
    stayed_s: float


class ViewMemory:
    """Remembers the views of the last moments, and so the space that was seen free."""

    def __init__(self, noise: DepthNoise) -> None:
        self._noise = noise
        self._views: list[EarlierView] = []  # in the order of time

    def clear(self) -> None:
        """Forget all views: their poses cannot be compared with those to come."""
        self._views.clear()

    def changes(self, grid: DepthGrid, mask: BoolGrid, pose: Pose, now_ns: int) -> Changes:
        """Which of the cells of mask (h, w) have arrived and which have stayed."""
        arrived, stayed, stayed_s = np.zeros(mask.shape, np.bool_), np.zeros(mask.shape, np.bool_), 0.0
        for wanted_s in _LOOK_BACK_S:
            then = self.view_of(now_ns, wanted_s)
            if then is None:
                continue
            nearer, same = self._compare(grid, mask, pose, then.pose, then.nearest_inverse)
            arrived |= nearer
            if wanted_s == _LOOK_BACK_S[-1]:
                stayed, stayed_s = same, then.ago_s(now_ns)
        return Changes(*_in_company(arrived, np.flatnonzero(arrived)), stayed, stayed_s)

    def stayed(
        self, grid: DepthGrid, mask: BoolGrid, pose: Pose, now_ns: int, wanted_s: float
    ) -> tuple[BoolGrid, float]:
        """Cells of mask (h, w) whose surface was surely at this place about wanted_s ago; how long ago.

        Stricter than changes, by half of its margin and the majority of the neighbours: a person 0.2 m in
        front of a wall is distinguished from it up to 3.5 m away. Only neighbours in mask confirm a cell. No
        cells, and 0.0 s, if there is no view of that time.
        """
        then = self.view_of(now_ns, wanted_s)
        if then is None:
            return np.zeros(mask.shape, np.bool_), 0.0
        _, same = self._compare(grid, mask, pose, then.pose, then.inverse, _SURELY)
        same, _ = _in_company(same, np.flatnonzero(same))
        return same, then.ago_s(now_ns)

    def resolves_m(self, distance_m: FloatArray) -> FloatArray:
        """(N,) minimum difference in depth at which two surfaces at distance_m (N,) can be distinguished."""
        noise_1pm = _SIGMAS * math.sqrt(2.0) * CELL_NOISE_OVER_TIME * self._noise.quadratic_per_m
        result: FloatArray = _MARGIN_M + noise_1pm * np.square(distance_m)
        return result

    def remember(self, grid: DepthGrid, pose: Pose, now_ns: int) -> None:
        """Keep this view, unless the last one was kept less than _KEEP_EVERY_S ago."""
        if self._views and self._views[-1].ago_s(now_ns) < _KEEP_EVERY_S:
            return
        nearest = np.full(grid.inverse_depth.shape, _UNKNOWN)
        cv2.copyTo(grid.inverse_depth, grid.valid.view(np.uint8), nearest)
        # Where the measured depth is beyond the range, space was seen free up to the range, no farther.
        nearest[grid.beyond] = np.float32(1.0 / grid.range_m)
        cv2.dilate(nearest, NEIGHBOURHOOD, nearest)
        self._views.append(EarlierView(now_ns, pose, nearest, grid.inverse_depth))
        horizon_ns = now_ns - int(1e9 * _KEPT_FOR_S)
        self._views = [view for view in self._views if view.stamp_ns >= horizon_ns]

    def view_of(self, now_ns: int, wanted_s: float) -> EarlierView | None:
        """The view closest to wanted_s ago, if there is one within 0.5 to 1.5 times of it."""
        best, gap = None, (_OLDEST - 1.0) * wanted_s
        place = bisect_left(self._views, now_ns - wanted_s * 1e9, key=_stamp_ns)
        for view in self._views[max(place - 1, 0) : place + 2]:
            off = abs(view.ago_s(now_ns) - wanted_s)
            if off <= gap:
                best, gap = view, off
        return best

    def _compare(
        self,
        grid: DepthGrid,
        mask: BoolGrid,
        pose: Pose,
        old_pose: Pose,
        seen_inverse: FloatGrid,
        margin: float = 1.0,
    ) -> tuple[BoolGrid, BoolGrid]:
        """(h, w) cells of mask nearer than the surface seen from old_pose; and those at it, within noise.

        seen_inverse (h, w): 1/m, of that surface. margin: as a share of the usual one.
        """
        sigma_1pm = math.sqrt(2.0) * CELL_NOISE_OVER_TIME * self._noise.quadratic_per_m
        margin_m, noise_1pm = np.float32(margin * _MARGIN_M), np.float32(margin * _SIGMAS * sigma_1pm)
        return _compared(grid, mask, pose, old_pose, seen_inverse, margin_m, noise_1pm)


@inlined
def _project_row(grid: DepthGrid, row: int, rows: Rows, cell: IntGrid, inverse: FloatGrid) -> None:
    """Project the cells of one row into the other view.

    Puts the flat cell of that view, -1 outside of it, into cell (w,) and the inverse depth there into inverse
    (w,). There is no branch, so that the processor can do several at once.
    """
    ray_x, ray_y, depth_m = grid.x, grid.y, grid.depth_m
    columns, width, height = np.int32(len(ray_x)), np.float32(len(ray_x)), np.float32(len(ray_y))
    lattice, zero = lattice_of(ray_x, ray_y), np.float32(0.0)
    to_x, to_y, to_z = rows
    for j in range(columns):
        z = depth_m[row, j]
        x, y = ray_x[j] * z, ray_y[row] * z
        there_m = coordinate_m(to_z, x, y, z)
        inverse[j] = np.float32(1.0) / there_m
        there_x, there_y = coordinate_m(to_x, x, y, z), coordinate_m(to_y, x, y, z)
        u, v = place_of(there_x * inverse[j], there_y * inverse[j], lattice)
        inside = (there_m > NEAREST_M) & (u >= zero) & (v >= zero) & (u < width) & (v < height)
        cell[j] = np.int32(v) * columns + np.int32(u) if inside else np.int32(-1)


@compiled(DepthGrid, "boolean[:, ::1]", Pose, Pose, "float32[:, ::1], float32, float32")
def _compared(
    grid: DepthGrid,
    mask: BoolGrid,
    pose: Pose,
    old_pose: Pose,
    seen_inverse: FloatGrid,
    margin_m: np.float32,
    noise_1pm: np.float32,
) -> tuple[BoolGrid, BoolGrid]:
    """As _compare. pose: of the camera now; old_pose: when seen_inverse (h, w) was seen."""
    height, width = mask.shape
    nearer, same = np.zeros((height, width), np.bool_), np.zeros((height, width), np.bool_)
    cell, inverse, seen = np.empty(width, np.int32), np.empty(width, np.float32), seen_inverse.ravel()
    rows = relative_rows(old_pose, pose)
    for i in range(height):
        if not mask[i].any():
            continue
        _project_row(grid, i, rows, cell, inverse)
        for j in range(width):
            if mask[i, j] and cell[j] >= 0:
                ahead = inverse[j] - seen[cell[j]]
                margin = margin_m * inverse[j] * inverse[j] + noise_1pm
                nearer[i, j], same[i, j] = ahead > margin, abs(ahead) <= margin
    return nearer, same


@compiled("boolean[:, ::1], int64[::1]")
def _in_company(mask: BoolGrid, cells: NDArray[np.intp]) -> tuple[BoolGrid, NDArray[np.intp]]:
    """The cells with enough cells of mask (h, w) in their 3x3 neighbourhood, as (h, w) and as flat indices.

    cells (K,): flat indices of all cells of mask.
    """
    height, width = mask.shape
    result, kept, number = np.zeros((height, width), np.bool_), np.empty(len(cells), np.intp), 0
    for cell in cells:
        row, column, count = cell // width, cell % width, 0
        for i in range(max(row - 1, 0), min(row + 2, height)):
            for j in range(max(column - 1, 0), min(column + 2, width)):
                count += mask[i, j]
        if count >= _NEIGHBOURS:
            result[row, column] = True
            kept[number] = cell
            number += 1
    return result, kept[:number]
