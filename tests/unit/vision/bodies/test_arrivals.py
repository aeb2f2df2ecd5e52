"""Surfaces where free space was seen."""

from __future__ import annotations

import numpy as np
import pytest

from config.perception import DepthNoise
from hal.types import FloatArray, Pose
from tests.support.detections import AT_ORIGIN
from tests.support.grids import grid_of, nearest, no_depth, plate, wall
from vision.bodies.arrivals import ARRIVED_UP_TO_S, ViewMemory
from vision.depth.depth_grid import BoolGrid

NOISE = DepthNoise(floor_m=0.005, quadratic_per_m=0.0075)
BACK = wall(6.0)
BODY = plate(3.0, (-0.3, 0.3), (-0.5, 0.5))
MS = 1_000_000


def memory(*views: tuple[int, FloatArray], pose: Pose = AT_ORIGIN) -> ViewMemory:
    """Has seen the views: (milliseconds, depth)."""
    kept = ViewMemory(NOISE)
    for stamp_ms, depth_m in views:
        kept.remember(grid_of(depth_m), pose, stamp_ms * MS)
    return kept


def arrived(kept: ViewMemory, depth_m: FloatArray, now_ms: int = 200, pose: Pose = AT_ORIGIN) -> BoolGrid:
    grid = grid_of(depth_m)
    return kept.changes(grid, grid.valid, pose, now_ms * MS).arrived


def inner(depth_m: FloatArray) -> BoolGrid:
    """Without its corners, where fewer than five of nine cells are its own."""
    rows, columns = np.nonzero(depth_m > 0.0)
    mask = depth_m > 0.0
    for row in (rows.min(), rows.max()):
        mask[row, [columns.min(), columns.max()]] = False
    return mask


def test_surface_before_a_wall_that_was_seen_has_arrived() -> None:
    found = arrived(memory((0, BACK)), nearest(BODY, BACK))
    assert found[inner(BODY)].all()
    assert not found[BODY == 0.0].any()


@pytest.mark.parametrize(("after_s", "still"), [(-0.01, True), (0.01, False)])
def test_surface_at_rest_counts_as_arrived_for_a_limited_time(after_s: float, still: bool) -> None:
    now_ms = round(1e3 * (ARRIVED_UP_TO_S + after_s))
    assert arrived(memory((0, BACK)), nearest(BODY, BACK), now_ms).any() == still


def test_surface_that_was_there_before_has_not_arrived() -> None:
    both = nearest(BODY, BACK)
    assert not arrived(memory((0, both)), both).any()


@pytest.mark.parametrize(("age_ms", "known"), [(600, True), (320, True), (200, False)])
def test_surface_that_was_there_for_a_while_has_stayed(age_ms: int, known: bool) -> None:
    """Half of 0.6 s at least; what was seen later only may have come since."""
    before, now = nearest(BODY, BACK), nearest(BODY, plate(3.0, (0.4, 0.6), (-0.5, 0.5)), BACK)
    grid = grid_of(now)
    changes = memory((0, before)).changes(grid, grid.valid, AT_ORIGIN, age_ms * MS)
    assert changes.stayed_s == (pytest.approx(age_ms * 1e-3) if known else 0.0)
    stayed = changes.stayed
    new = (now == 3.0) & (before != 3.0)
    assert bool(stayed[inner(BODY)].all()) == known
    assert not stayed[new].any()


def test_surface_that_was_hidden_or_not_measured_has_not_stayed() -> None:
    grid = grid_of(BACK)
    for before in (nearest(BODY, BACK), np.where(BODY > 0.0, 0.0, BACK)):
        stayed = memory((0, before)).changes(grid, grid.valid, AT_ORIGIN, 600 * MS).stayed
        assert not stayed[inner(BODY)].any()


