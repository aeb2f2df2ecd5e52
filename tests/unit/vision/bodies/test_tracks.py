"""Whether tracks go where their filters say."""

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


def test_the_second_opinion_allows_for_a_quarter_of_the_acceleration() -> None:
    """In 2 s a density of 0.1 (m/s^2)^2 s adds 0.2 and 0.05 (m/s)^2 to the variance of a velocity."""
    tracks = Tracks()
    tracks.start(np.zeros((1, 3)), 0.1, 1.5, 0.0, 0)
    tracks.predict(2.0, 0.1, None)
    assert tracks.covariance[0, 3, 3] == pytest.approx(1.5**2 + 0.2)
    assert tracks.surface_covariance[0, 3, 3] == pytest.approx(1.5**2 + 0.05)
    np.testing.assert_array_equal(tracks.state, tracks.surface_state)


def test_trailing_average_follows_its_track() -> None:
    tracks = Tracks()
    tracks.start(np.zeros((2, 3)), 0.1, 1.5, 0.0, 0)
    tracks.state[:, 3] = [0.0, 1.0]
    for _ in range(10):
        tracks.state[1, 0] += 0.05
        tracks.update_trailing_average(0.05)
    tracks.keep(np.array([False, True]))
    assert tracks.update_trailing_average(0.05).tolist() == [True]


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
