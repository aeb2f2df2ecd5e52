"""In which cell of the depth grid a pixel or a ray falls, for compiled steps."""

from __future__ import annotations

import numpy as np

from hal.compiled import inlined
from vision.depth.depth_grid import DepthGrid, FloatGrid

# Rays x and y of the first column and row, and how many columns and rows there are per unit of these.
Lattice = tuple[np.float32, np.float32, np.float32, np.float32]


@inlined
def nearest_cell(pixel: float, offset_px: float, step_px: float, count: int) -> int:
    """The row of a pixel's v, or the column of its u, in a grid of count; clamped at the border."""
    return min(max(int(np.rint((pixel - offset_px) / step_px)), 0), count - 1)


@inlined
def cell_at(grid: DepthGrid, u: float, v: float) -> tuple[int, int]:
    """Row and column of the cell of a pixel; clamped at the border."""
    height, width = grid.depth_m.shape
    row = nearest_cell(v, grid.offset_px, grid.step_px, height)
    return row, nearest_cell(u, grid.offset_px, grid.step_px, width)


@inlined
def lattice_of(ray_x: FloatGrid, ray_y: FloatGrid) -> Lattice:
    """The Lattice of a grid, to be made once for many rays. ray_x (w,), ray_y (h,): x and y of DepthGrid."""
    left, top, one = ray_x[0], ray_y[0], np.float32(1.0)
    return left, top, one / (ray_x[1] - left), one / (ray_y[1] - top)


@inlined
def place_of(x: np.float32, y: np.float32, lattice: Lattice) -> tuple[np.float32, np.float32]:
    """Column and row of the cell in which a ray x, y at z = 1 falls, as real numbers to be rounded down.

    They are negative, or not less than the numbers of columns and rows, where the ray passes the grid.
    """
    left, top, per_column, per_row = lattice
    return (x - left) * per_column + np.float32(0.5), (y - top) * per_row + np.float32(0.5)