def surely_stayed(before_m: FloatArray, now_m: FloatArray, age_ms: int = 1000) -> tuple[BoolGrid, float]:
    grid = grid_of(now_m)
    return memory((0, before_m)).stayed(grid, grid.valid, AT_ORIGIN, age_ms * MS, 1.0)


@pytest.mark.parametrize(("age_ms", "known"), [(480, False), (520, True), (1480, True), (1520, False)])
def test_surface_is_compared_with_a_view_of_about_the_wanted_time(age_ms: int, known: bool) -> None:
    stayed, stayed_s = surely_stayed(BACK, nearest(BODY, BACK), age_ms)
    assert stayed_s == (pytest.approx(age_ms * 1e-3) if known else 0.0)
    assert stayed.any() == known
    assert not stayed[inner(BODY)].any()


@pytest.mark.parametrize(("nearer_m", "same"), [(0.13, True), (0.15, False)])
def test_surface_surely_stayed_within_half_of_the_margin(nearer_m: float, same: bool) -> None:
    """3 m away: 0.05 m and 1.75 sigmas of 9 * 0.0075 * 0.55 * sqrt(2) m are 0.142 m."""
    stayed, _ = surely_stayed(wall(3.0 + nearer_m), nearest(BODY, wall(3.0 + nearer_m)))
    assert bool(stayed[inner(BODY)].all()) == same


def test_lone_cells_have_not_surely_stayed() -> None:
    now_m = wall(5.0)
    now_m[20, 30], now_m[40:43, 30:33] = 6.0, 6.0
    stayed, _ = surely_stayed(BACK, now_m)
    assert not stayed[20, 30]
    assert stayed[41, 31]


def test_surface_uncovered_by_a_leaving_body_has_not_arrived() -> None:
    assert not arrived(memory((0, nearest(BODY, BACK))), BACK).any()


def test_space_without_measurements_was_not_free() -> None:
    assert not arrived(memory((0, no_depth())), BODY).any()


def test_beyond_the_range_is_seen_through_too() -> None:
    found = arrived(memory((0, wall(12.0))), BODY)
    assert found[inner(BODY)].all()


def test_a_wall_that_comes_into_range_has_not_arrived() -> None:
    """The robot drives 0.3 m towards it: 10.2 m was too far to be measured, 9.9 m is not."""
    ahead = Pose(np.eye(3), np.array([0.0, 0.0, 0.3]))
    assert not arrived(memory((0, wall(10.2))), wall(9.9), pose=ahead).any()


def test_nor_has_one_that_comes_to_where_16_bits_end() -> None:
    """With units of 0.1 mm a wall 6.9 m away was cut off to 6.55 m, and was not seen through up to 10 m."""
    ahead, kept = Pose(np.eye(3), np.array([0.0, 0.0, 0.6])), ViewMemory(NOISE)
    kept.remember(grid_of(wall(6.9), max_m=6.55), AT_ORIGIN, 0)
    assert not arrived(kept, wall(6.3), pose=ahead).any()


def test_a_step_within_the_noise_proves_nothing() -> None:
    """In inverse depth 3.5 times root 2 times 0.55 times 0.0075 = 0.0204, and 0.1 m at 3.2 m = 0.0098."""
    assert not arrived(memory((0, wall(3.515))), wall(3.2)).any()  # 0.028 apart
    assert arrived(memory((0, wall(3.565))), wall(3.2))[1:-1, 1:-1].all()  # 0.032


def test_walker_a_metre_before_a_wall_arrives_even_at_five_metres() -> None:
    """A RealSense's depth is off by 0.19 m there, from pixel to pixel; from cell to cell by less."""
    walker = plate(5.0, (-0.3, 0.3), (-0.5, 0.5))
    assert arrived(memory((0, BACK)), nearest(walker, BACK)).any()


@pytest.mark.parametrize(
    ("age_ms", "known"), [(80, False), (120, True), (280, True), (700, True), (950, False)]
)
def test_views_that_are_too_new_or_too_old_do_not_count(age_ms: int, known: bool) -> None:
    """0.2 s ago, give or take half of it, or 0.6 s."""
    assert arrived(memory((0, BACK)), nearest(BODY, BACK), age_ms).any() == known


