"""Where the cells of tracks are expected, and found."""

from __future__ import annotations

import numpy as np
import pytest

from hal.types import Pose
from tests.support.detections import AT_ORIGIN
from tests.support.grids import COLUMNS, ROWS, grid_of, labelled, nearest, plate, wall
from vision.bodies import masks
from vision.camera.lens import rotation_from_vector

NO_SHIFT = np.zeros((2, 3))
IDS = np.array([4, 9])
BOTH = np.array([0, 1])
LEFT_M = plate(3.0, (-0.8, -0.2), (-0.4, 0.4))
RIGHT_M = plate(3.0, (0.2, 0.8), (-0.4, 0.4))
TWO = labelled(LEFT_M > 0.0, RIGHT_M > 0.0)


def two_surfaces() -> masks.TrackSurfaces:
    return masks.surfaces(grid_of(nearest(LEFT_M, RIGHT_M)), TWO, IDS, AT_ORIGIN)


def test_surfaces_are_the_points_of_the_tracks_and_whose_they_are() -> None:
    before = two_surfaces()
    assert before.points_m.shape == (3, np.count_nonzero(TWO))
    np.testing.assert_array_equal(before.track_id, IDS)
    np.testing.assert_array_equal(before.owner == 0, before.points_m[0] < 0.0)
    np.testing.assert_allclose(before.points_m[2], 3.0)


def test_cells_of_a_static_track_are_predicted_where_they_were() -> None:
    grid = grid_of(nearest(LEFT_M, RIGHT_M))
    np.testing.assert_array_equal(masks.predict(two_surfaces(), BOTH, NO_SHIFT, grid, AT_ORIGIN), TWO)


def test_cells_of_a_mover_are_predicted_by_its_velocity() -> None:
    """0.4 m at 3 m are ten cells."""
    moved_m = plate(3.0, (-0.4, 0.2), (-0.4, 0.4))
    shift = np.array([[0.4, 0.0, 0.0], [0.0, 0.0, 0.0]])
    found = masks.predict(two_surfaces(), BOTH, shift, grid_of(nearest(moved_m, RIGHT_M)), AT_ORIGIN)
    np.testing.assert_array_equal(found == 1, np.roll(TWO == 1, 10, axis=1))


def test_no_surface_is_expected_at_another_depth() -> None:
    grid = grid_of(wall(6.0))
    assert not masks.predict(two_surfaces(), BOTH, NO_SHIFT, grid, AT_ORIGIN).any()
    # 0.4 m nearer is still the same surface: 0.03 + 0.25 / 9 = 0.058 against 1 / 2.6 - 1 / 3 = 0.051.
    near = grid_of(np.where(TWO > 0, 2.6, 0.0))
    np.testing.assert_array_equal(masks.predict(two_surfaces(), BOTH, NO_SHIFT, near, AT_ORIGIN), TWO)
    nearer = grid_of(np.where(TWO > 0, 2.5, 0.0))  # 0.067
    assert not masks.predict(two_surfaces(), BOTH, NO_SHIFT, nearer, AT_ORIGIN).any()


def test_the_cameras_own_motion_is_taken_off() -> None:
    """The camera turns right by 4 px / 300 px a cell, five cells: all goes left by five cells."""
    pose = Pose(rotation_from_vector(np.array([0.0, np.arctan(20.0 / 300.0), 0.0])), np.zeros(3))
    narrow = plate(3.0, (-0.3, 0.3), (-0.3, 0.3))
    before = masks.surfaces(grid_of(narrow), labelled(narrow > 0.0), np.array([4]), AT_ORIGIN)
    found = masks.predict(before, np.array([0]), np.zeros((1, 3)), grid_of(wall(3.0)), pose)
    middle = np.nonzero(found)[1].mean() - np.nonzero(narrow)[1].mean()
    assert abs(middle + 5.0) < 0.3


def test_tracks_that_are_gone_expect_nothing_and_the_others_have_new_numbers() -> None:
    grid = grid_of(nearest(LEFT_M, RIGHT_M))
    found = masks.predict(two_surfaces(), np.array([-1, 0]), np.zeros((1, 3)), grid, AT_ORIGIN)
    np.testing.assert_array_equal(found, np.where(TWO == 2, 1, 0))


