"""What edges cannot see: the nearest surface in every direction, and how far the space was seen at all.

A plain wall has no fragments, and a corridor without valid depth (glass, black, too near) is not free.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled
from hal.types import FloatArray
from vision.depth.depth_grid import BoolGrid, DepthGrid, FloatGrid
from vision.depth.level_bands import LevelBands, level_bands
from vision.depth.near_floor import FLOOR_EXCESS
from vision.scene import NEVER_M, FreeSpace

_SUPPORT = 3  # this many cells of a band must agree before they are a surface
_BLANK_SHARE = 0.1  # of a band's cells: stray ones are measured even where something covers the lens
_LEVEL_RAD, _UPRIGHT_RAD = 1e-6, 1.5  # as level and as steep as a ray may be to have a tangent worth telling


def free_space(
    grid: DepthGrid, obstacle: BoolGrid, max_depth_m: float, unmeasured_m: float = 0.0
) -> FreeSpace:
    """Nearest obstacle cell (supported) and known distance for each of at most 80 upright bands.

    obstacle (h, w): cells between clearance and the robot's height; all valid ones where the floor is not
    known. unmeasured_m: floor nearer than this depth cannot be measured (vision/depth/near_floor.py), and no
    data there is no hole; 0.0: all can. Without a known mounting, space is known up to the nearest surface
    only.
    """
    bands, blind_m = level_bands(grid), 0.0
    nearest = _nearest_m(grid.forward_m, obstacle, bands.band, len(bands))
    if math.isfinite(grid.pitch_rad):
        known, blind_m = _known_m(grid, bands, max_depth_m, unmeasured_m)
        # What stands there hides what is behind it.
        known = np.where(np.isfinite(nearest), nearest, known)
    else:
        known = np.where(np.isfinite(nearest), nearest, 0.0)
    known = np.minimum(known, max_depth_m)
    return FreeSpace(
        bearing_tan=bands.bearing_tan,
        half_width_tan=bands.half_width_tan,
        nearest_m=nearest,
        known_m=known,
        blind_m=blind_m,
        floor_from_m=_floor_from_m(grid),
        up_tan=_up_tan(grid),
        blank=_blank(grid, bands, known, nearest),
    )


def _blank(
    grid: DepthGrid, bands: LevelBands, known_m: FloatArray, nearest_m: FloatArray
) -> NDArray[np.bool_]:
    """FreeSpace.blank: what is right before the lens fills its bands from below to above. A hole in the floor
    does not."""
    blank = (known_m <= 0.0) & np.isinf(nearest_m)
    if blank.any():
        rows = len(grid.y)
        measured = (grid.valid | grid.beyond).ravel()[bands.cells] & (bands.cells >= 0)
        measured = np.count_nonzero(measured.reshape(rows, -1, bands.width), axis=(0, 2))
        blank &= measured <= _BLANK_SHARE * rows * bands.width
    return blank


def _floor_from_m(grid: DepthGrid) -> float:
    """FreeSpace.floor_from_m, of the lowest row of cells."""
    if not math.isfinite(grid.pitch_rad):
        return 0.0
    down_rad = math.atan(float(grid.y[-1])) + grid.pitch_rad
    nearest_m = grid.camera_height_m / math.tan(min(max(down_rad, _LEVEL_RAD), _UPRIGHT_RAD))
    return min(nearest_m, NEVER_M)


def _up_tan(grid: DepthGrid) -> float:
    """FreeSpace.up_tan, of the uppermost row of cells."""
    if not math.isfinite(grid.pitch_rad):
        return math.inf
    up_rad = math.atan(-float(grid.y[0])) - grid.pitch_rad
    return math.tan(min(up_rad, _UPRIGHT_RAD))


@compiled("float32[:, ::1], boolean[:, ::1], int32[:, ::1], int64")
def _nearest_m(forward_m: FloatGrid, obstacle: BoolGrid, band: NDArray[np.int32], bands: int) -> FloatArray:
    """(B,) forward distance of the nearest surface that enough obstacle cells agree on, inf without."""
    # The nearest few of each band, in order.
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


def _known_m(
    grid: DepthGrid, bands: LevelBands, max_depth_m: float, unmeasured_m: float
) -> tuple[FloatArray, float]:
    """(B,) how far the floor, or something on it, was seen without a hole; and FreeSpace.blind_m."""
    cos_pitch, sin_pitch = math.cos(grid.pitch_rad), math.sin(grid.pitch_rad)
    y = grid.y.astype(float)
    drop = y * cos_pitch + sin_pitch
    below = drop > grid.camera_height_m / (1.5 * max_depth_m)
    rows = below.nonzero()[0][::-1]  # from the bottom of the image outwards
    if len(rows) == 0:
        return np.zeros(len(bands)), 0.0
    floor_depth = grid.camera_height_m / drop[rows]
    floor_forward = floor_depth * (cos_pitch - y[rows] * sin_pitch)
    limit_m = (FLOOR_EXCESS * floor_depth).astype(np.float32)
    unmeasured = int(np.count_nonzero(floor_depth < unmeasured_m))
    # Where even the uppermost ray meets the floor, nothing beyond that was looked at.
    horizon_m = max_depth_m if len(rows) < len(grid.y) else floor_forward[-1]
    reach_m = np.minimum(np.concatenate((floor_forward, (horizon_m,))), max_depth_m)
    first = _first_hole(grid.valid, grid.beyond, grid.depth_m, bands.cells, bands.width, limit_m, unmeasured)
    # Nearer than the lowest row nothing can be seen: with a hole there, nothing is known.
    known: FloatArray = np.where(first == 0, 0.0, reach_m[first])
    return known, float(floor_forward[unmeasured - 1]) if unmeasured else 0.0


@compiled("boolean[:, ::1], boolean[:, ::1], float32[:, ::1], int32[:, ::1], int64, float32[::1], int64")
def _first_hole(
    valid: BoolGrid,
    beyond: BoolGrid,
    depth_m: FloatGrid,
    cells: NDArray[np.int32],
    width: int,
    limit_m: NDArray[np.float32],
    unmeasured: int,
) -> NDArray[np.intp]:
    """(B,) row from the bottom on, 0 the lowest, at which the floor ends: the first of two in a row that show
    less than half of it; the last one may be alone; len(limit_m) where there is none. 0 where a hole comes
    before any floor.

    limit_m (k,): what is farther in the lowest k rows is no floor. unmeasured: so many of these are too near
    to be measured: no data there is no hole, but what is measured and is no floor is one as elsewhere.
    """
    bands, rows = cells.shape[1] // width, len(limit_m)
    depth, is_valid, is_beyond = depth_m.ravel(), valid.ravel(), beyond.ravel()
    result = np.empty(bands, np.intp)
    for band in range(bands):
        first, shown, before = rows, False, False
        for row in range(rows):
            floor, nothing = 0, 0
            for place in range(band * width, (band + 1) * width):
                cell = cells[len(cells) - 1 - row, place]
                if cell >= 0:
                    floor += is_valid[cell] and depth[cell] <= limit_m[row]
                    nothing += not (is_valid[cell] or is_beyond[cell])
            hole = 2 * floor < width and not (row < unmeasured and 2 * nothing >= width)
            shown |= 2 * floor >= width
            # A single row may be lost to noise.
            if hole and (before or row == rows - 1):
                first = row - 1 if before else row
                break
            before = hole
        result[band] = first if shown or not unmeasured else 0
    return result
