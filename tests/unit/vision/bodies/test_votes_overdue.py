"""Which movers cannot be where they are seen; behind what stands, at about its depth, they keep no cells."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.ballots import MOVES, PART, vote
from tests.support.grids import block, labelled
from vision.bodies import votes
from vision.bodies.tracks import Tracks

HALF = block((10, 30), (10, 30))  # of PART; the other half is a crate's, which stands
OVERDUE = np.array([False, True])
AHEAD = np.array([0.0, 0.0, 1.0])


@pytest.mark.parametrize(("stayed_columns", "hidden"), [(14, True), (13, False)])
def test_a_mover_that_must_have_gone_on_loses_what_was_there_before(
    stayed_columns: int, hidden: bool
) -> None:
    """Seven tenths of what speaks for it."""
    expected = (PART > 0) & ~HALF, HALF
    before, stayed = vote(*expected, mover=(False, True)), block((10, 30), (10, 10 + stayed_columns))
    left, lost = votes.drop_overdue_movers(before, PART, labelled(*expected), stayed, OVERDUE, MOVES)
    np.testing.assert_array_equal(left.claims, [[True, not hidden]])
    np.testing.assert_array_equal(lost, [False, hidden])
    labels = votes.divide(PART, labelled(*expected), left, left.winner)
    assert (labels[HALF] == (1 if hidden else 2)).all()


@pytest.mark.parametrize(
    ("mover", "overdue"), [((True, True), (False, True)), ((False, True), (False, False))]
)
def test_mover_that_is_not_overdue_or_not_contested_keeps_its_votes(
    mover: tuple[bool, bool], overdue: tuple[bool, bool]
) -> None:
    expected = (PART > 0) & ~HALF, HALF
    before = vote(*expected, mover=mover)
    left, lost = votes.drop_overdue_movers(
        before, PART, labelled(*expected), PART > 0, np.array(overdue), np.array(mover)
    )
    assert left is before
    assert not lost.any()


def test_a_mover_in_sight_elsewhere_is_not_hidden() -> None:
    parts = labelled(block((10, 30), (10, 50)), block((35, 45), (10, 20)))
    expected = (parts == 1) & ~HALF, HALF | (parts == 2)
    before = vote(*expected, mover=(False, True), parts=parts)
    left, lost = votes.drop_overdue_movers(before, parts, labelled(*expected), parts > 0, OVERDUE, MOVES)
    np.testing.assert_array_equal(left.claims, [[True, False], [False, True]])
    assert not lost.any()


def test_a_mover_ends_where_a_guess_has_it_if_what_stands_claims_all_of_its_parts() -> None:
    expected = (PART > 0) & ~HALF, HALF
    both = vote(*expected, mover=(False, True))
    np.testing.assert_array_equal(votes.border_is_guess(both, MOVES), [False, True])
    np.testing.assert_array_equal(votes.border_is_guess(both, np.array([True, True])), [False, False])
    # Some of it is seen by itself.
    parts = labelled(block((10, 30), (10, 50)), block((35, 45), (10, 20)))
    seen = vote((parts == 1) & ~HALF, HALF | (parts == 2), mover=(False, True), parts=parts)
    np.testing.assert_array_equal(votes.border_is_guess(seen, MOVES), [False, False])
    # Who claims nothing ends nowhere.
    alone = vote(PART > 0, np.zeros_like(HALF), mover=(False, True))
    np.testing.assert_array_equal(votes.border_is_guess(alone, MOVES), [False, False])


def movers(count: int) -> Tracks:
    """Half a metre wide and 1.8 m tall, at 0.5 m/s across the view, with no proof of it for 0.05 s."""
    tracks = Tracks()
    tracks.start(np.zeros((count, 3)), 0.1, 1.5, 1.0, 0)
    tracks.state[:, 3] = 0.5
    tracks.moving[:] = True
    tracks.extent_m[:] = 0.49, 1.8, 0.1
    tracks.unproven_s[:] = 0.05
    return tracks


def test_overdue_is_a_mover_unproven_that_has_gone_most_of_its_width_since() -> None:
    """0.6 s at 0.5 m/s are 0.3 m: six tenths of 0.5 m, however tall it is."""
    tracks = movers(6)
    tracks.state[1, 3] = 0.45
    tracks.extent_m[2, 0] = tracks.extent_m[3, 2] = 0.51
    tracks.unproven_s[4] = 0.04
    tracks.moving[5] = False
    sight, resolves_m = np.tile(AHEAD, (6, 1)), np.full(6, 0.4)
    np.testing.assert_array_equal(
        votes.overdue_movers(tracks, 0.6, sight, resolves_m), [True, False, False, False, False, False]
    )
    assert not votes.overdue_movers(tracks, 0.5, sight, resolves_m).any()
    assert not votes.overdue_movers(tracks, 0.0, sight, resolves_m).any()  # nothing was seen then


def test_mover_along_the_line_of_sight_is_overdue_once_depth_resolves_it() -> None:
    tracks = movers(3)
    tracks.state[:, 3:] = [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]
    tracks.extent_m[2, 2] = 1.1
    resolves_m = np.array([0.59, 0.61, 0.59])
    np.testing.assert_array_equal(
        votes.overdue_movers(tracks, 0.6, np.tile(AHEAD, (3, 1)), resolves_m), [True, False, False]
    )
