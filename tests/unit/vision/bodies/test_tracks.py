"""Whether tracks go where their filters say, and which of them cannot be where they are seen."""

from __future__ import annotations

import numpy as np
import pytest

from vision.bodies.tracks import Tracks


@pytest.mark.parametrize("dt_s", [1.0 / 30.0, 0.2])
def test_a_centre_goes_that_has_gone_about_as_fast_as_its_velocity_says(dt_s: float) -> None:
    """A walker, one of whom less and less is seen, the corner of a wall taken for him, and who goes back."""
    speeds_mps = np.array([1.0, 0.5, 0.3, -1.0])
    tracks = Tracks()
    tracks.start(np.zeros((4, 3)), 0.1, 1.5, 0.0, 0)
    tracks.state[:, 3] = 1.0
    for _ in range(round(1.0 / dt_s)):
        tracks.state[:, 0] += speeds_mps * dt_s
        advances = tracks.update_trailing_average(dt_s)
    np.testing.assert_array_equal(advances, [True, True, False, False])


def test_trailing_average_follows_its_track() -> None:
    tracks = Tracks()
    tracks.start(np.zeros((2, 3)), 0.1, 1.5, 0.0, 0)
    tracks.state[:, 3] = [0.0, 1.0]
    for _ in range(10):
        tracks.state[1, 0] += 0.05
        tracks.update_trailing_average(0.05)
    tracks.keep(np.array([False, True]))
    assert tracks.update_trailing_average(0.05).tolist() == [True]


AHEAD = np.array([0.0, 0.0, 1.0])


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
        tracks.overdue(0.6, sight, resolves_m), [True, False, False, False, False, False]
    )
    assert not tracks.overdue(0.5, sight, resolves_m).any()
    assert not tracks.overdue(0.0, sight, resolves_m).any()  # nothing was seen then


def test_mover_along_the_line_of_sight_is_overdue_once_depth_resolves_it() -> None:
    tracks = movers(3)
    tracks.state[:, 3:] = [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]
    tracks.extent_m[2, 2] = 1.1
    resolves_m = np.array([0.59, 0.61, 0.59])
    np.testing.assert_array_equal(
        tracks.overdue(0.6, np.tile(AHEAD, (3, 1)), resolves_m), [True, False, False]
    )


def test_hidden_track_is_nearly_hidden_without_cells() -> None:
    tracks = Tracks()
    tracks.start(np.zeros((2, 3)), 0.1, 1.5, 1.0, 0)
    tracks.cells[:] = 100
    tracks.mark_hidden(np.array([False, True]))
    assert tracks.nearly_hidden.tolist() == [False, True]
    assert tracks.cells.tolist() == [100, 0]


def test_ids_that_are_not_there_have_no_index() -> None:
    tracks = Tracks()
    wanted = np.array([-1, 1, 2, 3, 4])
    np.testing.assert_array_equal(tracks.index_of(wanted), np.full(5, -1))
    tracks.start(np.zeros((3, 3)), 0.2, 1.5, 0.0, 0)
    tracks.keep(np.array([True, False, True]))
    np.testing.assert_array_equal(tracks.index_of(wanted), [-1, 0, -1, 1, -1])
    assert len(tracks.index_of(np.empty(0, np.int64))) == 0
