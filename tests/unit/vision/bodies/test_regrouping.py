"""Which tracks are joined: what the tracks themselves tell reaches the rules."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.detections import detection
from tests.support.grids import grid_of, wall
from tests.support.parts import ARM, PERSON, regions
from vision.bodies.arrivals import Changes
from vision.bodies.regrouping import regrouped
from vision.bodies.tracks import Tracks


@pytest.mark.parametrize(("moving_s", "joined"), [(0.9, True), (1.1, False)])
def test_who_has_moved_for_a_second_is_not_joined_for_want_of_precision(
    moving_s: float, joined: bool
) -> None:
    """0.6 m/s apart, known to 0.2 m/s along each axis; only the smaller one's time counts."""
    seen = detection(grid_of(wall(9.0)))
    tracks = Tracks()
    tracks.start(np.zeros((2, 3)), 0.1, 0.2, 1.0, 0)
    tracks.moving[:] = True
    tracks.state[:, 3] = [0.8, 0.2]
    tracks.moving_s[:] = [5.0, moving_s]
    nowhere = np.zeros(seen.grid.depth_m.shape, np.bool_)
    changes = Changes(nowhere, np.empty(0, np.intp), nowhere, 0.0)
    labels = regrouped(tracks, seen, nowhere.astype(np.int32), regions(PERSON, ARM), changes)
    assert (labels is not None) == joined
    assert tracks.merged_away.tolist() == [False, joined]
