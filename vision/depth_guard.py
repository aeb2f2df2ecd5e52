"""What edges cannot see: the nearest surface in every direction, and how far the space was seen at all.

A plain wall has no fragments, and a corridor without valid depth (glass, black, too near) is not free.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.depth_grid import BoolGrid, DepthGrid
from vision.near_floor import FLOOR_EXCESS
from vision.scene import FreeSpace

BANDS = 80
_SUPPORT = 3  # this many cells of a band must agree before they are a surface
_HOLE_ROWS = 2


def free_space(
    grid: DepthGrid, obstacle: BoolGrid, max_depth_m: float, unmeasured_m: float = 0.0
) -> FreeSpace:
    """Nearest obstacle cell (supported) and known distance for each of at most 80 upright bands.

    obstacle (h, w): cells between clearance and the robot's height; all valid ones where the floor is not
    known. unmeasured_m: floor nearer than this depth cannot be measured (vision/near_floor.py), and no data
    there is no hole; 0.0: all can. Without a known mounting, space is known up to the nearest surface only.
    """
    columns = obstacle.shape[1]
    width = -(-columns // BANDS)
    bands = -(-columns // width)  # the last one may reach beyond the image: nothing is seen there
    nearest = _nearest_m(grid, obstacle, bands, width)
    step = float(grid.x[1] - grid.x[0])
    x = float(grid.x[0]) + step * (width * np.arange(bands) + 0.5 * (width - 1))
    half_width = 0.5 * width * step
    middle_y = 0.5 * float(grid.y[(len(grid.y) - 1) // 2] + grid.y[len(grid.y) // 2])
    mounted = math.isfinite(grid.pitch_rad)
    tilt = math.cos(grid.pitch_rad) - middle_y * math.sin(grid.pitch_rad) if mounted else 1.0
    if not mounted:
        known = np.where(np.isfinite(nearest), nearest, 0.0)
    else:
        known = _known_m(grid, bands, width, max_depth_m, unmeasured_m)
        # What stands there hides what is behind it.
        known = np.where(np.isfinite(nearest), nearest, known)
    return FreeSpace(x / tilt, half_width / tilt, nearest, np.minimum(known, max_depth_m))


def _nearest_m(grid: DepthGrid, obstacle: BoolGrid, bands: int, width: int) -> NDArray[np.float64]:
    """(bands,) forward distance of the nearest surface that enough obstacle cells agree on, inf without."""
    mask, columns = obstacle.view(np.uint8), obstacle.shape[1]
    support = min(_SUPPORT, len(obstacle) * width)
    _, top, _, height = cv2.boundingRect(mask)  # the rows in which something stands
    forward = np.full((max(height, support), bands * width), np.inf, np.float32)
    if height > 0:
        rows = slice(top, top + height)
        cv2.copyTo(grid.forward_m[rows], mask[rows], forward[:height, :columns])
    upright = np.asarray(cv2.transpose(forward), np.float32).reshape(bands, -1)
    return np.sort(upright, axis=1)[:, support - 1].astype(float)


def _known_m(
    grid: DepthGrid, bands: int, width: int, max_depth_m: float, unmeasured_m: float
) -> NDArray[np.float64]:
    """(bands,) how far the floor, or something on it, was seen without a hole."""
    cos_pitch, sin_pitch = math.cos(grid.pitch_rad), math.sin(grid.pitch_rad)
    y = grid.y.astype(float)
    drop = y * cos_pitch + sin_pitch
    below = drop > grid.camera_height_m / (1.5 * max_depth_m)
    rows = np.flatnonzero(below)[::-1]  # from the bottom of the image outwards
    if len(rows) == 0:
        return np.zeros(bands)
    floor_depth = grid.camera_height_m / drop[rows]
    floor_forward = floor_depth * (cos_pitch - y[rows] * sin_pitch)
    limit_m = (FLOOR_EXCESS * floor_depth).astype(np.float32)
    lower = slice(len(grid.y) - len(rows), None)
    seen = (grid.valid[lower] & (grid.depth_m[lower] <= limit_m[::-1, None]))[::-1]
    hole = _count(seen, bands, width) < 0.5 * width
    shown = ~hole
    blank = int(np.count_nonzero(floor_depth < unmeasured_m))
    if blank:
        # Too near to be measured. What is measured there, but not on the floor, is a hole as elsewhere.
        nothing = ~(grid.valid[lower] | grid.beyond[lower])[::-1][:blank]
        hole[:blank] &= _count(nothing, bands, width) < 0.5 * width
    # A single row may be lost to noise; two in a row are a hole. After the last row one is sure.
    run = np.ones((len(rows) + 1, bands), np.bool_)
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
    nowhere = (first == 0) | (blank > 0) & (~shown.any(axis=0) | (shown.argmax(axis=0) >= first))
    return np.where(nowhere, 0.0, known).astype(float)


def _count(cells: BoolGrid, bands: int, width: int) -> NDArray[np.uint8]:
    """(h, bands) how many of cells (h, w) are set, by row and band; beside the image there are none."""
    count = np.zeros((len(cells), bands), np.uint8)
    for column in range(width):
        part = cells[:, column::width]
        count[:, : part.shape[1]] += part
    return count
