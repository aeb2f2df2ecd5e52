"""Cells of the grid, the image points that they stand for, and the way into space and back."""

from __future__ import annotations

import numpy as np
import pytest

from config.perception import PerceptionConfig
from hal.types import CameraMount, RgbdFrame
from tests.support.grids import CAMERA, COLUMNS, OFFSET_PX, ROWS, STEP_PX, grid_of
from vision.depth.depth_grid import make_grid

GRID = grid_of(np.random.default_rng(1).uniform(2.0, 4.0, (ROWS, COLUMNS)))


def test_the_points_of_cells_are_seen_in_these_cells() -> None:
    row, column = np.indices((ROWS, COLUMNS)).reshape(2, -1)
    x, y, z = GRID.points(row * COLUMNS + column).astype(float)
    np.testing.assert_allclose(x / z * CAMERA.fx + CAMERA.cx, OFFSET_PX + STEP_PX * column, atol=1e-3)
    np.testing.assert_allclose(y / z * CAMERA.fy + CAMERA.cy, OFFSET_PX + STEP_PX * row, atol=1e-3)
    np.testing.assert_array_equal(z, GRID.depth_m.ravel())


@pytest.mark.parametrize("shape", [(31, 40), (40, 31)])
def test_an_image_without_room_to_look_around_is_refused(shape: tuple[int, int]) -> None:
    raw, colour = np.full(shape, 2000, np.uint16), np.zeros((*shape, 3), np.uint8)
    with pytest.raises(ValueError, match=f"depth of {shape[1]}x{shape[0]} pixels, where at least 32"):
        make_grid(RgbdFrame(colour, raw, 0.001, 0, 0.0, 0, CAMERA), PerceptionConfig(), None)


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
