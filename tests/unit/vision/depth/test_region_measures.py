"""Connected depth and what its parts measure, on exact grids."""

from __future__ import annotations

import numpy as np
import pytest

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
from vision.depth import connected, occlusion, regions

CELL_M = STEP_PX / CAMERA.fx  # of a cell one metre away


def test_measures_of_a_plate_by_hand() -> None:
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


def test_a_part_cut_above_or_below_has_its_width_and_one_cut_at_a_side_its_height() -> None:
    tall = np.zeros((ROWS, COLUMNS), np.bool_)
    tall[0:40, 9:20] = True
    wide = np.zeros((ROWS, COLUMNS), np.bool_)
    wide[45:50, 0:40] = True
    measured = regions.measure(grid_of(wall(3.0)), labelled(tall, wide), 2)
    assert measured.sides_visible.tolist() == [True, False]
    assert measured.top_and_bottom_visible.tolist() == [False, True]


def test_a_border_without_an_edge_in_depth_is_a_guess() -> None:
    """Two halves of one plate, and the same two 0.6 m apart in depth."""
    left, right = plate(4.0, (-0.4, 0.0), (-0.6, 0.8)), plate(4.0, (0.0, 0.4), (-0.6, 0.8))
    assert beside(left, right).sides_visible.tolist() == [False, False]
    assert beside(left, plate(3.4, (0.0, 0.4), (-0.6, 0.8))).sides_visible.tolist() == [False, True]


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
def test_a_hanging_part_has_no_foot(end_m: float, stands: bool) -> None:
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
    return occlusion.with_occlusion(grid, labels, regions.measure(grid, labels, 2))


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


def test_a_gap_of_a_stereo_camera_beside_a_nearer_surface_counts_as_hidden() -> None:
    """Three cells without a depth between the two, and four."""
    far, near = plate(4.0, (-0.8, 0.0), (-0.6, 0.8)), plate(2.5, (0.0, 0.4), (-0.8, 0.8))
    for gap, whole in ((3, False), (4, True)):
        seen = np.where(near > 0.0, 0.0, far)
        last = int(np.flatnonzero(seen.any(axis=0))[-1])
        first = int(np.flatnonzero(near.any(axis=0))[0])
        seen[:, max(first - gap, 0) : last + 1] = 0.0
        measured = beside(seen, near)
        assert measured.sides_visible.tolist() == [True, True]
        assert measured.whole.tolist() == [whole, True]


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize(("blind", "visible"), [(1, False), (6, False), (7, True)])
def test_a_part_that_reaches_the_blind_band_of_a_stereo_camera_is_cut(
    blind: int, visible: bool, mirrored: bool
) -> None:
    """Part 1 begins where depth does, in one row only; part 2 stands farther in."""
    depth_m = np.zeros((ROWS, COLUMNS))
    depth_m[20, blind : blind + 9] = depth_m[21:40, blind + 3 : blind + 9] = 3.0
    depth_m[20:40, blind + 20 : blind + 30] = 4.0
    seen = np.ascontiguousarray(depth_m[:, ::-1]) if mirrored else depth_m
    grid, labels = grid_of(seen), labelled(seen == 3.0, seen == 4.0)
    measured = regions.measure(grid, labels, 2)
    assert measured.sides_visible.tolist() == [True, True]
    assert occlusion.with_occlusion(grid, labels, measured).sides_visible.tolist() == [visible, True]


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
        np.ones(2, np.bool_),
        np.zeros(2, np.bool_),
    )
    assert occlusion.with_occlusion(grid, labels, inside).whole.tolist() == [True, True]


def test_parts_are_parted_where_depth_jumps_and_speckles_left_out() -> None:
    depth_m = nearest(plate(3.0, (-0.6, 0.0), (-0.4, 0.4)), plate(4.0, (-0.2, 0.8), (-0.5, 0.5)))
    depth_m[3, 3:8] = 2.0  # five cells
    depth_m[6:8, 3:6] = 2.0  # six
    grid = grid_of(depth_m)
    count, labels = connected.components(grid, grid.valid)
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
    assert connected.components(grid, grid.valid)[0] == count


def test_a_pole_one_cell_wide_is_a_part() -> None:
    depth_m = wall(5.0)
    depth_m[10:50, 40] = 2.0
    grid = grid_of(depth_m)
    count, labels = connected.components(grid, grid.valid)
    assert count == 2
    assert (labels[12:48, 40] == labels[30, 40]).all()
    assert labels[30, 40] != labels[30, 10]


def test_only_what_stands_out_of_the_floor_is_standing() -> None:
    floor_m = plane(LEVEL_UP, 1.0)
    body = plate(3.0, (-0.3, 0.3), (-0.2, 1.0))
    depth_m = nearest(np.where(floor_m < 8.0, floor_m, 0.0), body)
    grid = grid_of(depth_m, LEVEL_UP, 1.0)
    standing = connected.above_floor(grid, 0.05)
    assert grid.height_m is not None
    # Margin at 3 m: 0.05 + 3 * 0.01 + 0.008 * 3 = 0.104.
    np.testing.assert_array_equal(standing[body > 0.0], grid.height_m[body > 0.0] > 0.104)
    assert not standing[body == 0.0].any()
    unknown = grid_of(depth_m)
    np.testing.assert_array_equal(connected.above_floor(unknown, 0.05), unknown.valid)


def test_labels_spread_to_the_nearest_cells_of_the_mask_only() -> None:
    labels = np.zeros((ROWS, COLUMNS), np.int32)
    labels[20, 10], labels[20, 30] = 1, 2
    mask = np.zeros((ROWS, COLUMNS), np.bool_)
    mask[20, 5:36] = True
    spread = connected.spread_labels(labels, mask)
    np.testing.assert_array_equal(spread[20, 5:20], 1)
    np.testing.assert_array_equal(spread[20, 21:36], 2)
    assert not spread[~mask].any()
    empty = np.zeros_like(labels)
    assert connected.spread_labels(empty, mask) is empty


def test_region_without_measurements_is_empty() -> None:
    grid = grid_of(no_depth())
    assert connected.components(grid, grid.valid)[0] == 0
    assert regions.measure(grid, labelled(), 1).cells.tolist() == [0]