def test_nearer_of_two_expected_surfaces_wins() -> None:
    """Depths so close that both would be taken for what is measured."""
    front = plate(3.0, (-0.4, 0.4), (-0.4, 0.4)) > 0.0
    back = grid_of(np.where(front, 3.1, 0.0))
    both = masks.TrackSurfaces(
        np.concatenate(
            (
                grid_of(np.where(front, 3.0, 0.0)).points(np.flatnonzero(front)),
                back.points(np.flatnonzero(front)),
            ),
            axis=1,
        ),
        np.repeat(np.array([0, 1], np.int32), np.count_nonzero(front)),
        IDS,
        AT_ORIGIN,
    )
    found = masks.predict(both, BOTH, NO_SHIFT, back, AT_ORIGIN)
    assert np.count_nonzero(found == 2) == 0
    assert np.count_nonzero(found == 1) > 0.9 * np.count_nonzero(front)


def test_without_surfaces_none_are_expected() -> None:
    none = np.empty(0, np.intp)
    assert not masks.predict(
        masks.NO_TRACK_SURFACES, none, np.empty((0, 3)), grid_of(wall(3.0)), AT_ORIGIN
    ).any()


def test_last_of_two_equally_near_surfaces_gets_the_cell() -> None:
    grid, cell = grid_of(wall(3.0)), (30, 40)
    ahead = 3.0 * np.array([[grid.x[40]] * 2, [grid.y[30]] * 2, [1.0, 1.0]], np.float32)
    for owner, number in (([0, 1], 2), ([1, 0], 1)):
        before = masks.TrackSurfaces(ahead, np.array(owner, np.int32), IDS, AT_ORIGIN)
        found = masks.predict(before, BOTH, NO_SHIFT, grid, AT_ORIGIN)
        assert found[cell] == number
        assert np.count_nonzero(found) == 1


@pytest.mark.parametrize("way_m", [(-0.4, 0.0), (0.4, 0.0), (0.0, -0.4), (0.0, 0.4)])
def test_cells_that_leave_the_image_are_not_predicted_at_the_other_side(way_m: tuple[float, float]) -> None:
    """The whole image is one track's, and ten columns or rows of it go out: of so many at the other side
    nothing is known."""
    grid = grid_of(wall(3.0))
    before = masks.surfaces(grid, labelled(grid.valid), np.array([4]), AT_ORIGIN)
    found = masks.predict(before, np.array([0]), np.array([[*way_m, 0.0]]), grid, AT_ORIGIN)
    expected = np.ones_like(found)
    right, down = (round(10 * way / 0.4) for way in way_m)
    expected[:, : max(right, 0)] = expected[: max(down, 0)] = 0
    expected[:, COLUMNS + min(right, 0) :] = expected[ROWS + min(down, 0) :] = 0
    np.testing.assert_array_equal(found, expected)


def test_points_too_close_or_behind_the_camera_are_not_predicted() -> None:
    points_m = np.array([[0.0, 0.0], [0.0, 0.0], [0.1, -3.0]], np.float32)
    before = masks.TrackSurfaces(points_m, np.array([0, 1], np.int32), IDS, AT_ORIGIN)
    assert not masks.predict(before, BOTH, NO_SHIFT, grid_of(wall(3.0)), AT_ORIGIN).any()


def test_cells_of_chosen_tracks() -> None:
    np.testing.assert_array_equal(masks.cells_of(TWO, np.array([True, False])), LEFT_M > 0.0)
    np.testing.assert_array_equal(masks.cells_of(TWO, np.array([True, True])), TWO > 0)
    assert not masks.cells_of(TWO, np.array([False, False])).any()


def test_cells_of_each_part_are_counted() -> None:
    cells = np.flatnonzero(LEFT_M > 0.0)
    assert masks.count_cells(TWO, cells, 2).tolist() == [len(cells), 0]
    assert masks.count_cells(TWO, np.flatnonzero(TWO == 0), 2).tolist() == [0, 0]
    assert masks.count_cells(TWO, np.empty(0, np.intp), 2).tolist() == [0, 0]
