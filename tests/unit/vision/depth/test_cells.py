"""In which cell of the depth grid pixels and rays fall."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.support.grids import COLUMNS, OFFSET_PX, ROWS, STEP_PX, X, Y
from vision.depth.cells import lattice_of, nearest_cell, place_of

LATTICE = lattice_of(X.astype(np.float32), Y.astype(np.float32))


def test_the_cell_of_an_image_point_is_the_nearest_one() -> None:
    for cell in range(COLUMNS):
        for off in (-0.4, 0.0, 0.4):
            assert nearest_cell(OFFSET_PX + STEP_PX * (cell + off), OFFSET_PX, STEP_PX, COLUMNS) == cell


def test_an_image_point_beside_the_grid_has_the_cell_at_its_rim() -> None:
    far = 10.0 * STEP_PX * COLUMNS
    assert nearest_cell(-far, OFFSET_PX, STEP_PX, COLUMNS) == 0
    assert nearest_cell(far, OFFSET_PX, STEP_PX, COLUMNS) == COLUMNS - 1


@pytest.mark.parametrize("off", [-0.4, 0.0, 0.4])
def test_the_cell_of_a_ray_is_the_nearest_one(off: float) -> None:
    for row, column in ((0, 0), (7, 30), (ROWS - 1, COLUMNS - 1)):
        ray = X[column] + off * (X[1] - X[0]), Y[row] + off * (Y[1] - Y[0])
        place = place_of(np.float32(ray[0]), np.float32(ray[1]), LATTICE)
        assert tuple(math.floor(one) for one in place) == (column, row)


def test_a_ray_beside_the_grid_has_no_cell() -> None:
    left, top = place_of(np.float32(2 * X[0] - X[1]), np.float32(2 * Y[0] - Y[1]), LATTICE)
    assert left < 0.0
    assert top < 0.0
    right, bottom = place_of(np.float32(2 * X[-1] - X[-2]), np.float32(2 * Y[-1] - Y[-2]), LATTICE)
    assert right >= COLUMNS
    assert bottom >= ROWS