def test_cells_that_are_alone_do_not_count() -> None:
    speckled = BACK.copy()
    speckled[20, 20] = speckled[40:42, 50:52] = 3.0
    assert not arrived(memory((0, BACK)), speckled).any()


def test_cells_beside_what_was_near_do_not_count() -> None:
    """The rim of a body may be off by a cell from frame to frame."""
    wider = plate(3.0, (-0.34, 0.34), (-0.54, 0.54))
    assert not arrived(memory((0, nearest(BODY, BACK))), nearest(wider, BACK)).any()


def test_only_cells_asked_for_are_told() -> None:
    grid = grid_of(nearest(BODY, BACK))
    left = grid.valid.copy()
    left[:, 40:] = False
    found = memory((0, BACK)).changes(grid, left, AT_ORIGIN, 200 * MS).arrived
    assert found.any()
    assert not found[:, 41:].any()


def test_a_new_viewpoint_brings_nothing_new() -> None:
    """The camera went 0.3 m to the right: the body is seen elsewhere, and what it hid is seen."""
    moved = Pose(np.eye(3), np.array([0.3, 0.0, 0.0]))
    shifted = plate(3.0, (-0.6, 0.0), (-0.5, 0.5))
    kept = memory((0, nearest(BODY, BACK)))
    assert not arrived(kept, nearest(shifted, BACK), pose=moved).any()
    # Without its own motion the camera would be misled.
    assert arrived(kept, nearest(shifted, BACK)).any()


def test_cleared_nothing_is_remembered() -> None:
    kept = memory((0, BACK))
    kept.clear()
    assert not arrived(kept, nearest(BODY, BACK)).any()


def test_views_are_kept_no_closer_than_0_06_s() -> None:
    both = nearest(BODY, BACK)
    # The second view is too young to be kept: 0.2 s before 250 ms the wall alone was seen.
    assert arrived(memory((0, BACK), (50, both)), both, 250).any()
    assert not arrived(memory((0, BACK), (70, both)), both, 250).any()


def test_depth_resolution_grows_with_the_square_of_the_distance() -> None:
    """0.1 m, and 3.5 sigmas of the difference of two cells whose noise is 0.55 of a pixel's."""
    hand = 0.1 + 3.5 * 2.0**0.5 * 0.55 * 0.0075 * np.array([0.0, 1.0, 16.0])
    np.testing.assert_allclose(memory().resolves_m(np.array([0.0, 1.0, 4.0])), hand)
    just = plate(4.0 - 0.9 * hand[2], (-0.5, 0.5), (-0.5, 0.5))
    grid = grid_of(just)
    stayed = memory((0, wall(4.0))).changes(grid, grid.valid, AT_ORIGIN, 600 * MS).stayed
    assert stayed[inner(just)].all()


def test_at_the_border_of_the_image_there_are_no_neighbours_outside() -> None:
    """A corner has three of them, four with itself; what arrives at the left is none at the right."""
    corner = BACK.copy()
    corner[:6, :6] = 3.0
    found = arrived(memory((0, BACK)), corner)
    expected = corner == 3.0
    expected[[0, 0, 5, 5], [0, 5, 0, 5]] = False
    np.testing.assert_array_equal(found, expected)


def test_arrived_cells_are_returned_as_flat_indices_too() -> None:
    grid = grid_of(nearest(BODY, BACK))
    changes = memory((0, BACK)).changes(grid, grid.valid, AT_ORIGIN, 200 * MS)
    np.testing.assert_array_equal(changes.arrived_cells, np.flatnonzero(changes.arrived))
    nothing = ViewMemory(NOISE).changes(grid, grid.valid, AT_ORIGIN, 200 * MS)
    assert len(nothing.arrived_cells) == 0
