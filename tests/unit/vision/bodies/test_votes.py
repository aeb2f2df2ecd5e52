"""Which cells belong to which track: votes, division."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.ballots import MOVES, PART, vote
from tests.support.grids import block, labelled
from vision.bodies import votes


def test_a_part_goes_to_whom_most_cells_speak_for() -> None:
    ballot = vote(block((10, 30), (10, 20)), block((10, 30), (20, 50)), mover=(True, True))
    assert ballot.winner.tolist() == [2]
    assert ballot.votes.tolist() == [600]
    assert ballot.claims.tolist() == [[True, True]]


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
    present = vote(most, some | other, mover=(True, True), parts=parts).claims
    assert present[0].tolist() == [True, claims]


def test_only_the_strongest_static_track_stays_beside_the_movers() -> None:
    thirds = [block((10, 30), (10, 20)), block((10, 30), (20, 35)), block((10, 30), (35, 50))]
    assert vote(*thirds, mover=(False, False, True)).claims.tolist() == [[False, True, True]]
    assert vote(*thirds, mover=(True, True, True)).claims.tolist() == [[True, True, True]]
    assert vote(*thirds, mover=(False, False, False)).claims.tolist() == [[False, True, False]]


def test_no_tracks_or_no_parts() -> None:
    nobody = votes.count_votes(PART, 1, np.zeros_like(PART), 0, np.empty(0, np.bool_))
    assert nobody.winner.tolist() == [0]
    nothing = votes.count_votes(np.zeros_like(PART), 0, PART, 1, np.array([True]))
    assert len(nothing.winner) == 0


def test_a_part_of_one_track_is_its_own_as_a_whole() -> None:
    expected = labelled(block((10, 30), (10, 20)))
    ballot = votes.count_votes(PART, 1, expected, 1, np.array([False]))
    np.testing.assert_array_equal(votes.divide(PART, expected, ballot, ballot.winner), PART)


def test_a_shared_part_is_divided_by_the_nearest_vote() -> None:
    """Votes at both ends: the 20 columns between them are shared out in the middle."""
    expected = labelled(block((10, 30), (10, 20)), block((10, 30), (40, 50)))
    ballot = votes.count_votes(PART, 1, expected, 2, np.array([True, False]))
    labels = votes.divide(PART, expected, ballot, ballot.winner)
    assert (labels[10:30, 10:29] == 1).all()
    assert (labels[10:30, 31:50] == 2).all()
    assert not labels[PART == 0].any()


def test_a_track_without_a_claim_to_a_part_gets_no_cell_of_it() -> None:
    expected = labelled(block((10, 30), (10, 20)), block((10, 30), (20, 35)), block((10, 30), (35, 50)))
    ballot = votes.count_votes(PART, 1, expected, 3, np.array([False, False, True]))
    labels = votes.divide(PART, expected, ballot, ballot.winner)
    assert set(np.unique(labels[PART > 0])) == {2, 3}


def test_a_part_taken_from_its_winner_belongs_to_nobody() -> None:
    expected = labelled(block((10, 30), (10, 30)), block((10, 30), (30, 50)))
    ballot = votes.count_votes(PART, 1, expected, 2, np.array([True, True]))
    assert not votes.divide(PART, expected, ballot, np.zeros(1, np.int32)).any()


# Somebody who stood at a table, as one part with it, and the table; both are track 0's. A mover is track 1.
CELLS = np.array([200, 300])


def ballot(*present: tuple[bool, bool]) -> votes.Ballot:
    table = np.array(present)
    return votes.elect(table, table * np.array([[150], [290]]))


@pytest.mark.parametrize(("came", "winner"), [(60, 0), (59, 1)])
def test_a_part_that_came_leaves_the_track_of_what_was_there(came: int, winner: int) -> None:
    """Three tenths of it."""
    left = votes.drop_static_from_arrived(
        ballot((True, False), (True, False)), CELLS, np.array([came, 0]), MOVES
    )
    np.testing.assert_array_equal(left.winner, [winner, 1])
    np.testing.assert_array_equal(left.claims, [[winner == 1, False], [True, False]])


@pytest.mark.parametrize(("came", "winner"), [(20, 0), (19, 1)])
def test_a_few_cells_that_came_prove_nothing(came: int, winner: int) -> None:
    left = votes.drop_static_from_arrived(
        ballot((True, False), (True, False)), np.array([30, 300]), np.array([came, 0]), MOVES
    )
    np.testing.assert_array_equal(left.winner, [winner, 1])


def test_a_part_that_came_is_the_movers_alone_who_has_a_claim_to_it() -> None:
    left = votes.drop_static_from_arrived(
        ballot((True, True), (True, False)), CELLS, np.array([60, 0]), MOVES
    )
    np.testing.assert_array_equal(left.winner, [2, 1])
    np.testing.assert_array_equal(left.claims, [[False, True], [True, False]])


@pytest.mark.parametrize(("cells", "winner"), [(301, 1), (300, 0)])
def test_part_that_arrived_almost_whole_stays_with_its_track(cells: int, winner: int) -> None:
    """Three quarters of it, and more, may have come."""
    sizes = np.array([cells, 100])
    left = votes.drop_static_from_arrived(
        ballot((True, False), (True, False)), sizes, np.array([290, 0]), MOVES
    )
    np.testing.assert_array_equal(left.winner, [winner, 1])


def test_a_mover_keeps_what_came() -> None:
    before = ballot((False, True), (False, True))
    left = votes.drop_static_from_arrived(before, CELLS, np.array([200, 0]), MOVES)
    np.testing.assert_array_equal(left.claims, before.claims)
    np.testing.assert_array_equal(left.winner, before.winner)


def test_a_track_that_arrived_in_two_parts_keeps_its_claims() -> None:
    """Nothing of the track stood there before: it is the track itself."""
    before = ballot((True, False), (True, False))
    left = votes.drop_static_from_arrived(before, np.array([200, 200]), np.array([150, 150]), MOVES)
    np.testing.assert_array_equal(left.claims, before.claims)
    np.testing.assert_array_equal(left.winner, [1, 1])


def test_a_mover_who_had_won_the_part_keeps_its_votes() -> None:
    before = votes.elect(np.array([[True, True], [True, False]]), np.array([[140, 150], [290, 0]]))
    left = votes.drop_static_from_arrived(before, CELLS, np.array([60, 0]), MOVES)
    np.testing.assert_array_equal(left.winner, [2, 1])
    np.testing.assert_array_equal(left.votes, [150, 290])


def test_a_part_that_came_goes_to_the_mover_with_the_most_votes_for_it() -> None:
    present = np.array([[True, True, True], [True, False, False]])
    before = votes.elect(present, np.array([[150, 20, 40], [290, 0, 0]]))
    left = votes.drop_static_from_arrived(before, CELLS, np.array([60, 0]), np.array([False, True, True]))
    np.testing.assert_array_equal(left.winner, [3, 1])
    np.testing.assert_array_equal(left.votes, [40, 290])


def test_first_of_two_tracks_with_equal_votes_wins() -> None:
    even = votes.elect(np.array([[True, True], [False, True], [False, False]]), np.full((3, 2), 7))
    np.testing.assert_array_equal(even.winner, [1, 2, 0])
    np.testing.assert_array_equal(even.votes, [7, 7, 0])
