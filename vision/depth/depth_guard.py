"""What edges cannot see: the nearest surface in every direction, and how far the space was seen at all.

A plain wall has no fragments, and a corridor without valid depth (glass, black, too near) is not free.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray
from vision.depth.depth_grid import BoolGrid, DepthGrid, FloatGrid
from vision.depth.level_bands import LevelBands, level_bands
from vision.depth.near_floor import FLOOR_EXCESS
from vision.scene import NEVER_M, FreeSpace

_SUPPORT = 3  # this many cells of a band must agree before they are a surface
_HOLE_ROWS = 2  # one row is lost to noise now and then
_BLANK_SHARE = 0.1  # of a band's cells: stray ones are measured even where something covers the lens
# Band and distance in one whole number: 80 bands, and up to 64 m in steps of 4 micrometres.
_BAND_SHIFT = 24
_UNITS_PER_M = 2.0**18
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
    nearest = _nearest_m(grid, obstacle, bands)
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
        measured = bands.count(grid.valid | grid.beyond, rows).sum(axis=0, dtype=np.int64)
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


def _nearest_m(grid: DepthGrid, obstacle: BoolGrid, bands: LevelBands) -> FloatArray:
    """(B,) forward distance of the nearest surface that enough obstacle cells agree on, inf without."""
    if bands.band is not None:
        return _nearest_fanned_m(grid.forward_m, obstacle, bands.band, len(bands))
    mask, columns = obstacle.view(np.uint8), obstacle.shape[1]
    support = min(_SUPPORT, len(obstacle) * bands.width)
    _, top, _, height = cv2.boundingRect(mask)  # the rows in which something stands
    forward = np.full((max(height, support), len(bands) * bands.width), np.inf, np.float32)
    if height > 0:
        rows = slice(top, top + height)
        cv2.copyTo(grid.forward_m[rows], mask[rows], forward[:height, :columns])
    upright = np.asarray(cv2.transpose(forward), np.float32).reshape(len(bands), -1)
    return np.sort(upright, axis=1)[:, support - 1].astype(float)


def _nearest_fanned_m(
    forward_m: FloatGrid, obstacle: BoolGrid, band: NDArray[np.int32], bands: int
) -> FloatArray:
    """The same where each cell has its band (h, w)."""
    cells = np.flatnonzero(obstacle)
    # Sorted by band and then by distance: whole numbers of 32 bits are sorted fastest.
    key = (np.maximum(forward_m.ravel().take(cells), 0.0) * np.float32(_UNITS_PER_M)).astype(np.int32)
    key += band.ravel().take(cells) << _BAND_SHIFT
    key.sort()
    begin = key.searchsorted(np.arange(bands + 1, dtype=np.int32) << _BAND_SHIFT)
    last = begin[:-1] + _SUPPORT - 1
    nearest = np.full(bands, np.inf)
    there = last < begin[1:]
    nearest[there] = (key[last[there]] & ((1 << _BAND_SHIFT) - 1)) / _UNITS_PER_M
    return nearest


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
    lower = slice(len(grid.y) - len(rows), None)
    seen = grid.valid[lower] & (grid.depth_m[lower] <= limit_m[::-1, None])
    hole = bands.count(seen, len(grid.y))[::-1] < 0.5 * bands.width
    shown = ~hole
    blank = int(np.count_nonzero(floor_depth < unmeasured_m))
    if blank:
        # Too near to be measured. What is measured there, but not on the floor, is a hole as elsewhere.
        nothing = ~(grid.valid[-blank:] | grid.beyond[-blank:])
        hole[:blank] &= bands.count(nothing, len(grid.y))[::-1] < 0.5 * bands.width
    # A single row may be lost to noise; two in a row are a hole. After the last row one is sure.
    run = np.ones((len(rows) + 1, len(bands)), np.bool_)
    run[:-1] = hole
    for shift in range(1, _HOLE_ROWS):
        run[: len(rows) - shift] &= hole[shift:]
    first = run.argmax(axis=0)
    # Where even the uppermost ray meets the floor, nothing beyond that was looked at.
    horizon_m = max_depth_m if len(rows) < len(grid.y) else floor_forward[-1]
    reach = np.concatenate((floor_forward, (horizon_m,)))
    # Nearer than the lowest row nothing can be seen: with a hole there, nothing is known. Nor is it where a
    # hole comes before any floor.
    known = np.minimum(reach[first], max_depth_m)
    nowhere, blind_m = first == 0, 0.0
    if blank:
        nowhere |= ~shown.any(axis=0) | (shown.argmax(axis=0) >= first)
        blind_m = float(floor_forward[blank - 1])
    return np.where(nowhere, 0.0, known).astype(float), blind_m
