<<<<<<< HEAD
"""Connected depth, what is measured of it and what is near, against loops over single cells."""
=======
"""Connected depth and what its parts measure, on exact grids."""
>>>>>>> 95702fb (Tests of tracking on exact grids: evidence, masks, arrivals, regions, what is hidden, merged, listed)

from __future__ import annotations

import numpy as np
import pytest
<<<<<<< HEAD
from numpy.typing import NDArray

from hal.types import Pose
from vision.carving import _near_ends
from vision.depth_grid import DepthGrid
from vision.masks import predict, surfaces
from vision.regions import components, measure, spread_labels, unhidden

IDENTITY = Pose(np.eye(3), np.zeros(3))
SHAPE = (24, 32)


def grid_of(depth_m: NDArray[np.float32]) -> DepthGrid:
    """4 px a cell, focal length 400 px; the mounting is not known."""
    height, width = depth_m.shape
    x = ((np.arange(width) - 0.5 * (width - 1)) * 0.01).astype(np.float32)
    y = ((np.arange(height) - 0.5 * (height - 1)) * 0.01).astype(np.float32)
    valid = depth_m > 0
    inverse = np.where(valid, 1.0 / np.maximum(depth_m, 1e-3), 0.0).astype(np.float32)
    nan = float("nan")
    return DepthGrid(4, 2.0, depth_m, inverse, valid, ~valid, x, y, depth_m, None, None, nan, nan, None)


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


@pytest.mark.parametrize("seed", range(3))
def test_labels_that_do_not_fit_into_the_sort_are_measured_alike(seed: int) -> None:
    rng = np.random.default_rng(seed)
    depth = rng.uniform(1.0, 6.0, SHAPE).astype(np.float32)
    labels = rng.integers(0, 5, SHAPE).astype(np.int32)
    few = measure(grid_of(depth), labels, 4)
    # The same cells under a label that leaves no bits for their index.
    huge = 2**22
    many = measure(grid_of(depth), np.where(labels == 4, np.int32(huge), labels), huge)
    for name in ("cells", "rows", "bbox_px", "position_m", "extent_m", "whole"):
        np.testing.assert_array_equal(getattr(few, name)[3], getattr(many, name)[huge - 1])
        np.testing.assert_array_equal(getattr(few, name)[:3], getattr(many, name)[:3])


def test_what_something_nearer_hides_is_not_whole() -> None:
    depth, labels = flat(4.0), np.zeros(SHAPE, np.int32)
    labels[4:20, 4:12] = 1
    labels[4:20, 20:28] = 2
    labels[8:16, 12:15] = 3  # stands beside the first one, nearer
    depth[labels == 3] = 2.0
    grid = grid_of(depth)
    measured = measure(grid, labels, 3)
    assert measured.whole.tolist() == [True, True, True]
    assert unhidden(grid, labels, measured).whole.tolist() == [False, True, True]


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


def test_of_two_surfaces_in_one_cell_the_nearer_one_is_expected() -> None:
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
    found = _near_ends(grid, np.nan_to_num(ends), np.array([[2.0, np.nan]], np.float32), 400.0)
    for row, column in np.ndindex(*SHAPE):
        away_m = np.hypot(row - 10, column - 10) * 0.02
        if away_m < 0.18 and column < 20:
            assert found[row, column]
        if away_m > 0.22 or column >= 20:
            assert not found[row, column]


def test_without_depth_no_cell_is_near() -> None:
    nowhere = np.full((1, 2), np.nan, np.float32)
    assert not _near_ends(grid_of(flat(2.0)), np.zeros((1, 2, 2), np.float32), nowhere, 400.0).any()
=======

from hal.types import FloatArray
from tests.support.grids import (
    CAMERA,
    COLUMNS,
    LEVEL_UP,
    OFFSET_PX,
    ROWS,
    STEP_PX,
    grid_of,
    labelled,
    nearest,
    no_depth,
    plane,
    plate,
    wall,
)
from vision import regions

CELL_M = STEP_PX / CAMERA.fx  # of a cell one metre away


def test_what_a_plate_measures_by_hand() -> None:
    depth_m = plate(3.0, (-0.6, 0.2), (-0.5, 0.3))
    measured = regions.measure(grid_of(depth_m), labelled(depth_m > 0.0), 2)
    assert measured.cells.tolist() == [np.count_nonzero(depth_m), 0]
    cell_m = 3.0 * CELL_M
    np.testing.assert_allclose(measured.position_m[0], [-0.2, -0.1, 3.0], atol=0.51 * cell_m)
    np.testing.assert_allclose(measured.extent_m[0], [0.8, 0.8, 0.0], atol=cell_m)
    # -0.6 / 3 * 300 + 159.5 = 99.5 and so on, to a cell of 4 px.
    np.testing.assert_allclose(measured.bbox_px[0], [99.5, 69.5, 179.5, 149.5], atol=STEP_PX)
    assert measured.rows[0] == np.count_nonzero((depth_m > 0.0).any(axis=1))
    assert measured.whole.tolist() == [True, False]
    np.testing.assert_array_equal(measured.position_m[1], 0.0)


