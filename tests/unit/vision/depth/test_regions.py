"""Connected depth, what is measured of it and what is near, against loops over single cells."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from config.perception import TYPICAL_DEPTH_NOISE, DepthNoise
from hal.types import Pose
from vision.bodies.ends import near_ends
from vision.bodies.masks import predict, surfaces
from vision.depth.connected import components, spread_labels
from vision.depth.depth_grid import DepthGrid
from vision.depth.occlusion import with_occlusion
from vision.depth.regions import measure

IDENTITY = Pose(np.eye(3), np.zeros(3))
SHAPE = (24, 32)

NOISE = TYPICAL_DEPTH_NOISE


def grid_of(depth_m: NDArray[np.float32]) -> DepthGrid:
    """4 px a cell, focal length 400 px; the mounting is not known."""
    height, width = depth_m.shape
    x = ((np.arange(width) - 0.5 * (width - 1)) * 0.01).astype(np.float32)
    y = ((np.arange(height) - 0.5 * (height - 1)) * 0.01).astype(np.float32)
    valid = depth_m > 0
    inverse = np.where(valid, 1.0 / np.maximum(depth_m, 1e-3), 0.0).astype(np.float32)
    nan = float("nan")
    return DepthGrid(4, 2.0, depth_m, inverse, valid, ~valid, x, y, depth_m, None, None, nan, nan, None, 10.0)


def flat(depth_m: float) -> NDArray[np.float32]:
    return np.full(SHAPE, depth_m, np.float32)


def two_bodies() -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """A wall at 4 m, in front of it something at 2 m; labels 1 and 3, nobody is 2."""
    depth, labels = flat(4.0), np.ones(SHAPE, np.int32)
    depth[6:18, 10:14] = 2.0
    labels[6:18, 10:14] = 3
    return depth, labels


def test_parts_are_measured_where_they_are() -> None:
    depth, labels = two_bodies()
    grid = grid_of(depth)
    found = measure(grid, labels, 3)
    assert found.cells.tolist() == [SHAPE[0] * SHAPE[1] - 48, 0, 48]
    assert found.rows.tolist() == [24, 0, 12]
    assert found.bbox_px[2].tolist() == [40.0, 24.0, 56.0, 72.0]
    np.testing.assert_allclose(found.position_m[2], [(11.5 - 15.5) * 0.02, 0.0, 2.0], atol=1e-6)
    np.testing.assert_allclose(found.extent_m[2], [0.06, 0.22, 0.0], atol=1e-3)
    assert found.whole.tolist() == [False, False, True]


def test_a_box_seen_along_its_side_is_measured_no_wider() -> None:
    """Its front from 0.1 to 0.3 m at 2 m; before that its side, which goes back to 4 m."""
    depth, labels = flat(8.0), np.zeros(SHAPE, np.int32)
    for column in range(18, 31):
        bearing = (column - 15.5) * 0.01
        depth[6:18, column] = max(0.1 / bearing, 2.0)
        labels[6:18, column] = 1
    found = measure(grid_of(depth), labels, 1)
    assert found.extent_m[0, 0] == pytest.approx(0.29 - 0.1, abs=0.02)
    mirrored = measure(grid_of(depth[:, ::-1].copy()), labels[:, ::-1].copy(), 1)
    assert mirrored.extent_m[0, 0] == pytest.approx(found.extent_m[0, 0], abs=1e-6)


def test_a_receding_surface_is_as_wide_as_its_rims_are_apart() -> None:
    """Columns 30 down to 26, from 0.29 m aside at 2 m to 0.42 m at 4 m."""
    depth, labels = flat(8.0), np.zeros(SHAPE, np.int32)
    for column in range(26, 31):
        depth[6:18, column] = 2.0 + 0.5 * (30 - column)
        labels[6:18, column] = 1
    found = measure(grid_of(depth), labels, 1)
    assert found.extent_m[0, 0] == pytest.approx(0.105 * 4.0 - 0.145 * 2.0, abs=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_labels_that_do_not_fit_into_the_sort_are_measured_alike(seed: int) -> None:
    rng = np.random.default_rng(seed)
    depth = rng.uniform(1.0, 6.0, SHAPE).astype(np.float32)
    labels = rng.integers(0, 5, SHAPE).astype(np.int32)
    few = measure(grid_of(depth), labels, 4)
    # The same cells under a label that leaves no bits for their index.
    huge = 2**22
    many = measure(grid_of(depth), np.where(labels == 4, np.int32(huge), labels), huge)
    for name in (
        "cells",
        "rows",
        "bbox_px",
        "position_m",
        "extent_m",
        "sides_visible",
        "top_and_bottom_visible",
    ):
        np.testing.assert_array_equal(getattr(few, name)[3], getattr(many, name)[huge - 1])
        np.testing.assert_array_equal(getattr(few, name)[:3], getattr(many, name)[:3])


def test_a_part_hidden_by_something_nearer_is_not_whole() -> None:
    depth, labels = flat(4.0), np.zeros(SHAPE, np.int32)
    labels[4:20, 4:12] = 1
    labels[4:20, 20:28] = 2
    labels[8:16, 12:15] = 3  # stands beside the first one, nearer
    depth[labels == 3] = 2.0
    grid = grid_of(depth)
    measured = measure(grid, labels, 3)
    assert measured.whole.tolist() == [True, True, True]
    assert with_occlusion(grid, labels, measured).whole.tolist() == [False, True, True]


def test_a_jump_in_depth_parts_what_touches() -> None:
    depth, labels = two_bodies()
    count, parts = components(grid_of(depth), np.ones(SHAPE, np.bool_))
    assert count == 2
    assert len(np.unique(parts[labels == 3])) == 1
    assert (parts[7:17, 11:13] != parts[0, 0]).all()


def test_speckles_are_no_part() -> None:
    mask = np.zeros(SHAPE, np.bool_)
    mask[2:4, 2:4] = True
    mask[10:14, 10:14] = True
    count, parts = components(grid_of(flat(3.0)), mask)
    assert (count, sorted(np.unique(parts).tolist())) == (1, [0, 1])
    assert not parts[2:4, 2:4].any()


@pytest.mark.parametrize("seed", range(4))
def test_labels_spread_as_in_the_whole_image(seed: int) -> None:
    """Against distances from every cell to every labelled one; ties are left out."""
    rng = np.random.default_rng(seed)
    mask = np.zeros(SHAPE, np.bool_)
    mask[5:19, 8:25] = True
    labels = np.zeros(SHAPE, np.int32)
    rows, columns = rng.integers(5, 19, 3), rng.integers(8, 25, 3)
    labels[rows, columns] = [1, 2, 3]
    found = spread_labels(labels, mask)
    assert (found[~mask] == 0).all()
    for row, column in np.argwhere(mask).tolist():
        away = np.hypot(rows - row, columns - column)
        order = np.argsort(away)
        if away[order[1]] - away[order[0]] > 1.0:
            assert found[row, column] == labels[rows[order[0]], columns[order[0]]]


def test_without_labels_nothing_spreads() -> None:
    assert not spread_labels(np.zeros(SHAPE, np.int32), np.ones(SHAPE, np.bool_)).any()


def test_surfaces_are_expected_where_they_went_and_only_there() -> None:
    depth, labels = two_bodies()
    before = surfaces(grid_of(depth), np.where(labels == 3, np.int32(2), labels), np.array([7, 9]), IDENTITY)
    assert before.track_id.tolist() == [7, 9]
    # The second one has gone 3 cells to the right since: 3 * 0.02 m at 2 m.
    moved = flat(4.0)
    moved[6:18, 13:17] = 2.0
    shift = np.array([[0.0, 0.0, 0.0], [0.06, 0.0, 0.0]])
    expected = predict(before, np.array([0, 1]), shift, grid_of(moved), IDENTITY)
    assert (expected[6:18, 13:17] == 2).all()
    assert (expected == 2).sum() == 48
    assert (expected[:6] == 1).all()
    assert (expected[6:18, 10:13] == 0).all()  # the wall there was hidden before
    gone = predict(before, np.array([-1, 0]), shift[1:], grid_of(moved), IDENTITY)
    assert (gone == 1).sum() == 48
    assert not gone[:6].any()


def test_nearer_of_two_surfaces_in_one_cell_is_expected() -> None:
    near, far = flat(3.0), flat(3.1)
    labels = np.ones(SHAPE, np.int32)
    front = surfaces(grid_of(near), labels, np.array([1]), IDENTITY)
    back = surfaces(grid_of(far), labels, np.array([2]), IDENTITY)
    for first, second in ((front, back), (back, front)):
        points = np.concatenate((first.points_m, second.points_m), axis=1)
        owner = np.concatenate((first.owner, second.owner + 1))
        both = type(front)(points, owner, np.array([1, 2]), IDENTITY)
        index = np.array([0, 1]) if first is front else np.array([1, 0])
        assert (predict(both, index, np.zeros((2, 3)), grid_of(near), IDENTITY) == 1).all()


def test_cells_near_an_end_are_those_within_20_cm_at_its_depth() -> None:
    depth = flat(2.0)
    depth[:, 20:] = 4.0
    grid = grid_of(depth)
    ends = np.array([[[42.0, 42.0], [np.nan, np.nan]]], np.float32)
    found = near_ends(
        grid, grid.valid, np.nan_to_num(ends), np.array([[2.0, np.nan]], np.float32), 400.0, NOISE
    )
    for row, column in np.ndindex(*SHAPE):
        away_m = np.hypot(row - 10, column - 10) * 0.02
        if away_m < 0.18 and column < 20:
            assert found[row, column]
        if away_m > 0.22 or column >= 20:
            assert not found[row, column]


def test_without_depth_no_cell_is_near() -> None:
    nowhere = np.full((1, 2), np.nan, np.float32)
    grid = grid_of(flat(2.0))
    assert not near_ends(grid, grid.valid, np.zeros((1, 2, 2), np.float32), nowhere, 400.0, NOISE).any()


@pytest.mark.parametrize(("quadratic_per_m", "near"), [(0.0075, True), (0.001, False)])
def test_depth_gate_around_an_end_grows_with_depth_noise(quadratic_per_m: float, near: bool) -> None:
    """0.5 m apart, 4 m ahead: 0.3 m and two sigmas are 0.54 m with the usual noise, 0.33 m with little."""
    grid = grid_of(flat(4.0))
    ends = np.full((1, 2, 2), 42.0, np.float32)
    depth_m = np.full((1, 2), 4.5, np.float32)
    noise = DepthNoise(quadratic_per_m=quadratic_per_m)
    assert near_ends(grid, grid.valid, ends, depth_m, 400.0, noise).any() == near
