"""What tracking knows, put into obstacles and fragments."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hal.types import FloatArray, Pose
from tests.support.detections import FRAME_NS, START_NS, detection
from tests.support.grids import CAMERA, grid_of, no_depth
from vision.bodies import report
from vision.bodies.tracks import Tracks
from vision.camera.lens import rotation_from_vector
from vision.detection import Detection, unknown_residuals
from vision.motion.least_squares import FragmentVelocities

FRAME = 30
NOW_NS = START_NS + FRAME * FRAME_NS
BEFORE_ME = (0.2, -0.1, 4.0)


def tracks(*places: tuple[float, float, float], sightings: int = 3, unseen_s: float = 0.0) -> Tracks:
    """Tracks at places (fixed frame), born ten frames ago."""
    made = Tracks()
    made.start(np.array(places), 0.2, 1.5, 0.0, NOW_NS - 10 * FRAME_NS)
    made.sightings[:] = sightings
    made.seen_ns[:] = NOW_NS - round(unseen_s * 1e9)
    return made


def now(pose: Pose | None = None) -> Detection:
    seen = detection(grid_of(no_depth()), FRAME)
    return seen if pose is None else replace(seen, pose=pose)


def test_a_track_is_listed_from_its_third_sight_on() -> None:
    assert report.obstacles(tracks(BEFORE_ME, sightings=2), now()) == ()
    (one,) = report.obstacles(tracks(BEFORE_ME, sightings=3), now())
    assert one.id == 1
    assert one.age_s == pytest.approx(10 * FRAME_NS * 1e-9)
    assert one.unseen_s == 0.0
    assert one.score == 0.5
    np.testing.assert_allclose(one.position_m, BEFORE_ME)


@pytest.mark.parametrize(("unseen_s", "listed"), [(0.03, True), (0.14, True), (0.17, False)])
def test_a_track_that_is_not_seen_is_listed_for_0_15_s(unseen_s: float, listed: bool) -> None:
    found = report.obstacles(tracks(BEFORE_ME, unseen_s=unseen_s), now())
    assert [one.unseen_s for one in found] == ([pytest.approx(unseen_s)] if listed else [])


@pytest.mark.parametrize("place", [(2.3, 0.0, 4.0), (-2.3, 0.0, 4.0), (0.0, 1.7, 4.0), (0.0, -1.7, 4.0)])
def test_an_unseen_track_out_of_view_is_not_listed(place: tuple[float, float, float]) -> None:
    """The view ends 160 / 300 * 4 = 2.13 m to the sides and 1.6 m up and down."""
    assert report.obstacles(tracks(place, unseen_s=0.03), now()) == ()
    # Where it is seen its centre may be anywhere: a part of it is to be seen.
    assert len(report.obstacles(tracks(place), now())) == 1


def test_track_behind_the_camera_is_not_listed_even_if_just_seen() -> None:
    assert report.obstacles(tracks((0.0, 0.0, -0.5)), now()) == ()


def test_obstacles_are_told_in_the_axes_of_the_camera() -> None:
    """The camera went 1 m ahead and turned right by 90 degrees: x of the fixed frame is ahead."""
    pose = Pose(rotation_from_vector(np.array([0.0, np.pi / 2, 0.0])), np.array([0.0, 0.0, 1.0]))
    made = tracks((3.0, 0.0, 1.5))
    made.state[0, 3:] = [0.4, 0.0, -0.8]
    made.covariance[0, 3:, 3:] = np.diag([0.1, 0.2, 0.3])
    made.moving[0], made.confidence[0], made.fragments[0] = True, 0.8, 7
    (one,) = report.obstacles(made, now(pose))
    np.testing.assert_allclose(one.position_m, [-0.5, 0.0, 3.0], atol=1e-12)
    np.testing.assert_allclose(one.velocity_mps, [0.8, 0.0, 0.4], atol=1e-12)
    np.testing.assert_allclose(one.velocity_cov, np.diag([0.3, 0.2, 0.1]), atol=1e-12)
    assert (one.moving, one.score, one.fragments) == (True, 0.8, 7)


def two_fragments() -> Detection:
    pixels = np.array([[[100.0, 60.0], [120.0, 80.0]], [[159.5, 119.5], [159.5, 119.5]]], np.float32)
    depth = np.array([[3.0, 5.0], [2.0, np.nan]], np.float32)
    return replace(
        now(),
        ids=np.array([3, 8]),
        ends_px=pixels,
        near_m=depth,
        age_frames=np.array([4, 4]),
        motion=replace(unknown_residuals(4), usable=np.array([True, False, False, False])),
    )


def test_reported_fragments_have_a_position_and_nan_for_an_unmeasured_velocity() -> None:
    velocity: FloatArray = np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]])
    covariance = np.tile(np.diag([0.01, 0.04, 0.09]), (2, 1, 1))
    owner, moving = np.array([5, -1]), np.array([True, False])
    velocities = FragmentVelocities(np.zeros((14, 4)), velocity, covariance)
    told = report.fragments(two_fragments(), owner, moving, velocities)
    np.testing.assert_array_equal(told.ids, [3, 8])
    np.testing.assert_allclose(told.depth_m, [4.0, np.nan])
    expected = [(110.0 - CAMERA.cx) / 300.0 * 4.0, (70.0 - CAMERA.cy) / 300.0 * 4.0, 4.0]
    np.testing.assert_allclose(told.position_m[0], expected)
    np.testing.assert_allclose(told.velocity_mps[0], velocity[0])
    np.testing.assert_allclose(told.velocity_sigma_mps[0], [0.1, 0.2, 0.3])
    assert np.isnan(told.velocity_mps[1]).all()  # neither end can be used
    assert np.isnan(told.velocity_sigma_mps[1]).all()
    np.testing.assert_array_equal(told.obstacle_id, owner)
    np.testing.assert_array_equal(told.moving, moving)


def test_a_mover_out_of_sight_has_its_whole_box_where_it_goes() -> None:
    """0.6 m wide and 1.8 m high around its middle; the box it was last seen by is the rest of an arm."""
    made = tracks((0.5, 0.0, 3.0), unseen_s=0.1)
    made.moving[:] = True
    made.covariance[:, 3:, 3:] = 0.01 * np.eye(3)
    made.bbox_px[:] = [10.0, 20.0, 14.0, 30.0]
    made.box_m[:] = [-0.3, -0.9, 0.3, 0.9]
    (one,) = report.obstacles(made, now())
    # Focal length 300 px, middle (159.5, 119.5), image 320 x 240.
    assert one.bbox_px == pytest.approx((159.5 + 20.0, 119.5 - 90.0, 159.5 + 80.0, 119.5 + 90.0))
    made.state[0, 0] = -1.5
    (one,) = report.obstacles(made, now())
    assert one.bbox_px == pytest.approx((0.0, 29.5, 159.5 - 120.0, 209.5))  # cut at the border


def test_a_mover_out_of_sight_is_listed_while_it_is_known_where_it_goes() -> None:
    made = tracks((0.5, 0.0, 3.0), unseen_s=0.1)
    made.moving[:] = True
    for sigma_mps, listed in ((0.34, 1), (0.36, 0)):  # times sqrt(3) times 0.1 s: up to 0.06 m
        made.covariance[:, 3:, 3:] = sigma_mps**2 * np.eye(3)
        assert len(report.obstacles(made, now())) == listed
    made.moving[:] = False  # what stands is where it was
    assert len(report.obstacles(made, now())) == 1


def test_the_box_of_a_nearly_hidden_mover_covers_its_whole_body_and_the_visible_sliver() -> None:
    made = tracks((0.5, 0.0, 3.0))
    made.moving[:], made.nearly_hidden[:] = True, True
    made.bbox_px[:] = [170.0, 40.0, 190.0, 60.0]
    made.box_m[:] = [-0.3, -0.9, 0.3, 0.9]
    made.cells[:] = 12
    (one,) = report.obstacles(made, now())
    assert one.bbox_px == pytest.approx((170.0, 29.5, 239.5, 209.5))


@pytest.mark.parametrize("unseen_s", [0.0, 0.1])
def test_a_mover_of_which_hardly_anything_is_visible_is_not_listed(unseen_s: float) -> None:
    made = tracks((0.5, 0.0, 3.0), unseen_s=unseen_s)
    made.moving[:], made.nearly_hidden[:] = True, True
    made.covariance[:] = 0.01 * np.eye(6)
    for cells, listed in ((11, 0), (12, 1)):
        made.cells[:] = cells
        assert len(report.obstacles(made, now())) == listed


def test_visible_and_static_tracks_keep_the_box_seen_last() -> None:
    for moving, unseen_s in ((True, 0.0), (False, 0.1)):
        made = tracks((0.5, 0.0, 3.0), unseen_s=unseen_s)
        made.moving[:] = moving
        made.bbox_px[:] = [10.0, 20.0, 14.0, 30.0]
        (one,) = report.obstacles(made, now())
        assert one.bbox_px == (10.0, 20.0, 14.0, 30.0)


@pytest.mark.parametrize(
    ("overhead", "moving", "cells", "listed"),
    [(True, False, 99, False), (True, True, 24, True), (True, True, 23, False), (False, False, 6, True)],
)
def test_track_seen_only_above_the_robot_is_listed_if_much_of_it_moves(
    overhead: bool, moving: bool, cells: int, listed: bool
) -> None:
    made = tracks(BEFORE_ME)
    made.overhead[0], made.moving[0], made.cells[0] = overhead, moving, cells
    assert len(report.obstacles(made, now())) == listed


def large_and_new(
    box_px: tuple[float, float, float, float] = (130.0, 150.0, 150.0, 170.0),
    depth_m: float = 4.5,
    moving_s: float = 0.29,
) -> Tracks:
    """Something that has moved for long, and something small that has begun to, half covered: 0.09 m2."""
    made = tracks(BEFORE_ME, (0.2, -0.1, depth_m))
    made.moving[:], made.moving_s[:] = True, (2.0, moving_s)
    made.bbox_px[:] = (100.0, 50.0, 140.0, 180.0), box_px
    return made


def told_moving(made: Tracks) -> list[bool]:
    return [one.moving for one in report.obstacles(made, now())]


def test_a_new_mover_at_a_larger_one_is_listed_as_static_at_first() -> None:
    made = large_and_new()
    made.state[1, 3:] = [0.5, 0.0, 0.0]
    large, new = report.obstacles(made, now())
    assert (large.moving, new.moving, new.score) == (True, False, 0.5)
    np.testing.assert_allclose(new.velocity_mps, [0.5, 0.0, 0.0])  # what is known of it is told all the same


@pytest.mark.parametrize(
    "apart",
    [
        {"moving_s": 0.31},
        {"box_px": (135.0, 150.0, 155.0, 170.0)},  # a quarter of it
        {"depth_m": 5.6},
        {"depth_m": 2.4},
        {"box_px": (110.0, 80.0, 140.0, 170.0)},  # 2700 of 5200 px
    ],
    ids=["for longer", "beside", "behind", "before", "more than half as large"],
)
def test_a_new_mover_that_is_no_piece_of_a_larger_one_is_told_at_once(apart: dict[str, Any]) -> None:
    assert told_moving(large_and_new(**apart)) == [True, True]


def beside_what_stands(**new: Any) -> Tracks:
    """As large_and_new, but that the large one stands, and where the new one ends in it is a guess."""
    made = large_and_new(**new)
    made.moving[0], made.border_is_guess[1] = False, True
    return made


@pytest.mark.parametrize("box_px", [(130.0, 150.0, 150.0, 170.0), (139.0, 150.0, 159.0, 170.0)])
def test_a_small_mover_with_a_guessed_border_may_be_a_piece_of_a_person(box_px: Any) -> None:
    assert told_moving(beside_what_stands(box_px=box_px)) == [False, False]


@pytest.mark.parametrize(
    "apart",
    [
        {"moving_s": 0.31},
        {"box_px": (141.0, 150.0, 161.0, 170.0)},
        {"depth_m": 5.6},
        {"box_px": (110.0, 100.0, 140.0, 176.0)},  # 2280 px at 4.5 m with 300 px: 0.51 m2
    ],
    ids=["for longer", "beside", "behind", "half of a body"],
)
def test_a_mover_that_is_no_piece_beside_a_static_track_is_listed_as_moving_at_once(
    apart: dict[str, Any],
) -> None:
    assert told_moving(beside_what_stands(**apart)) == [False, True]


def test_a_mover_that_ends_at_depth_edges_is_listed_as_moving_at_once() -> None:
    made = beside_what_stands()
    made.border_is_guess[1] = False
    assert told_moving(made) == [False, True]


def test_a_new_mover_at_something_that_is_not_listed_is_told_at_once() -> None:
    made = large_and_new()
    made.sightings[0] = 2
    assert told_moving(made) == [True]


def test_larger_of_two_new_movers_is_listed_as_moving() -> None:
    made = large_and_new()
    made.moving_s[0] = 0.1
    assert told_moving(made) == [True, False]
