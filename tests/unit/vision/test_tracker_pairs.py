"""Tracking of two people side by side: when one track becomes two, and when two do not become one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from config.perception import PerceptionConfig
from hal.types import FloatArray
from tests.support.detections import FRAME_NS, detection, track
from tests.support.grids import CAMERA, grid_of, nearest, people, plate
from vision.detection import unknown_residuals
from vision.tracker import Tracker

PACE_M = 0.8 * FRAME_NS * 1e-9  # in one frame


def pair(frame: int, gap_m: float) -> FloatArray:
    """A grown-up and, gap_m to the right, a child, who walk alike."""
    x_m = -1.1 + frame * PACE_M
    grown = plate(3.0, (x_m, x_m + 0.5), (-0.9, 1.0))
    child = plate(3.0, (x_m + 0.5 + gap_m, x_m + 0.9 + gap_m), (-0.3, 1.0))
    return nearest(grown, child)


def test_a_pair_that_would_be_divided_again_is_not_merged() -> None:
    percepts = track([pair(k, 0.18) for k in range(40)])
    ids = [tuple(one.id for one in percept.scene.obstacles if one.moving) for percept in percepts[15:]]
    assert len(ids[0]) == 2
    assert set(ids) == {ids[0]}  # the same two throughout: neither merged nor born again


def test_a_track_that_is_merged_into_another_one_ends_at_once() -> None:
    """A walker's bag, 0.1 m beside him, is a track of its own until both are seen to move."""
    views = []
    for k in range(8):
        x_m = -1.1 + k * PACE_M
        views.append(
            nearest(
                plate(3.0, (x_m, x_m + 0.4), (-0.9, 1.0)), plate(3.0, (x_m + 0.5, x_m + 0.65), (-0.3, 0.5))
            )
        )
    seen = [percept.scene.obstacles for percept in track(views)]
    assert [len(obstacles) for obstacles in seen[3:]] == [2, 2, 1, 1, 1]
    assert seen[5][0].moving
    assert seen[5][0].extent_m[0] > 0.55  # with the bag


def tracks_of_a_pair(static_chi2: float) -> int:
    """Number of obstacles that are seen of two people, shoulder before shoulder, with four fragments."""
    tracker = Tracker(PerceptionConfig(), body_height_m=1.5, clearance_m=0.05)
    x_m = np.array([-0.3, -0.2, 0.2, 0.3])
    u = CAMERA.cx + CAMERA.fx * x_m / 3.0
    ends_px = np.stack((np.column_stack((u, np.full(4, 120.0))), np.column_stack((u, np.full(4, 150.0)))), 1)
    for k in range(8):
        motion = replace(
            unknown_residuals(8), static_chi2=np.full(8, static_chi2), usable=np.ones(8, np.bool_)
        )
        seen = replace(
            detection(grid_of(people(0.4)), k),
            ids=np.arange(4),
            ends_px=ends_px.astype(np.float32),
            near_m=np.full((4, 2), 3.0, np.float32),
            age_frames=np.full(4, 8, np.intp),
            motion=motion,
        )
        percept = tracker.step(seen, None)
    return len(percept.scene.obstacles)


def test_two_people_of_whom_one_stands_are_divided_if_their_fragments_contradict_standing_still() -> None:
    """Together they are not seen to move as one body."""
    assert tracks_of_a_pair(static_chi2=1.0) == 1
    assert tracks_of_a_pair(static_chi2=100.0) == 2
