"""What edges cannot see: the nearest surface in every direction, and how far the space was seen at all.

A plain wall has no fragments, and a corridor without valid depth (glass, black, too near) is not free.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vision.depth_grid import BoolGrid, DepthGrid
from vision.scene import FreeSpace

BANDS = 80
_SUPPORT = 3  # this many cells of a band must agree before they are a surface
_HOLE_ROWS = 2
_FLOOR_EXCESS = 1.35  # a ray that goes this much farther than the floor has found a hole in it


def free_space(grid: DepthGrid, obstacle: BoolGrid, max_depth_m: float) -> FreeSpace:
    """Nearest obstacle cell (supported) and known distance for each of 80 upright bands.

    obstacle (h, w): cells between clearance and the robot's height; all valid ones where the mounting
    is not known. Without a floor to see, space is known up to the nearest surface only.
    """
    rows, columns = obstacle.shape
    bands = min(BANDS, columns)
    width = columns // bands
    used = bands * width
    forward = np.where(obstacle, grid.forward_m, np.float32(np.inf))[:, :used]
    stacked = forward.reshape(rows, bands, width).transpose(1, 0, 2).reshape(bands, rows * width)
    support = min(_SUPPORT, rows * width)
    nearest = np.partition(stacked, support - 1, axis=1)[:, support - 1].astype(float)
    x = grid.x[:used].reshape(bands, width).mean(axis=1).astype(float)
    half_width = 0.5 * width * float(grid.x[1] - grid.x[0])
    tilt = np.cos(grid.pitch_rad) - float(np.median(grid.y)) * np.sin(grid.pitch_rad)
    if grid.height_m is None:
        known = np.where(np.isfinite(nearest), nearest, 0.0)
    else:
        known = _known_m(grid, bands, width, max_depth_m)
        # What stands there hides what is behind it.
        known = np.where(np.isfinite(nearest), nearest, known)
    return FreeSpace(x / tilt, half_width, nearest, np.minimum(known, max_depth_m))


def _known_m(grid: DepthGrid, bands: int, width: int, max_depth_m: float) -> NDArray[np.float64]:
    """(bands,) how far the floor, or something on it, was seen without a hole."""
    cos_pitch, sin_pitch = np.cos(grid.pitch_rad), np.sin(grid.pitch_rad)
    drop = grid.y * cos_pitch + sin_pitch
    below = drop > grid.camera_height_m / (1.5 * max_depth_m)
    rows = np.flatnonzero(below)[::-1]  # from the bottom of the image outwards
    if len(rows) == 0:
        return np.zeros(bands)
    floor_depth = grid.camera_height_m / drop[rows]
    floor_forward = floor_depth * (cos_pitch - grid.y[rows] * sin_pitch)
    depth = grid.depth_m[rows, : bands * width]
    seen = grid.valid[rows, : bands * width] & (depth <= _FLOOR_EXCESS * floor_depth[:, None])
    share = seen.reshape(len(rows), bands, width).mean(axis=2)
    hole = share < 0.5
    # A single row may be lost to noise; two in a row are a hole.
    run = hole.copy()
    for shift in range(1, _HOLE_ROWS):
        run[:-shift] &= hole[shift:]
    first = np.where(run.any(axis=0), run.argmax(axis=0), len(rows))
    # Where even the uppermost ray meets the floor, nothing beyond that was looked at.
    horizon_m = max_depth_m if len(rows) < len(grid.y) else floor_forward[-1]
    reach = np.append(floor_forward, horizon_m)
    # Nearer than the lowest row nothing can be seen: with a hole there, nothing is known.
    return np.where(first == 0, 0.0, np.minimum(reach[np.minimum(first, len(rows))], max_depth_m)).astype(
        float
    )
