"""Which cells belong to which track: prediction, votes, division."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

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


def test_what_stands_is_expected_where_it_was() -> None:
    grid = grid_of(nearest(LEFT_M, RIGHT_M))
    np.testing.assert_array_equal(masks.predict(two_surfaces(), BOTH, NO_SHIFT, grid, AT_ORIGIN), TWO)


def test_what_moves_is_expected_where_it_goes() -> None:
    """0.4 m at 3 m are ten cells."""
    moved_m = plate(3.0, (-0.4, 0.2), (-0.4, 0.4))
    shift = np.array([[0.4, 0.0, 0.0], [0.0, 0.0, 0.0]])
    found = masks.predict(two_surfaces(), BOTH, shift, grid_of(nearest(moved_m, RIGHT_M)), AT_ORIGIN)
    np.testing.assert_array_equal(found == 1, np.roll(TWO == 1, 10, axis=1))


def test_nothing_is_expected_where_depth_is_another() -> None:
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


def test_where_two_are_expected_the_nearer_one_is() -> None:
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


def test_nothing_known_is_nothing_expected() -> None:
    none = np.empty(0, np.intp)
    assert not masks.predict(
        masks.NO_TRACK_SURFACES, none, np.empty((0, 3)), grid_of(wall(3.0)), AT_ORIGIN
    ).any()


def block(rows: tuple[int, int], columns: tuple[int, int]) -> NDArray[np.bool_]:
    mask = np.zeros((ROWS, COLUMNS), np.bool_)
    mask[slice(*rows), slice(*columns)] = True
    return mask


PART = labelled(block((10, 30), (10, 50)))  # 800 cells


def vote(
    *expected: NDArray[np.bool_], mover: tuple[bool, ...], parts: NDArray[np.int32] = PART
) -> masks.Ballot:
    return masks.count_votes(parts, int(parts.max()), labelled(*expected), len(mover), np.array(mover))


def test_a_part_goes_to_whom_most_cells_speak_for() -> None:
    ballot = vote(block((10, 30), (10, 20)), block((10, 30), (20, 50)), mover=(True, True))
    assert ballot.winner.tolist() == [2]
    assert ballot.votes.tolist() == [600]
    assert ballot.present.tolist() == [[True, True]]


def test_cells_outside_of_a_part_have_no_vote() -> None:
    ballot = vote(block((40, 50), (10, 50)), mover=(True,))
    assert ballot.winner.tolist() == [0]
    assert ballot.votes.tolist() == [0]


def test_fewer_than_four_cells_are_no_claim() -> None:
    assert vote(block((10, 11), (10, 13)), mover=(True,)).winner.tolist() == [0]
    assert vote(block((10, 11), (10, 14)), mover=(True,)).winner.tolist() == [1]


@pytest.mark.parametrize(
    ("columns", "elsewhere", "claims"),
    [
        (5, 40, False),  # 100 of the part's 800 votes, 12.5 %, and 20 % of its own 500
        (7, 40, True),  # 17.5 % of the part's
        (5, 26, False),  # 28 % of its own
        (5, 21, True),  # 32 % of its own
    ],
)
def test_a_claim_needs_a_share_of_the_part_or_of_the_track(
    columns: int, elsewhere: int, claims: bool
) -> None:
    other = block((40, 50), (10, 10 + elsewhere))
    parts = np.where(other, np.int32(2), PART).astype(np.int32)
    most, some = block((10, 30), (10, 50 - columns)), block((10, 30), (50 - columns, 50))
    present = vote(most, some | other, mover=(True, True), parts=parts).present
    assert present[0].tolist() == [True, claims]


def test_of_static_tracks_the_strongest_alone_stays_beside_the_movers() -> None:
    thirds = [block((10, 30), (10, 20)), block((10, 30), (20, 35)), block((10, 30), (35, 50))]
    assert vote(*thirds, mover=(False, False, True)).present.tolist() == [[False, True, True]]
    assert vote(*thirds, mover=(True, True, True)).present.tolist() == [[True, True, True]]
    assert vote(*thirds, mover=(False, False, False)).present.tolist() == [[False, True, False]]


def test_no_tracks_or_no_parts() -> None:
    nobody = masks.count_votes(PART, 1, np.zeros_like(PART), 0, np.empty(0, np.bool_))
    assert nobody.winner.tolist() == [0]
    nothing = masks.count_votes(np.zeros_like(PART), 0, PART, 1, np.array([True]))
    assert len(nothing.winner) == 0


def test_a_part_of_one_track_is_its_own_as_a_whole() -> None:
    expected = labelled(block((10, 30), (10, 20)))
    ballot = masks.count_votes(PART, 1, expected, 1, np.array([False]))
    np.testing.assert_array_equal(masks.divide(PART, expected, ballot, ballot.winner), PART)


def test_a_shared_part_is_divided_by_the_nearest_vote() -> None:
    """Votes at both ends: the 20 columns between them are shared out in the middle."""
    expected = labelled(block((10, 30), (10, 20)), block((10, 30), (40, 50)))
    ballot = masks.count_votes(PART, 1, expected, 2, np.array([True, False]))
    labels = masks.divide(PART, expected, ballot, ballot.winner)
    assert (labels[10:30, 10:29] == 1).all()
    assert (labels[10:30, 31:50] == 2).all()
    assert not labels[PART == 0].any()


def test_who_has_no_claim_to_a_part_gets_no_cell_of_it() -> None:
    expected = labelled(block((10, 30), (10, 20)), block((10, 30), (20, 35)), block((10, 30), (35, 50)))
    ballot = masks.count_votes(PART, 1, expected, 3, np.array([False, False, True]))
    labels = masks.divide(PART, expected, ballot, ballot.winner)
    assert set(np.unique(labels[PART > 0])) == {2, 3}


def test_a_part_taken_from_its_winner_belongs_to_nobody() -> None:
    expected = labelled(block((10, 30), (10, 30)), block((10, 30), (30, 50)))
    ballot = masks.count_votes(PART, 1, expected, 2, np.array([True, True]))
    assert not masks.divide(PART, expected, ballot, np.zeros(1, np.int32)).any()


# Somebody who stood at a table, as one part with it, and the table; both are track 0's. A mover is track 1.
CELLS = np.array([200, 300])
MOVES = np.array([False, True])


def ballot(*present: tuple[bool, bool]) -> masks.Ballot:
    table = np.array(present)
    return masks.elect(table, table * np.array([[150], [290]]))


@pytest.mark.parametrize(("came", "winner"), [(60, 0), (59, 1)])
def test_a_part_that_came_leaves_the_track_of_what_was_there(came: int, winner: int) -> None:
    """Three tenths of it."""
    left = masks.release(ballot((True, False), (True, False)), CELLS, np.array([came, 0]), MOVES)
    np.testing.assert_array_equal(left.winner, [winner, 1])
    np.testing.assert_array_equal(left.present, [[winner == 1, False], [True, False]])


@pytest.mark.parametrize(("came", "winner"), [(20, 0), (19, 1)])
def test_a_few_cells_that_came_prove_nothing(came: int, winner: int) -> None:
    left = masks.release(
        ballot((True, False), (True, False)), np.array([30, 300]), np.array([came, 0]), MOVES
    )
    np.testing.assert_array_equal(left.winner, [winner, 1])


def test_a_part_that_came_is_the_movers_alone_who_has_a_claim_to_it() -> None:
    left = masks.release(ballot((True, True), (True, False)), CELLS, np.array([60, 0]), MOVES)
    np.testing.assert_array_equal(left.winner, [2, 1])
    np.testing.assert_array_equal(left.present, [[False, True], [True, False]])


@pytest.mark.parametrize(("cells", "winner"), [(301, 1), (300, 0)])
def test_what_came_almost_whole_is_that_track_itself(cells: int, winner: int) -> None:
    """Three quarters of it, and more, may have come."""
    sizes = np.array([cells, 100])
    left = masks.release(ballot((True, False), (True, False)), sizes, np.array([290, 0]), MOVES)
    np.testing.assert_array_equal(left.winner, [winner, 1])


def test_a_mover_keeps_what_came() -> None:
    before = ballot((False, True), (False, True))
    left = masks.release(before, CELLS, np.array([200, 0]), MOVES)
    np.testing.assert_array_equal(left.present, before.present)
    np.testing.assert_array_equal(left.winner, before.winner)


def test_what_came_in_two_parts_has_left_nothing_behind() -> None:
    """Nothing of the track stood there before: it is the track itself."""
    before = ballot((True, False), (True, False))
    left = masks.release(before, np.array([200, 200]), np.array([150, 150]), MOVES)
    np.testing.assert_array_equal(left.present, before.present)
    np.testing.assert_array_equal(left.winner, [1, 1])


def test_a_mover_who_had_won_the_part_keeps_its_votes() -> None:
    before = masks.elect(np.array([[True, True], [True, False]]), np.array([[140, 150], [290, 0]]))
    left = masks.release(before, CELLS, np.array([60, 0]), MOVES)
    np.testing.assert_array_equal(left.winner, [2, 1])
    np.testing.assert_array_equal(left.votes, [150, 290])


def test_a_part_that_came_goes_to_the_mover_with_the_most_votes_for_it() -> None:
    present = np.array([[True, True, True], [True, False, False]])
    before = masks.elect(present, np.array([[150, 20, 40], [290, 0, 0]]))
    left = masks.release(before, CELLS, np.array([60, 0]), np.array([False, True, True]))
    np.testing.assert_array_equal(left.winner, [3, 1])
    np.testing.assert_array_equal(left.votes, [40, 290])
