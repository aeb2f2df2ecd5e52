"""Tracking on exact depth grids: who goes behind something at about his depth, and who pushes something."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from config.perception import PerceptionConfig
from hal.types import FloatArray
from tests.support.detections import detection, track
from tests.support.grids import grid_of, nearest, plate, wall
from tests.support.walker import moving, walker, way_m
from vision.bodies import votes
from vision.tracker import Tracker

_BACK = wall(8.0)


@pytest.mark.parametrize("hides", [True, False])
def test_a_mover_that_lost_all_of_its_parts_is_not_shown_a_frame_longer(
    monkeypatch: pytest.MonkeyPatch, hides: bool
) -> None:
    """Nor does it get them back by another way; what is merely not seen is shown for a moment."""

    def drop_overdue_movers(ballot: votes.Ballot, *_: object) -> tuple[votes.Ballot, NDArray[np.bool_]]:
        nobody = np.zeros_like(ballot.claims)
        return votes.elect(nobody, ballot.votes_of), np.full(nobody.shape[1], hides)

    tracker = Tracker(PerceptionConfig(), body_height_m=1.5, clearance_m=0.05)
    for k in range(30):
        percept = tracker.step(detection(grid_of(nearest(walker(-0.7 + way_m(k)), _BACK)), k), None)
    (before,) = moving(percept)
    monkeypatch.setattr(votes, "drop_overdue_movers", drop_overdue_movers)
    percept = tracker.step(detection(grid_of(nearest(walker(-0.7 + way_m(30)), _BACK)), 30), None)
    assert [one.id for one in moving(percept)] == ([] if hides else [before.id])


def test_behind_something_at_about_his_depth_nobody_is_shown() -> None:
    """As connected depth he is one with the crate; in frame 46 5 cm of him are left to see, then nothing."""
    crate = plate(3.94, (0.3, 1.5), (-0.7, 1.0))
    percepts = track([nearest(crate, walker(-0.7 + way_m(k)), _BACK) for k in range(56)])
    for percept in percepts[36:47]:
        (one,) = moving(percept)
        np.testing.assert_allclose(one.velocity_mps, [0.8, 0.0, 0.0], atol=0.05)
    assert not any(moving(percept) for percept in percepts[51:])  # shown for 0.15 s longer


def pusher(frame: int) -> FloatArray:
    """He walks to the left; a trolley half as tall before him, joined to him by its handle."""
    x_m = 0.6 - way_m(frame)
    person = plate(4.0, (x_m - 0.2, x_m + 0.2), (-0.6, 1.0))
    trolley, handle = plate(4.0, (x_m - 1.2, x_m - 0.5), (0.2, 1.0)), plate(4.0, (x_m - 0.5, x_m), (0.2, 0.4))
    return nearest(person, trolley, handle, _BACK)


def test_a_person_and_what_he_pushes_are_one_obstacle() -> None:
    percepts = track([pusher(k) for k in range(30)])
    for percept in percepts[6:]:
        (one,) = moving(percept)
        assert one.extent_m[0] > 1.2


def test_a_person_who_passes_a_low_static_thing_is_divided_from_it() -> None:
    """A crate beside which he walks, at his depth: one part with it as long as he touches it."""
    crate = plate(4.0, (0.0, 0.7), (0.3, 1.0))
    percepts = track([nearest(crate, walker(-1.1 + way_m(k)), _BACK) for k in range(70)])
    for percept in percepts[62:]:
        (one,) = moving(percept)
        assert one.extent_m[0] < 0.8


def test_who_comes_out_from_behind_something_moves_before_all_of_him_is_seen() -> None:
    """Behind him nothing is measured, so nothing arrives; his middle goes half as fast as he does."""
    shelf = plate(2.0, (-1.5, 0.0), (-1.2, 1.2))
    percepts = track([nearest(walker(-0.25 + way_m(k)), shelf) for k in range(15)])
    (mover,) = moving(percepts[-1])  # 0.13 m of him are still hidden
    np.testing.assert_allclose(mover.velocity_mps, [0.8, 0.0, 0.0], atol=0.15)


def test_what_stands_and_is_uncovered_never_moves() -> None:
    views = [
        nearest(walker(0.0), plate(2.0, (-1.5, 0.12 - 0.5 * way_m(k)), (-1.2, 1.2)), _BACK) for k in range(40)
    ]
    for percept in track(views):
        assert not [one for one in moving(percept) if one.position_m[2] > 3.0]


def test_rims_are_not_compared_across_a_frame_whose_camera_motion_is_noisy() -> None:
    """The same as he comes out, but in frame 10 few fragments fit one motion of the camera."""
    shelf = plate(2.0, (-1.5, 0.0), (-1.2, 1.2))
    tracker = Tracker(PerceptionConfig(), body_height_m=1.5, clearance_m=0.05)
    for frame in range(15):
        seen = detection(grid_of(nearest(walker(-0.25 + way_m(frame)), shelf)), frame)
        if frame == 10:
            seen = replace(seen, reckoned=False, blurred=True)
        percept = tracker.step(seen, None)
    assert not moving(percept)