def test_depth_of_a_part_that_reaches_back() -> None:
    """The nearer half at 2 m, the other at 2.5 m: the mean is that of the inverse depth, 1 / 0.45."""
    depth_m = nearest(plate(2.0, (-0.4, 0.0), (-0.4, 0.4)), plate(2.5, (0.0, 0.5), (-0.5, 0.5)))
    measured = regions.measure(grid_of(depth_m), labelled(depth_m > 0.0), 1)
    assert measured.position_m[0, 2] == pytest.approx(1.0 / 0.45, rel=0.01)
    # Spread of the inverse depth 0.05: 3.46 * 0.05 * 2.22^2.
    assert measured.extent_m[0, 2] == pytest.approx(3.46 * 0.05 / 0.45**2, rel=0.03)


def test_a_part_at_the_images_border_is_not_whole() -> None:
    for rows, columns in (
        ((0, 9), (9, 20)),
        ((9, 20), (0, 9)),
        ((50, ROWS), (9, 20)),
        ((9, 20), (70, COLUMNS)),
    ):
        mask = np.zeros((ROWS, COLUMNS), np.bool_)
        mask[slice(*rows), slice(*columns)] = True
        assert not regions.measure(grid_of(wall(3.0)), labelled(mask), 1).whole[0]


def test_the_box_reaches_down_to_the_floor_that_a_body_stands_on() -> None:
    """Camera 1 m up and level: the floor 4 m away is at row 119.5 + 300 / 4 = 194.5. The lowest 0.12 m
    of the body were taken for floor."""
    depth_m = plate(4.0, (-0.3, 0.3), (-0.6, 0.88))
    labels = labelled(depth_m > 0.0)
    standing = regions.measure(grid_of(depth_m, LEVEL_UP, 1.0), labels, 1)
    assert standing.bbox_px[0, 3] == pytest.approx(194.5, abs=0.5)
    unknown = regions.measure(grid_of(depth_m), labels, 1)
    assert unknown.bbox_px[0, 3] == pytest.approx(119.5 + 300.0 * 0.88 / 4.0, abs=STEP_PX)
    np.testing.assert_array_equal(standing.bbox_px[0, :3], unknown.bbox_px[0, :3])


@pytest.mark.parametrize(("end_m", "stands"), [(0.83, True), (0.8, False), (0.6, False)])
def test_what_hangs_has_no_feet(end_m: float, stands: bool) -> None:
    """Depth may be missing over 0.12 m and 0.015 m for each metre of distance: 0.18 m; it is over 0.173 m,
    and, one cell less, over 0.227 m."""
    depth_m = plate(4.0, (-0.3, 0.3), (-0.6, end_m))
    measured = regions.measure(grid_of(depth_m, LEVEL_UP, 1.0), labelled(depth_m > 0.0), 1)
    row = 194.5 if stands else 119.5 + 300.0 * end_m / 4.0
    assert measured.bbox_px[0, 3] == pytest.approx(row, abs=0.5 if stands else STEP_PX)


def test_feet_below_the_image_end_at_its_border() -> None:
    depth_m = plate(2.0, (-0.3, 0.3), (-0.6, 0.79))
    near = regions.measure(grid_of(depth_m, LEVEL_UP, 0.85), labelled(depth_m > 0.0), 1)
    end = OFFSET_PX + (ROWS - 0.5) * STEP_PX
    assert near.bbox_px[0, 3] == pytest.approx(end, abs=1e-4)


def test_feet_on_the_floor_of_a_rolled_camera() -> None:
    """Rolled by 10 degrees the floor is lower at one side of the image than at the other."""
    roll = np.radians(10.0)
    up = np.array([-np.sin(roll), -np.cos(roll), 0.0])
    rows = []
    for middle_m in (-1.0, 1.0):
        # Where the floor is at depth 4: up . p = -1.
        floor_y = (1.0 + up[0] * middle_m) / -up[1]
        depth_m = plate(4.0, (middle_m - 0.1, middle_m + 0.1), (-0.6, floor_y - 0.1))
        measured = regions.measure(grid_of(depth_m, up, 1.0), labelled(depth_m > 0.0), 1)
        assert measured.bbox_px[0, 3] == pytest.approx(119.5 + 300.0 * floor_y / 4.0, abs=1.5)
        rows.append(measured.bbox_px[0, 3])
    assert abs(rows[0] - rows[1]) > 20.0


def beside(far_m: FloatArray, near_m: FloatArray) -> regions.Regions:
    """What is seen of the far one (part 1) and of the near one (part 2), every cell labelled."""
    depth_m = nearest(far_m, near_m)
    labels = labelled((far_m > 0.0) & (depth_m == far_m), near_m > 0.0)
    grid = grid_of(depth_m)
    return regions.unhidden(grid, labels, regions.measure(grid, labels, 2))


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_part_that_something_nearer_hides_is_not_whole(side: float) -> None:
    pillar = plate(2.5, (0.1, 0.5) if side > 0 else (-0.5, -0.1), (-0.8, 0.8))
    measured = beside(plate(4.0, (-0.4, 0.4), (-0.6, 0.8)), pillar)
    assert measured.whole.tolist() == [False, True]


