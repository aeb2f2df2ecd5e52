"""Cells that are cut out of tracks and become tracks of their own."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from hal.types import FloatArray
from tests.support.detections import detection
from tests.support.grids import COLUMNS, ROWS, grid_of, labelled, wall
from vision.bodies.cutting import Cut, cut_out, without
from vision.bodies.tracks import Tracks
from vision.depth import regions

GRID = grid_of(wall(4.0))
SEEN = detection(GRID, 1)
LABELS = labelled(np.ones((ROWS, COLUMNS), np.bool_))
VELOCITY_MPS = (0.8, 0.0, 0.0)


def cells(columns: tuple[int, int]) -> NDArray[np.intp]:
    """Flat indices of the cells in 20 rows of these columns."""
    mask = np.zeros((ROWS, COLUMNS), np.bool_)
    mask[20:40, slice(*columns)] = True
    return np.flatnonzero(mask)


LEFT, RIGHT = cells((0, 10)), cells((60, 70))


def one_mover() -> Tracks:
    tracks = Tracks()
    tracks.start(np.array([[0.0, 0.0, 4.0]]), 0.2, 1.5, 1.0, 0)
    tracks.state[0, 3:] = VELOCITY_MPS
    tracks.moving[:] = True
    return tracks


def middle_m(chosen: NDArray[np.intp]) -> FloatArray:
    mask = np.zeros((ROWS, COLUMNS), np.int32)
    mask.ravel()[chosen] = 1
    position_m: FloatArray = SEEN.pose.apply(regions.measure(GRID, mask, 1).position_m)[0]
    return position_m


def test_each_cut_becomes_a_track_with_its_cells_its_middle_and_its_measures() -> None:
    tracks = one_mover()
    cuts = [Cut(LEFT, 0.3), Cut(RIGHT, 0.0)]
    labels, measured = cut_out(tracks, SEEN, LABELS, regions.measure(GRID, LABELS, 1), cuts, 1.5)
    assert np.array_equal(np.flatnonzero(labels == 2), LEFT)
    assert np.array_equal(np.flatnonzero(labels == 3), RIGHT)
    assert (LABELS == 1).all()  # these are labels of their own
    assert tracks.evidence.tolist() == [1.0, 0.3, 0.0]
    np.testing.assert_allclose(tracks.state[1:, :3], [middle_m(LEFT), middle_m(RIGHT)])
    assert measured.cells.tolist() == [LABELS.size - len(LEFT) - len(RIGHT), len(LEFT), len(RIGHT)]


def test_where_a_suspect_ends_is_a_guess() -> None:
    tracks = one_mover()
    cuts = [Cut(LEFT, 0.3), Cut(RIGHT, 0.0)]
    cut_out(tracks, SEEN, LABELS, regions.measure(GRID, LABELS, 1), cuts, 1.5)
    assert tracks.border_is_guess.tolist() == [False, True, False]


def test_a_piece_hangs_until_it_is_seen_to_reach_down() -> None:
    """Of a beam over the way, a piece is no obstacle either. The tracker ends this where cells are low."""
    tracks = one_mover()
    cut_out(tracks, SEEN, LABELS, regions.measure(GRID, LABELS, 1), [Cut(LEFT, 0.3), Cut(RIGHT, 0.0)], 1.5)
    assert tracks.overhead.tolist() == [False, True, True]


def test_a_mover_goes_on_from_the_middle_of_what_it_keeps_with_the_same_velocity() -> None:
    tracks = one_mover()
    cuts = [Cut(LEFT, 0.0, left_by=0)]
    labels, _ = cut_out(tracks, SEEN, LABELS, regions.measure(GRID, LABELS, 1), cuts, 1.5)
    kept_m = middle_m(np.flatnonzero(labels == 1))
    np.testing.assert_allclose(tracks.state[0], [*kept_m, *VELOCITY_MPS])
    np.testing.assert_allclose(tracks.surface_state[0, :3], kept_m)
    np.testing.assert_allclose(tracks.trailing_m[0], kept_m)


def test_a_mover_that_has_left_nothing_keeps_its_centre() -> None:
    tracks = one_mover()
    cut_out(tracks, SEEN, LABELS, regions.measure(GRID, LABELS, 1), [Cut(LEFT, 0.3)], 1.5)
    np.testing.assert_allclose(tracks.state[0, :3], [0.0, 0.0, 4.0])


def test_without_cuts_nothing_changes() -> None:
    tracks, measured = one_mover(), regions.measure(GRID, LABELS, 1)
    labels, after = cut_out(tracks, SEEN, LABELS, measured, [], 1.5)
    assert len(tracks) == 1
    assert np.array_equal(labels, LABELS)
    assert after is measured


@pytest.mark.parametrize("cuts", [[], [Cut(LEFT, 0.3)], [Cut(LEFT, 0.3), Cut(RIGHT, 0.0)]])
def test_labels_without_the_cuts(cuts: list[Cut]) -> None:
    left = without(LABELS, cuts)
    assert sorted(np.flatnonzero(left == 0)) == sorted(cell for cut in cuts for cell in cut.cells)
    assert (LABELS == 1).all()
