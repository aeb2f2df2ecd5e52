"""Where parts end freely: in front of what is farther, and not beside what hides them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hal.types import FloatArray
from tests.support.grids import grid_of, labelled, nearest, no_depth, plate, wall
from vision.depth.rims import LEFT, NO_RIM, RIGHT, free_rims

BODY = plate(4.0, (-0.3, 0.3), (-0.6, 0.6))
ROWS, COLUMNS = np.nonzero(BODY > 0.0)


def sides(depth_m: FloatArray) -> list[bool]:
    """Whether all rows of the body's left and of its right side are free rims; they must be alike."""
    rims = free_rims(grid_of(depth_m), labelled(depth_m == 4.0), 1)
    mine = np.unique(np.nonzero(depth_m == 4.0)[0])
    free = rims.column[0][:, mine] != NO_RIM
    assert (free.all(axis=1) == free.any(axis=1)).all()
    return [bool(side) for side in free.all(axis=1)]


def test_a_free_rim_is_the_outermost_cell_of_each_row() -> None:
    rims = free_rims(grid_of(nearest(BODY, wall(6.0))), labelled(BODY > 0.0), 2)
    assert set(rims.column[0, LEFT, ROWS.min() : ROWS.max() + 1]) == {COLUMNS.min()}
    assert set(rims.column[0, RIGHT, ROWS.min() : ROWS.max() + 1]) == {COLUMNS.max()}
    assert (rims.column[0, :, : ROWS.min()] == NO_RIM).all()
    np.testing.assert_allclose(rims.inverse[0], 0.25, rtol=1e-6)
    assert (rims.column[1] == NO_RIM).all()  # no cell has its number
    assert not rims.inverse[1].any()


def test_a_rim_beside_something_nearer_is_not_free() -> None:
    occluder = plate(2.0, (-1.0, -0.05), (-1.0, 1.0))
    assert sides(nearest(BODY, occluder, wall(6.0))) == [False, True]


@pytest.mark.parametrize(("cells", "free"), [(5, False), (6, True)])
def test_the_stereo_shadow_of_what_hides_a_part_is_no_free_rim(cells: int, free: bool) -> None:
    """Without depth in more cells than a shadow has, the view goes on behind the part."""
    depth_m = nearest(BODY, wall(6.0))
    depth_m[:, COLUMNS.min() - cells : COLUMNS.min()] = 0.0
    depth_m[:, : COLUMNS.min() - cells] = 2.0
    assert sides(depth_m) == [free, True]


@pytest.mark.parametrize(("wall_m", "free"), [(4.15, False), (4.3, True)])
def test_the_background_must_be_farther_than_depth_noise(wall_m: float, free: bool) -> None:
    """1/4 - 1/4.2 = 0.012."""
    assert sides(nearest(BODY, wall(wall_m))) == [free, free]


def test_a_rim_before_what_is_beyond_the_range_or_has_no_depth_is_free() -> None:
    assert sides(BODY) == [True, True]
    grid = replace(grid_of(BODY), beyond=BODY == 0.0, range_m=10.0)
    assert (free_rims(grid, labelled(BODY > 0.0), 1).column[0][:, ROWS] != NO_RIM).all()
    at_the_end = replace(grid, range_m=4.1)
    assert (free_rims(at_the_end, labelled(BODY > 0.0), 1).column == NO_RIM).all()


def test_the_border_of_the_image_is_no_rim() -> None:
    depth_m = no_depth()
    depth_m[10:30, :20] = 4.0
    assert sides(depth_m) == [False, True]


@pytest.mark.parametrize(("cells", "free"), [(1, False), (10, False), (11, True)])
def test_the_border_of_the_depth_cameras_view_is_no_rim(cells: int, free: bool) -> None:
    """Up to an eighth of 80 columns: a wall that is cut there would go as the camera turns."""
    depth_m = wall(6.0)
    depth_m[10:30, :40] = 4.0
    depth_m[:, :cells] = 0.0
    assert sides(depth_m) == [free, True]
    assert sides(depth_m[:, ::-1].copy()) == [True, free]


def test_holes_inside_a_part_are_no_rims() -> None:
    depth_m = nearest(BODY, wall(6.0))
    middle = (COLUMNS.min() + COLUMNS.max()) // 2
    depth_m[ROWS.min() : ROWS.max() + 1, middle] = 6.0
    rims = free_rims(grid_of(depth_m), labelled(depth_m == 4.0), 1)
    assert set(rims.column[0, LEFT, ROWS]) == {COLUMNS.min()}
    assert set(rims.column[0, RIGHT, ROWS]) == {COLUMNS.max()}
