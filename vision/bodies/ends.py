"""The cells close to the ends of fragments, at their depth; vision/bodies/carving.py cuts them out.

Terms: vision/__init__.py.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise
from hal.compiled import compiled
from hal.types import Integers, Vector
from vision.bodies.sizes import SAME_BODY_M, SAME_BODY_SIGMAS
from vision.depth.cells import cell_at
from vision.depth.connected import IntGrid
from vision.depth.depth_grid import BoolGrid, DepthGrid, FloatGrid

_AROUND_M = 0.2  # cells within this distance belong to the fragment's body, which is about twice as wide


class _Window(NamedTuple):
    """The part of the grid that holds all cells which can be close to an end, with M ends.

    seeds: 0 in the cells of the ends, 1 elsewhere.
    top, left: its first row and column.
    rows, columns: of the ends within it, (M,).
    end_m: their depths, (M,).
    """

    seeds: Annotated[NDArray[np.uint8], "uint8[:, ::1]"]
    top: int
    left: int
    rows: Integers
    columns: Integers
    end_m: Vector


def near_ends(
    grid: DepthGrid,
    search_area: BoolGrid,
    ends_px: NDArray[np.float32],
    depth_m: NDArray[np.float32],
    focal_px: float,
    noise: DepthNoise,
) -> BoolGrid:
    """(h, w) cells of search_area (h, w) that are close to the ends (N, 2, 2) of fragments, at their depth.

    depth_m (N, 2): of the ends, NaN where it is not known.
    """
    window = _window(grid, ends_px, depth_m, search_area, _AROUND_M * focal_px / grid.step_px)
    if len(window.end_m) == 0:
        return np.zeros(grid.depth_m.shape, np.bool_)
    distance, label = cv2.distanceTransformWithLabels(
        window.seeds, cv2.DIST_L2, 3, labelType=cv2.DIST_LABEL_PIXEL
    )
    return _within_reach(
        window,
        np.asarray(distance, np.float32),
        np.asarray(label, np.int32),
        grid,
        search_area,
        np.float32(grid.step_px / (_AROUND_M * focal_px)),
        noise,
    )


@compiled(DepthGrid, "float32[:, :, :], float32[:, :], boolean[:, ::1], float64")
def _window(
    grid: DepthGrid,
    ends_px: NDArray[np.float32],
    depth_m: NDArray[np.float32],
    search_area: BoolGrid,
    reach_at_1m: float,
) -> _Window:
    """The window of the ends whose depth is known; without ends if no cell of it is in search_area.

    reach_at_1m: _AROUND_M in cells at a distance of 1 m; it is less farther away.
    """
    height, width = search_area.shape
    rows, columns = np.empty(depth_m.size, np.intp), np.empty(depth_m.size, np.intp)
    end_m, count = np.empty(depth_m.size), 0
    for n in range(len(depth_m)):
        for k in range(2):
            if np.isfinite(depth_m[n, k]):
                u, v = float(ends_px[n, k, 0]), float(ends_px[n, k, 1])
                rows[count], columns[count] = cell_at(grid, u, v)
                end_m[count] = depth_m[n, k]
                count += 1
    rows, columns, end_m = rows[:count], columns[:count], end_m[:count]
    if count == 0:
        return _Window(np.empty((0, 0), np.uint8), 0, 0, rows, columns, end_m)
    reach = int(reach_at_1m / end_m.min()) + 2
    top, bottom = max(rows.min() - reach, 0), min(rows.max() + reach + 1, height)
    left, right = max(columns.min() - reach, 0), min(columns.max() + reach + 1, width)
    if not search_area[top:bottom, left:right].any():
        count = 0
    seeds = np.ones((bottom - top, right - left), np.uint8)
    for k in range(count):
        rows[k] -= top
        columns[k] -= left
        seeds[rows[k], columns[k]] = 0
    return _Window(seeds, top, left, rows[:count], columns[:count], end_m[:count])


@compiled(_Window, "float32[:, ::1], int32[:, ::1]", DepthGrid, "boolean[:, ::1], float32", DepthNoise)
def _within_reach(
    window: _Window,
    distance: FloatGrid,
    label: IntGrid,
    grid: DepthGrid,
    search_area: BoolGrid,
    per_cell: np.float32,
    noise: DepthNoise,
) -> BoolGrid:
    """As near_ends. distance (in cells) to the nearest end, and label of that end: in the window.

    per_cell: width of a cell at 1 m, as a share of _AROUND_M.
    """
    result, top, left = np.zeros(search_area.shape, np.bool_), window.top, window.left
    nearest_m, agree_per_m = np.zeros(label.max() + 1), SAME_BODY_SIGMAS * noise.quadratic_per_m
    for k in range(len(window.end_m)):
        nearest_m[label[window.rows[k], window.columns[k]]] = window.end_m[k]
    for i in range(label.shape[0]):
        for j in range(label.shape[1]):
            if search_area[top + i, left + j]:
                there_m = nearest_m[label[i, j]]
                off_m = abs(grid.depth_m[top + i, left + j] - there_m)
                close = distance[i, j] * per_cell * there_m <= 1.0
                result[top + i, left + j] = close and off_m <= SAME_BODY_M + agree_per_m * there_m * there_m
    return result
