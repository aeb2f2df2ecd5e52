"""Free space from depth: the nearest surface in every direction, and how far the space is known at all.

It covers what fragments miss: a plain wall has no fragments. And a corridor without valid depth (glass,
black, too near) is not free. vision/tracker.py calls it in each frame, and the result is part of the Scene.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled
from hal.types import FloatArray
from vision.depth.depth_grid import BoolGrid, DepthGrid, FloatGrid, floor_ray
from vision.depth.level_bands import LevelBands, level_bands
from vision.depth.near_floor import FLOOR_EXCESS
from vision.scene import NEVER_M, FreeSpace

_SUPPORT = 3  # a surface needs this many cells in a band: the distance is that of the third nearest
_BLANK_SHARE = 0.1  # maximum share of measured cells in a blank band: stray cells are measured even there
_LEVEL_RAD, _UPRIGHT_RAD = 1e-6, 1.5  # bounds of a ray's angle, so that its tangent stays meaningful


def free_space(
    grid: DepthGrid, obstacle: BoolGrid, max_depth_m: float, measurable_from_m: float = 0.0
) -> FreeSpace:
    """Nearest obstacle surface and known distance for each of at most 80 upright bands.

    obstacle (h, w): cells between clearance and the robot's height; all valid cells where the floor is not
    known. measurable_from_m: floor nearer than this depth cannot be measured (vision/depth/near_floor.py), so
    that missing data there is no hole; 0.0: all floor can be measured. Without a known mounting, space is
    known up to the nearest surface only. Floor that own parts hide (own_cells.py) is as floor below the view.
    """
    bands = level_bands(grid)
    nearest = _nearest_m(grid.forward_m, obstacle, bands.band, len(bands))
    known, blind_m = np.zeros(len(bands)), 0.0
    if math.isfinite(grid.pitch_rad):
        known, blind_m = _known_m(grid, bands, max_depth_m, measurable_from_m)
    # A surface hides everything behind it.
    known = np.minimum(np.where(np.isfinite(nearest), nearest, known), max_depth_m)
    return FreeSpace(
        bearing_tan=bands.bearing_tan,
        half_width_tan=bands.half_width_tan,
        nearest_m=nearest,
        known_m=known,
        blind_m=max(blind_m, grid.hidden_m),
        floor_from_m=max(_floor_from_m(grid), grid.hidden_m),
        up_tan=_up_tan(grid),
        blank=_blank(grid, bands, known, nearest),
    )


def _blank(
    grid: DepthGrid, bands: LevelBands, known_m: FloatArray, nearest_m: FloatArray
) -> NDArray[np.bool_]:
    """FreeSpace.blank: something right in front of the lens fills a band from bottom to top.

    A hole in the floor does not.
    """
    blank = (known_m <= 0.0) & np.isinf(nearest_m)
    if blank.any():
        rows = len(grid.y)
        measured = (grid.valid | grid.beyond).ravel()[bands.cells] & (bands.cells >= 0)
        measured = np.count_nonzero(measured.reshape(rows, -1, bands.width), axis=(0, 2))
        blank &= measured <= _BLANK_SHARE * rows * bands.width
    return blank


def _floor_from_m(grid: DepthGrid) -> float:
    """FreeSpace.floor_from_m, by the lowest row of cells."""
    if not math.isfinite(grid.pitch_rad):
        return 0.0
    down_rad = math.atan(float(grid.y[-1])) + grid.pitch_rad
    nearest_m = grid.camera_height_m / math.tan(min(max(down_rad, _LEVEL_RAD), _UPRIGHT_RAD))
    return min(nearest_m, NEVER_M)


def _up_tan(grid: DepthGrid) -> float:
    """FreeSpace.up_tan, by the uppermost row of cells."""
    if not math.isfinite(grid.pitch_rad):
        return math.inf
    up_rad = math.atan(-float(grid.y[0])) - grid.pitch_rad
    return math.tan(min(up_rad, _UPRIGHT_RAD))


@compiled("float32[:, ::1], boolean[:, ::1], int32[:, ::1], int64")
def _nearest_m(forward_m: FloatGrid, obstacle: BoolGrid, band: NDArray[np.int32], bands: int) -> FloatArray:
    """(B,) forward distance of the _SUPPORT-th nearest obstacle cell of each band, inf if there are fewer."""
    # The nearest _SUPPORT distances of each band, in ascending order.
    nearest = np.full((bands, _SUPPORT), np.inf)
    for i in range(obstacle.shape[0]):
        for j in range(obstacle.shape[1]):
            if not obstacle[i, j]:
                continue
            kept, place = nearest[band[i, j]], _SUPPORT - 1
            if not forward_m[i, j] < kept[place]:
                continue
            while place > 0 and forward_m[i, j] < kept[place - 1]:
                kept[place] = kept[place - 1]
                place -= 1
            kept[place] = max(forward_m[i, j], np.float32(0.0))
    return nearest[:, -1].copy()


@dataclass(frozen=True, slots=True, eq=False)
class _FloorRows:
    """The rows of the grid whose rays meet the floor, k of them, from the bottom of the image upwards.

    depth_m, forward_m: where they meet it, (k,). limit_m: maximum depth of floor there, (k,).
    reach_m: forward distance up to which floor is seen if the rows below are floor, (k + 1,).
    """

    depth_m: FloatArray
    forward_m: FloatArray
    limit_m: FloatGrid
    reach_m: FloatArray


@lru_cache(maxsize=4)
def _floor_rows(
    rays_y: bytes, pitch_rad: float, camera_height_m: float, max_depth_m: float
) -> _FloorRows | None:
    """None if no ray meets the floor. Cached, since it is the same in every frame. rays_y: y of the grid."""
    y: FloatArray = np.frombuffer(rays_y, np.float32).astype(float)
    ahead, drop = floor_ray(y, pitch_rad)
    below = drop > camera_height_m / (1.5 * max_depth_m)
    rows = below.nonzero()[0][::-1]  # from the bottom of the image upwards, nearest floor first
    if len(rows) == 0:
        return None
    depth_m = camera_height_m / drop[rows]
    forward_m = depth_m * ahead[rows]
    limit_m = (FLOOR_EXCESS * depth_m).astype(np.float32)
    # If even the uppermost row meets the floor, nothing beyond that is in view.
    horizon_m = max_depth_m if len(rows) < len(y) else forward_m[-1]
    reach_m = np.minimum(np.concatenate((forward_m, (horizon_m,))), max_depth_m)
    return _FloorRows(depth_m, forward_m, limit_m, reach_m)


def _known_m(
    grid: DepthGrid, bands: LevelBands, max_depth_m: float, measurable_from_m: float
) -> tuple[FloatArray, float]:
    """(B,) forward distance up to which the floor is seen without a hole; and FreeSpace.blind_m."""
    floor = _floor_rows(grid.y.tobytes(), grid.pitch_rad, grid.camera_height_m, max_depth_m)
    if floor is None:
        return np.zeros(len(bands)), 0.0
    unmeasured = int(np.count_nonzero(floor.depth_m < measurable_from_m))
    hidden = int(np.count_nonzero(floor.forward_m < grid.hidden_m))
    first = _first_hole(grid, bands.cells, bands.width, floor.limit_m, unmeasured, hidden)
    # With a hole in the lowest row nothing is known, since nothing nearer is in view.
    known: FloatArray = np.where(first == 0, 0.0, floor.reach_m[first])
    return known, float(floor.forward_m[unmeasured - 1]) if unmeasured else 0.0


@compiled(DepthGrid, "int32[:, ::1], int64, float32[::1], int64, int64")
def _first_hole(
    grid: DepthGrid,
    cells: NDArray[np.int32],
    width: int,
    limit_m: NDArray[np.float32],
    unmeasured: int,
    hidden: int,
) -> NDArray[np.intp]:
    """(B,) row at which the floor ends in each band, counted from the bottom (0); len(limit_m): nowhere.

    A row is a hole if less than half of its cells show floor. The floor ends at the first of two successive
    holes, or at a hole in the last row. It is 0 if some rows are unmeasured and none before the hole shows
    floor.

    cells, width: see LevelBands. limit_m (k,): maximum depth of floor in the lowest k rows. unmeasured: the
    number of these that are too near to be measured. In them cells without data are no hole; measured cells
    count as elsewhere. hidden: the number of rows in which own parts may hide floor. There a row of own cells
    is no hole either, if floor is seen beyond it; else the floor ends before it.
    """
    bands, rows, has_own = cells.shape[1] // width, len(limit_m), len(grid.own) > 0
    depth, is_own = grid.depth_m.ravel(), grid.own.ravel()
    is_valid, is_beyond = grid.valid.ravel(), grid.beyond.ravel()
    result = np.empty(bands, np.intp)
    for band in range(bands):
        seen_to, shown, before = 0, False, False
        for row in range(rows):
            floor, nothing, of_robot = 0, 0, 0
            for place in range(band * width, (band + 1) * width):
                cell = cells[len(cells) - 1 - row, place]
                if cell >= 0:
                    floor += is_valid[cell] and depth[cell] <= limit_m[row]
                    nothing += not (is_valid[cell] or is_beyond[cell])
                    of_robot += has_own and is_own[cell]
            if 2 * floor < width and row < hidden and 2 * of_robot >= width:
                continue
            hole = 2 * floor < width and not (row < unmeasured and 2 * nothing >= width)
            shown |= 2 * floor >= width
            # A single row without floor may be noise.
            if hole and before:
                break
            before = hole
            if not hole:
                seen_to = row + 1
        result[band] = seen_to if shown or not unmeasured else 0
    return result
