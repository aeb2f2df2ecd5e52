"""Upright bands of the view, in which free space is given, and the cells of the depth grid within each band.

A band is a vertical sector over the floor: the ratio of right to forward is the same throughout. For a camera
that looks straight ahead a band is a group of image columns. The farther down a camera looks, the more the
bands fan out towards the lower rows: at 30 degrees, columns would report an edge at 0.40 m to the side as
0.44 m.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray
from vision.depth.depth_grid import DepthGrid, floor_ray

BANDS = 80  # maximum number: over 60 degrees a band is 8 cm wide 6 m ahead
_FAN_BANDS = 1.5  # columns are used as bands where this puts no cell off by more than this many bands
_PITCH_RAD = math.radians(0.1)  # the pitch is rounded to this: less moves no cell into another band
_MIN_AHEAD = 0.05  # minimum metres along the floor per metre of depth: rays straight down have less


@dataclass(frozen=True, slots=True, eq=False)
class LevelBands:
    """B bands across the view.

    bearing_tan: right over forward of the middle of each band, (B,).
    half_width_tan: half the width of a band.
    width: cells per row in a band.
    band: index of the band in which each cell lies, clamped at the sides, (h, w).
    cells: flat cells along each row, band after band, -1 beyond the image, (h, B * width).
    """

    bearing_tan: FloatArray
    half_width_tan: float
    width: int
    band: NDArray[np.int32]
    cells: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.bearing_tan)


def level_bands(grid: DepthGrid) -> LevelBands:
    """At most 80 bands across the view of grid; cached, so that one camera has one object."""
    x, y = grid.x, grid.y
    # A rounded pitch makes the cache hit; it is exact enough.
    pitch_rad = _PITCH_RAD * round(grid.pitch_rad / _PITCH_RAD) if math.isfinite(grid.pitch_rad) else None
    return _bands(float(x[0]), float(x[1] - x[0]), len(x), float(y[0]), float(y[-1]), len(y), pitch_rad)


@lru_cache(maxsize=64)
def _bands(
    x0: float, step: float, columns: int, y0: float, y1: float, rows: int, pitch_rad: float | None
) -> LevelBands:
    width = -(-columns // BANDS)
    bands = -(-columns // width)  # the last one may reach beyond the image, where nothing is seen
    middle: FloatArray = x0 + step * (width * np.arange(bands, dtype=np.float64) + 0.5 * (width - 1))
    half_width = 0.5 * width * step
    column = np.arange(columns)
    band = np.broadcast_to(column // width, (rows, columns))
    cells = np.arange(bands * width) + columns * np.arange(rows)[:, None]
    cells[:, columns:] = -1
    if pitch_rad is not None:
        tilt, _ = floor_ray(0.5 * (y0 + y1), pitch_rad)
        middle /= tilt
        half_width /= tilt
        ahead = np.maximum(floor_ray(np.linspace(y0, y1, rows), pitch_rad)[0], _MIN_AHEAD)[:, None]
        x = x0 + step * column
        off = max(abs(x0), abs(float(x[-1]))) * float(np.abs(1.0 / ahead - 1.0 / tilt).max())
        if off > _FAN_BANDS * 2.0 * half_width:
            edge = middle[0] - half_width
            band = np.floor((x / ahead - edge) / (2.0 * half_width)).clip(0, bands - 1)
            # Wide enough that no cell is left out in the row with the largest ahead, where a band is widest.
            width = math.ceil(2.0 * half_width * float(ahead.max()) / step)
            along = edge + 2.0 * half_width / width * (np.arange(bands * width) + 0.5)
            nearest = np.rint((along * ahead - x0) / step).astype(np.intp)
            inside = (nearest >= 0) & (nearest < columns)
            cells = np.where(inside, nearest + columns * np.arange(rows)[:, None], -1)
    found = LevelBands(
        bearing_tan=middle,
        half_width_tan=half_width,
        width=width,
        band=np.ascontiguousarray(band, np.int32),
        cells=np.ascontiguousarray(cells, np.int32),
    )
    for shared in (found.bearing_tan, found.band, found.cells):
        shared.setflags(write=False)
    return found
