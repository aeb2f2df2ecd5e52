"""What moves reaches down as far as what it was cut out of does, and no farther."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from config.perception import TYPICAL_DEPTH_NOISE, DepthNoise
from hal.types import FloatArray
from tests.support.grids import LEVEL_UP, grid_of, labelled, nearest, plate, wall
from vision.bodies.grounding import extend_to_floor
from vision.depth import regions
from vision.depth.depth_grid import BoolGrid

HEAD = plate(4.0, (-0.2, 0.2), (-0.7, -0.3)) > 0.0
BODY = plate(4.0, (-0.3, 0.3), (-0.3, 0.9)) > 0.0
UNDER_HEAD = plate(4.0, (-0.2, 0.2), (-0.3, 0.9)) > 0.0
MOVER = np.array([True, False])
NOISE = TYPICAL_DEPTH_NOISE


def given(
    depth_m: FloatArray,
    own: BoolGrid,
    other: BoolGrid,
    chosen: tuple[bool, bool] = (True, False),
    mover: NDArray[np.bool_] = MOVER,
    noise: DepthNoise = NOISE,
) -> tuple[BoolGrid, regions.Regions]:
    """The cells that the first track is given, and what both measure with them."""
    grid, labels = grid_of(depth_m, LEVEL_UP, 1.0), labelled(own, other)
    measured = regions.measure(grid, labels, 2)
    whole, standing_up = extend_to_floor(grid, labels, measured, np.array(chosen), mover, noise)
    return (whole == 1) & (labels != 1), standing_up


@pytest.mark.parametrize(("quadratic_per_m", "taken"), [(0.0075, True), (0.001, False)])
def test_how_far_behind_it_goes_on_depends_on_the_noise_of_depth(quadratic_per_m: float, taken: bool) -> None:
    """0.5 m behind, 4 m ahead: 0.3 m and two sigmas are 0.54 m with the usual noise, 0.33 m with little."""
    depth_m = nearest(np.where(HEAD, 4.0, 0.0), np.where(BODY | UNDER_HEAD, 4.5, 0.0))
    cells, _ = given(depth_m, HEAD, ~HEAD, noise=DepthNoise(quadratic_per_m=quadratic_per_m))
    assert cells.any() == taken


def test_a_head_cut_out_of_a_wall_reaches_down_to_the_floor() -> None:
    """The wall is 0.3 m behind, which depth does not tell apart from him at the legs."""
    depth_m = nearest(np.where(HEAD | BODY, 4.0, 0.0), wall(4.3))
    cells, measured = given(depth_m, HEAD, ~HEAD)
    np.testing.assert_array_equal(cells[:, HEAD.any(axis=0)].any(axis=0), True)
    assert not cells[:, ~HEAD.any(axis=0)].any()
    assert not (cells & HEAD).any()
    assert measured.extent_m[0, 1] > 2.0  # the image ends 1.6 m below its middle there
    assert measured.position_m[0, 1] > 0.3


def test_a_mover_is_extended_down_to_where_the_body_around_it_ends() -> None:
    cells, measured = given(np.where(HEAD | BODY, 4.0, 0.0), HEAD, BODY & ~HEAD)
    np.testing.assert_array_equal(cells, UNDER_HEAD & ~HEAD)
    np.testing.assert_allclose(measured.extent_m[0, 1], 1.6, atol=0.06)


def test_standing_track_keeps_its_measures() -> None:
    """These cells may be its own, after all: it has not become half as wide."""
    depth_m = np.where(HEAD | BODY, 4.0, 0.0)
    before = regions.measure(grid_of(depth_m, LEVEL_UP, 1.0), labelled(HEAD, BODY & ~HEAD), 2)
    _, measured = given(depth_m, HEAD, BODY & ~HEAD)
    np.testing.assert_array_equal(measured.bbox_px[1], before.bbox_px[1])
    assert measured.cells[1] == before.cells[1]
    assert measured.cells[0] > before.cells[0]


@pytest.mark.parametrize(("table_m", "parts"), [(3.0, True), (4.0, False), (5.5, True), (0.0, False)])
def test_something_at_another_depth_parts_it_from_what_is_below(table_m: float, parts: bool) -> None:
    """A table before him, or the room seen under a coat on a hook; without data nothing is told."""
    gap = plate(4.0, (-1.0, 1.0), (0.1, 0.3)) > 0.0
    depth_m = np.where(gap, table_m, np.where(HEAD | BODY, 4.0, 0.0))
    legs = BODY & (np.cumsum(gap, axis=0) > 0) & ~gap
    cells, _ = given(depth_m, HEAD, BODY & ~gap & ~HEAD)
    assert (cells & legs).any() == (not parts)


def test_another_mover_keeps_what_is_its_own() -> None:
    cells, _ = given(np.where(HEAD | BODY, 4.0, 0.0), HEAD, BODY & ~HEAD, mover=np.array([True, True]))
    assert not cells.any()


def test_a_mover_that_already_reaches_down_is_not_extended_beside_its_foot() -> None:
    """One column of him reaches down already: beside it is what he passes by."""
    leg = plate(4.0, (-0.2, -0.1), (-0.3, 0.9)) > 0.0
    cells, _ = given(np.where(HEAD | BODY, 4.0, 0.0), HEAD | leg, BODY & ~HEAD & ~leg)
    assert not cells.any()
    short = plate(4.0, (-0.2, -0.1), (-0.3, 0.6)) > 0.0
    cells, _ = given(np.where(HEAD | BODY, 4.0, 0.0), HEAD | short, BODY & ~HEAD & ~short)
    assert cells.any()


def test_only_those_chosen_and_seen_are_looked_at() -> None:
    depth_m = np.where(HEAD | BODY, 4.0, 0.0)
    grid, labels = grid_of(depth_m, LEVEL_UP, 1.0), labelled(HEAD, BODY & ~HEAD)
    measured = regions.measure(grid, labels, 2)
    whole, standing_up = extend_to_floor(grid, labels, measured, np.array([False, False]), MOVER, NOISE)
    assert whole is labels
    assert standing_up is measured
    hidden = labelled(np.zeros_like(HEAD), BODY)
    nothing = regions.measure(grid, hidden, 2)
    assert extend_to_floor(grid, hidden, nothing, np.array([True, False]), MOVER, NOISE)[0] is hidden


def test_no_body_is_extended_down_to_an_unknown_floor() -> None:
    labels = labelled(HEAD, BODY & ~HEAD)
    for up, alike in ((LEVEL_UP, False), (None, True)):
        grid = grid_of(np.where(HEAD | BODY, 4.0, 0.0), up)
        whole, _ = extend_to_floor(
            grid, labels, regions.measure(grid, labels, 2), np.array([True, False]), MOVER, NOISE
        )
        assert (whole is labels) == alike
