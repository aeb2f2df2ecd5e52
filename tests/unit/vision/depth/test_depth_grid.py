"""Cells of the grid, the image points that they stand for, and the way into space and back."""

from __future__ import annotations

import numpy as np
import pytest

from config.perception import PerceptionConfig
from hal.types import CameraMount, RgbdFrame
from tests.support.grids import CAMERA, COLUMNS, OFFSET_PX, ROWS, STEP_PX, grid_of
from vision.depth.depth_grid import make_grid

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


def test_the_points_of_cells_are_seen_in_these_cells() -> None:
    cells = np.arange(ROWS * COLUMNS)
    x, y, z = GRID.points(cells).astype(float)
    found = GRID.cells(x / z * CAMERA.fx + CAMERA.cx, y / z * CAMERA.fy + CAMERA.cy)
    np.testing.assert_array_equal(found, cells)
    np.testing.assert_array_equal(z, GRID.depth_m.ravel())


@pytest.mark.parametrize("mount", [None, CameraMount(0.0, 0.0, 0.5, 0.0)])
@pytest.mark.parametrize(("scale_m", "range_m"), [(1e-4, 6.5535), (1.5e-4, 9.83), (0.001, 10.0)])
def test_depth_that_is_cut_off_lies_beyond(scale_m: float, range_m: float, mount: CameraMount | None) -> None:
    """65535 is what is as far or farther: neither a wall there nor a place without data."""
    raw = np.full((CAMERA.height, CAMERA.width), 65_535, np.uint16)
    raw[: CAMERA.height // 2] = round(6.0 / scale_m)
    colour = np.zeros((*raw.shape, 3), np.uint8)
    grid = make_grid(RgbdFrame(colour, raw, scale_m, 0, 0.0, 0, CAMERA), PerceptionConfig(), mount)
    upper = slice(0, ROWS // 2)
    assert grid.valid[upper].all()
    np.testing.assert_allclose(grid.depth_m[upper], 6.0, rtol=1e-4)
    np.testing.assert_array_equal(grid.beyond, ~grid.valid)
    assert not grid.valid[ROWS // 2 :].any()
    assert grid.range_m == pytest.approx(range_m, abs=0.001)