def test_a_part_with_something_nearer_beside_it_at_a_distance_is_whole() -> None:
    measured = beside(plate(4.0, (-0.4, 0.4), (-0.6, 0.8)), plate(2.5, (0.6, 0.9), (-0.8, 0.8)))
    assert measured.whole.tolist() == [True, True]


@pytest.mark.parametrize(("top_m", "whole"), [(0.4, True), (0.375, False)])
def test_a_part_of_which_only_a_corner_is_hidden_is_whole(top_m: float, whole: bool) -> None:
    """Three of its 26 rows, and four: 15 % of them may be hidden."""
    measured = beside(plate(4.0, (-0.4, 0.4), (-0.6, 0.8)), plate(2.5, (0.2, 0.5), (top_m, 0.8)))
    assert measured.rows[0] == 26
    assert measured.whole.tolist() == [whole, True]


def test_the_end_of_a_row_does_not_hide_the_beginning_of_the_next() -> None:
    far = np.zeros((ROWS, COLUMNS))
    far[10:40, COLUMNS - 8 :] = 5.0
    near = np.zeros((ROWS, COLUMNS))
    near[11:41, :8] = 2.0
    depth_m = far + near
    labels = labelled(far > 0.0, near > 0.0)
    grid = grid_of(depth_m)
    measured = regions.measure(grid, labels, 2)
    inside = regions.Regions(
        measured.cells,
        measured.rows,
        measured.bbox_px,
        measured.position_m,
        measured.extent_m,
        np.ones(2, np.bool_),
    )
    assert regions.unhidden(grid, labels, inside).whole.tolist() == [True, True]


def test_parts_are_parted_where_depth_jumps_and_speckles_left_out() -> None:
    depth_m = nearest(plate(3.0, (-0.6, 0.0), (-0.4, 0.4)), plate(4.0, (-0.2, 0.8), (-0.5, 0.5)))
    depth_m[3, 3:8] = 2.0  # five cells
    depth_m[6:8, 3:6] = 2.0  # six
    grid = grid_of(depth_m)
    count, labels = regions.components(grid, grid.valid)
    assert count == 3
    assert not labels[3, 3:8].any()
    for number in (1, 2, 3):
        assert len(np.unique(depth_m[labels == number])) == 1


@pytest.mark.parametrize(("behind_m", "count"), [(4.08, 1), (4.11, 2)])
def test_a_jump_is_measured_in_inverse_depth(behind_m: float, count: int) -> None:
    """0.25 - 1 / 4.08 = 0.0049, 0.25 - 1 / 4.11 = 0.0067; 0.006 is the least."""
    depth_m = wall(4.0)
    depth_m[:, 40:] = behind_m
    grid = grid_of(depth_m)
    assert regions.components(grid, grid.valid)[0] == count


def test_a_pole_one_cell_wide_is_a_part() -> None:
    depth_m = wall(5.0)
    depth_m[10:50, 40] = 2.0
    grid = grid_of(depth_m)
    count, labels = regions.components(grid, grid.valid)
    assert count == 2
    assert (labels[12:48, 40] == labels[30, 40]).all()
    assert labels[30, 40] != labels[30, 10]


def test_only_what_stands_out_of_the_floor_is_standing() -> None:
    floor_m = plane(LEVEL_UP, 1.0)
    body = plate(3.0, (-0.3, 0.3), (-0.2, 1.0))
    depth_m = nearest(np.where(floor_m < 8.0, floor_m, 0.0), body)
    grid = grid_of(depth_m, LEVEL_UP, 1.0)
    standing = regions.standing(grid, 0.05)
    assert grid.height_m is not None
    # Margin at 3 m: 0.05 + 3 * 0.01 + 0.008 * 3 = 0.104.
    np.testing.assert_array_equal(standing[body > 0.0], grid.height_m[body > 0.0] > 0.104)
    assert not standing[body == 0.0].any()
    unknown = grid_of(depth_m)
    np.testing.assert_array_equal(regions.standing(unknown, 0.05), unknown.valid)


def test_labels_spread_to_the_nearest_cells_of_the_mask_only() -> None:
    labels = np.zeros((ROWS, COLUMNS), np.int32)
    labels[20, 10], labels[20, 30] = 1, 2
    mask = np.zeros((ROWS, COLUMNS), np.bool_)
    mask[20, 5:36] = True
    spread = regions.spread_labels(labels, mask)
    np.testing.assert_array_equal(spread[20, 5:20], 1)
    np.testing.assert_array_equal(spread[20, 21:36], 2)
    assert not spread[~mask].any()
    empty = np.zeros_like(labels)
    assert regions.spread_labels(empty, mask) is empty


def test_nothing_measured_is_nothing() -> None:
    grid = grid_of(no_depth())
    assert regions.components(grid, grid.valid)[0] == 0
    assert regions.measure(grid, labelled(), 1).cells.tolist() == [0]
>>>>>>> 95702fb (Tests of tracking on exact grids: evidence, masks, arrivals, regions, what is hidden, merged, listed)
