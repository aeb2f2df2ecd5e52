"""Whether tracks go where their filters say, and which of them cannot be where they are seen."""

from __future__ import annotations

import numpy as np
import pytest

from vision.tracks import Tracks


@pytest.mark.parametrize("dt_s", [1.0 / 30.0, 0.2])
def test_a_centre_goes_that_has_gone_about_as_fast_as_its_velocity_says(dt_s: float) -> None:
    """A walker, one of whom less and less is seen, the corner of a wall taken for him, and who goes back."""
    speeds_mps = np.array([1.0, 0.5, 0.3, -1.0])
    tracks = Tracks()
    tracks.start(np.zeros((4, 3)), 0.1, 1.5, 0.0, 0)
    tracks.state[:, 3] = 1.0
    for _ in range(round(1.0 / dt_s)):
        tracks.state[:, 0] += speeds_mps * dt_s
        goes = tracks.follow_trails(dt_s)
    np.testing.assert_array_equal(goes, [True, True, False, False])


def test_what_the_trail_knows_goes_with_its_track() -> None:
    tracks = Tracks()
    tracks.start(np.zeros((2, 3)), 0.1, 1.5, 0.0, 0)
    tracks.state[:, 3] = [0.0, 1.0]
    for _ in range(10):
        tracks.state[1, 0] += 0.05
        tracks.follow_trails(0.05)
    tracks.keep(np.array([False, True]))
    assert tracks.follow_trails(0.05).tolist() == [True]


def test_overdue_is_a_mover_unproven_that_has_gone_most_of_its_width_since() -> None:
    """0.6 s at 0.5 m/s are 0.3 m: six tenths of 0.5 m, however tall it is."""
    tracks = Tracks()
    tracks.start(np.zeros((6, 3)), 0.1, 1.5, 1.0, 0)
    tracks.state[:, 3] = 0.5
    tracks.moving[:] = True
    tracks.extent_m[:] = 0.49, 1.8, 0.1
    tracks.unproven_s[:] = 0.05
    tracks.state[1, 3] = 0.45
    tracks.extent_m[2, 0] = tracks.extent_m[3, 2] = 0.51
    tracks.unproven_s[4] = 0.04
    tracks.moving[5] = False
    np.testing.assert_array_equal(tracks.overdue(0.6), [True, False, False, False, False, False])
    assert not tracks.overdue(0.5).any()


def test_what_is_hidden_is_known_as_a_sliver_without_cells() -> None:
    tracks = Tracks()
    tracks.start(np.zeros((2, 3)), 0.1, 1.5, 1.0, 0)
    tracks.cells[:] = 100
    tracks.hide(np.array([False, True]))
    assert tracks.sliver.tolist() == [False, True]
    assert tracks.cells.tolist() == [100, 0]
