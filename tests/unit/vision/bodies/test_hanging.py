"""Which tracks hang above the robot: what ends above it does, even if it once seemed to reach down."""

from __future__ import annotations

import numpy as np
import pytest

from hal.types import FloatArray
from tests.support.grids import LEVEL_UP, grid_of, labelled, nearest, plane, plate, wall
from vision.bodies import hanging
from vision.bodies.tracks import Tracks
from vision.depth.regions import measure

ROBOT_M, CAMERA_M, DT_S = 0.5, 0.6, 0.1
# A bar 3 m ahead, 0.84 to 0.96 m over the floor, on a post at its left end.
BAR = plate(3.0, (-1.0, 1.0), (-0.36, -0.24))
POST = plate(3.0, (-1.0, -0.9), (-0.36, 0.6))
FLOOR = np.where(plane(LEVEL_UP, CAMERA_M) > 10.0, 0.0, plane(LEVEL_UP, CAMERA_M))


def seen_for(frames: int, depth_m: FloatArray, body_m: FloatArray, tracks: Tracks | None = None) -> Tracks:
    """A track on body_m, which is seen to reach down in a first frame, after some frames of depth_m."""
    if tracks is None:
        tracks = Tracks()
        tracks.start(np.array([[0.0, 0.0, 3.0]]), 0.2, 1.5, 0.0, 0)
    grid, labels = grid_of(depth_m, LEVEL_UP, CAMERA_M), labelled((body_m > 0.0) & (depth_m == body_m))
    for _ in range(frames):
        hanging.update(tracks, grid, labels, measure(grid, labels, 1), ROBOT_M, DT_S)
    return tracks


def hangs(frames: int, depth_m: FloatArray, body_m: FloatArray = BAR) -> bool:
    return bool(seen_for(frames, depth_m, body_m).overhead[0])


def test_a_bar_hangs_once_it_has_been_seen_without_its_post_for_a_second() -> None:
    over_floor = nearest(BAR, FLOOR)
    assert not hangs(9, over_floor)
    assert hangs(11, over_floor)


def test_it_does_not_while_it_is_one_with_its_post() -> None:
    gate = nearest(BAR, POST)
    assert not hangs(30, nearest(gate, FLOOR), gate)


def test_it_hangs_no_longer_once_it_is_seen_to_reach_down() -> None:
    tracks, gate = seen_for(11, nearest(BAR, FLOOR), BAR), nearest(BAR, POST)
    assert not seen_for(1, nearest(gate, FLOOR), gate, tracks).overhead[0]


def test_a_frame_in_which_its_end_is_not_seen_begins_the_second_anew() -> None:
    over_floor, behind_crate = nearest(BAR, FLOOR), nearest(BAR, plate(2.0, (-1.0, 1.0), (-0.2, 0.6)), FLOOR)
    tracks = seen_for(9, over_floor, BAR)
    seen_for(1, behind_crate, BAR, tracks)
    assert not seen_for(9, over_floor, BAR, tracks).overhead[0]
    assert seen_for(2, over_floor, BAR, tracks).overhead[0]


@pytest.mark.parametrize(
    ("legs", "below"),
    [
        ("hidden", plate(2.0, (-1.0, 1.0), (-0.15, 0.6))),
        ("without depth", np.zeros_like(BAR)),
        ("in front of a wall", wall(3.1)),
    ],
)
def test_somebody_whose_legs_are_not_seen_does_not_hang(legs: str, below: FloatArray) -> None:
    """Below legs that give no depth, the floor begins where he stands."""
    floor = np.where((FLOOR > 3.0) | (FLOOR == 0.0), below, FLOOR)
    assert not hangs(30, nearest(BAR, floor))


@pytest.mark.parametrize(("legs_m", "expected"), [(0.05, True), (0.15, False), (0.3, False)])
def test_it_stands_on_legs_that_give_no_depth(legs_m: float, expected: bool) -> None:
    """The floor before them is measured next. Fewer than three columns are noise; one is 4 cm wide there."""
    behind = (plate(3.0, (-0.5 * legs_m, 0.5 * legs_m), (-0.24, 0.6)) > 0.0) & (FLOOR > 3.0)
    assert hangs(30, nearest(BAR, np.where(behind, 0.0, FLOOR))) == expected


def test_a_post_before_it_that_hides_a_few_columns_does_not_count() -> None:
    post = plate(2.0, (-0.1, 0.1), (-0.1, 0.6))
    assert hangs(11, nearest(BAR, post, FLOOR))


def test_what_the_border_of_the_image_cuts_is_not_judged() -> None:
    """A robot that stands before a table no longer sees its legs."""
    table = plate(1.5, (-1.0, 1.0), (-0.36, -0.24))
    assert table[:, 0].any()
    assert not hangs(30, nearest(table, FLOOR), table)


def test_in_front_of_what_is_beyond_the_range_it_hangs() -> None:
    far = np.where(FLOOR > 0.0, FLOOR, 12.0)
    assert hangs(11, nearest(BAR, far))


def test_what_moves_or_may_move_has_legs() -> None:
    tracks = seen_for(0, BAR, BAR)
    tracks.evidence[0] = 0.3
    assert not seen_for(30, nearest(BAR, FLOOR), BAR, tracks).overhead[0]


def test_without_a_known_floor_nothing_hangs() -> None:
    tracks, depth_m = seen_for(11, nearest(BAR, FLOOR), BAR), nearest(BAR, FLOOR)
    grid, labels = grid_of(depth_m), labelled(depth_m == BAR)
    hanging.update(tracks, grid, labels, measure(grid, labels, 1), ROBOT_M, DT_S)
    assert not tracks.overhead[0]
