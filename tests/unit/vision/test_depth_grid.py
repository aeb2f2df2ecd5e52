"""Cells of the grid, the image points that they stand for, and the way into space and back."""

from __future__ import annotations

import numpy as np

from tests.support.grids import COLUMNS, OFFSET_PX, ROWS, STEP_PX, grid_of

GRID = grid_of(np.random.default_rng(1).uniform(2.0, 4.0, (ROWS, COLUMNS)))


def test_the_cell_of_an_image_point_is_the_nearest_one() -> None:
    row, column = np.indices((ROWS, COLUMNS))
    u, v = OFFSET_PX + STEP_PX * (column + 0.4), OFFSET_PX + STEP_PX * (row - 0.4)
    flat = np.arange(ROWS * COLUMNS).reshape(ROWS, COLUMNS)
    np.testing.assert_array_equal(GRID.cells(u.astype(float), v.astype(float)), flat)


def test_an_image_point_beside_the_grid_has_the_cell_at_its_rim() -> None:
    far = 10.0 * STEP_PX * COLUMNS
    u, v = np.array([-far, far, -far, far]), np.array([-far, -far, far, far])
    last = ROWS * COLUMNS - 1
    np.testing.assert_array_equal(GRID.cells(u, v), [0, COLUMNS - 1, last - COLUMNS + 1, last])


def test_the_points_of_cells_fall_into_these_cells() -> None:
    cells = np.arange(ROWS * COLUMNS)
    found, inside, inverse = GRID.project(GRID.points(cells))
    assert inside.all()
    np.testing.assert_array_equal(found, cells)
    np.testing.assert_allclose(inverse, GRID.inverse_depth.ravel(), rtol=1e-6)
