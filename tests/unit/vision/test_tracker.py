"""Tracking on exact depth grids, without any fragment: bodies as surfaces alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from config.perception import PerceptionConfig
from hal.types import FloatArray, Pose
from tests.support.detections import AT_ORIGIN, detection, track
from tests.support.grids import CAMERA, grid_of, nearest, no_depth, plate, wall
from tests.support.walker import FRAME_S, SPEED_MPS, moving, walker, way_m
from vision.detection import unknown_residuals
from vision.percept import Percept
from vision.tracker import Tracker


def test_a_surface_alone_is_found_moving_with_its_velocity() -> None:
    percepts = track([walker(-0.9 + way_m(k)) for k in range(30)])
    (mover,) = moving(percepts[-1])
    np.testing.assert_allclose(mover.velocity_mps, [SPEED_MPS, 0.0, 0.0], atol=0.12)
    np.testing.assert_allclose(mover.position_m, [-0.9 + way_m(29), 0.2, 4.0], atol=0.06)
    assert mover.fragments == 0


def test_a_walker_whose_head_is_above_the_image_still_tells_how_fast_he_goes() -> None:
    """At 2 m the image ends 0.8 m above the camera's axis; nothing else shows that he moves sideways."""
    percepts = track([plate(2.0, (-0.65 + way_m(k), -0.15 + way_m(k)), (-1.2, 0.7)) for k in range(30)])
    (walker,) = percepts[-1].scene.obstacles
    assert walker.bbox_px[1] <= 0.0
    np.testing.assert_allclose(walker.velocity_mps, [SPEED_MPS, 0.0, 0.0], atol=0.12)


def owner_of_a_fragment(speed_mps: float, age_frames: int, static_chi2: float, dt_s: float = FRAME_S) -> int:
    """Which obstacle gets a fragment that comes to lie on the only one there is, after it went so fast.

    dt_s: between the frames that the fragment has been seen in.
    """
    tracker = Tracker(PerceptionConfig(), body_height_m=1.5, clearance_m=0.05)
    for k in range(25):
        x_m = -0.9 + speed_mps * k * FRAME_S
        seen = detection(grid_of(walker(x_m)), k)
        if k == 24:
            u = CAMERA.cx + CAMERA.fx * x_m / 4.0
            motion = replace(
                unknown_residuals(2), static_chi2=np.full(2, static_chi2), usable=np.ones(2, np.bool_)
            )
            seen = replace(
                seen,
                ids=np.array([7]),
                ends_px=np.array([[[u, CAMERA.cy], [u, CAMERA.cy + 20.0]]], np.float32),
                near_m=np.full((1, 2), 4.0, np.float32),
                age_frames=np.array([age_frames], np.intp),
                dt_s=dt_s,
                motion=motion,
            )
        percept = tracker.step(seen, None)
    assert len(moving(percept)) == (speed_mps > 0.0)
    return int(percept.fragments.obstacle_id[0])


def test_a_line_that_has_long_lain_still_is_no_part_of_a_mover_that_comes_by() -> None:
    assert owner_of_a_fragment(SPEED_MPS, 8, 1.0) == -1
    assert owner_of_a_fragment(SPEED_MPS, 7, 1.0) > 0  # too young to tell
    assert owner_of_a_fragment(SPEED_MPS, 8, 6.5) > 0  # has not lain still
    assert owner_of_a_fragment(0.0, 8, 1.0) > 0  # what stands has such lines


def test_how_long_a_line_has_lain_still_is_a_matter_of_time_not_of_frames() -> None:
    assert owner_of_a_fragment(SPEED_MPS, 2, 1.0, 0.2) == -1
    assert owner_of_a_fragment(SPEED_MPS, 1, 1.0, 0.2) > 0
    assert owner_of_a_fragment(SPEED_MPS, 16, 1.0, 1.0 / 60.0) == -1
    assert owner_of_a_fragment(SPEED_MPS, 15, 1.0, 1.0 / 60.0) > 0


def test_a_surface_that_stands_is_listed_from_the_third_sight_on_and_never_moves() -> None:
    percepts = track([walker(0.3) for _ in range(20)])
    assert [len(one.scene.obstacles) for one in percepts[:4]] == [0, 0, 1, 1]
    assert not any(moving(one) for one in percepts)
    (still,) = percepts[-1].scene.obstacles
    assert still.score == 0.5
    np.testing.assert_allclose(still.velocity_mps, 0.0, atol=0.02)


def test_a_velocity_that_nothing_has_is_not_kept() -> None:
    """As a surface that jumped leaves it behind; 1.6 times 1.5 m/s are possible."""
    tracker = Tracker(PerceptionConfig(), body_height_m=1.5, clearance_m=0.05)
    for k in range(6):
        tracker._tracks.state[:, 3] = tracker._tracks.surface_state[:, 3] = 8.0
        percept = tracker.step(detection(grid_of(walker(0.3)), k), None)
    (still,) = percept.scene.obstacles
    assert np.linalg.norm(still.velocity_mps) <= 1.6 * 1.5  # 6.2 m/s if it is kept


def test_a_person_who_leaves_a_table_is_the_mover_and_not_the_table() -> None:
    """They touched, one connected part; 0.37 s after his first step he is 0.29 m away from it."""
    stood, steps = 12, 11
    depths_m = [
        nearest(walker(-0.25 - max(way_m(k - stood), 0.0)), plate(4.0, (0.0, 1.0), (-0.6, 1.0)), wall(6.0))
        for k in range(stood + steps + 1)
    ]
    percepts = track(depths_m)
    assert not any(moving(one) for one in percepts[:stood])
    (mover,) = moving(percepts[-1])
    assert 0.4 < mover.extent_m[0] < 0.6
    np.testing.assert_allclose(mover.velocity_mps[0], -SPEED_MPS, atol=0.2)
    # His middle was first taken for that of the rim which showed that he goes, 0.18 m to the left of it.
    np.testing.assert_allclose(mover.position_m[0], -0.25 - way_m(steps), atol=0.15)


def test_body_is_tracked_that_enters_an_empty_view() -> None:
    """Beyond 10 m only; then he stands there from one frame to the next."""
    hall = wall(12.0)
    percepts = track([hall] * 20 + [nearest(walker(0.0), hall)] * 5)
    assert not percepts[19].scene.obstacles
    (comer,) = percepts[-1].scene.obstacles
    np.testing.assert_allclose(comer.position_m, [0.0, 0.2, 4.0], atol=0.06)


@pytest.mark.parametrize(("off_m", "comes_back"), [(-0.5, False), (0.6, True)])
def test_views_from_before_and_during_lost_ego_motion_prove_nothing(off_m: float, comes_back: bool) -> None:
    """For three frames its motion is not known; where it believes to be is off, and stays so or not."""
    tracker = Tracker(PerceptionConfig(), body_height_m=1.5, clearance_m=0.05)
    grid, off = grid_of(nearest(walker(0.3), wall(6.0))), Pose(np.eye(3), np.array([0.0, 0.0, off_m]))
    for k in range(30):
        lost = 12 <= k < 15
        pose = AT_ORIGIN if k < 12 or (comes_back and not lost) else off
        assert not moving(tracker.step(detection(grid, k, pose, motion_known=not lost), None))


def behind(x_m: float, pillar_m: tuple[float, float] = (0.5, 1.0)) -> FloatArray:
    """A walker at 4 m, a wall at 6 m, and a pillar at 2.5 m from pillar_m[0] to pillar_m[1] before them."""
    return nearest(walker(x_m), wall(6.0), plate(2.5, pillar_m, (-0.9, 0.9)))


def test_the_visible_rest_of_a_hidden_mover_does_not_drag_its_position() -> None:
    """A curtain is drawn: of the walker the left quarter is to be seen, with its middle 0.19 m off."""
    start_m, drawn = -0.9, 30
    depths_m = [behind(start_m + way_m(k), (0.9, 1.0)) for k in range(drawn)]
    for k in range(drawn, drawn + 5):
        edge_m = start_m + way_m(k) - 0.25 + 0.125
        depths_m.append(behind(start_m + way_m(k), (edge_m * 2.5 / 4.0, 1.0)))
    percepts = track(depths_m)
    before = moving(percepts[drawn - 1])[0]
    for k in range(drawn, drawn + 5):
        (mover,) = (one for one in percepts[k].scene.obstacles if one.id == before.id)
        assert mover.moving
        assert mover.unseen_s == 0.0
        assert mover.position_m[0] == pytest.approx(start_m + way_m(k), abs=0.08)
        assert mover.velocity_mps[0] == pytest.approx(SPEED_MPS, abs=0.1)


@pytest.mark.parametrize("every", [1, 3, 6])
def test_a_mover_that_came_out_from_behind_something_is_measured_at_any_frame_rate(every: int) -> None:
    """At 30, 10 and 5 frames a second. A quarter of him is seen first, and for 1.2 s all of him."""
    tracker = Tracker(PerceptionConfig(), body_height_m=1.5, clearance_m=0.05)
    for k in range(0, 43, every):
        x_m = -0.5 + way_m(k)
        curtain = plate(2.5, (-1.0, (x_m + 0.125) * 2.5 / 4.0), (-0.9, 0.9)) if k < 6 else no_depth()
        seen = detection(grid_of(nearest(walker(x_m), curtain)), k)
        percept = tracker.step(replace(seen, dt_s=every * seen.dt_s), None)
    (mover,) = moving(percept)
    np.testing.assert_allclose(mover.velocity_mps, [SPEED_MPS, 0.0, 0.0], atol=0.2)


def test_a_suddenly_hidden_mover_keeps_its_whole_box_and_goes_on() -> None:
    """A curtain is drawn: first a quarter is left to see of the walker, then nothing."""
    start_m, drawn = -0.9, 30
    depths_m = [behind(start_m + way_m(k), (0.9, 1.0)) for k in range(drawn)]
    for k in range(drawn, drawn + 3):
        edge_m = start_m + way_m(k) - 0.25 + 0.125
        depths_m.append(behind(start_m + way_m(k), (edge_m * 2.5 / 4.0, 1.0)))
    depths_m += [behind(start_m + way_m(k), (-1.0, 1.0)) for k in range(drawn + 3, drawn + 6)]
    percepts = track(depths_m)
    before = moving(percepts[drawn - 1])[0]
    for k in range(drawn + 3, drawn + 6):
        (mover,) = (one for one in percepts[k].scene.obstacles if one.id == before.id)
        assert mover.unseen_s > 0.0
        x_m = start_m + way_m(k)
        edges = [159.5 + (x_m - 0.25) * 75.0, 119.5 - 0.6 * 75.0, 159.5 + (x_m + 0.25) * 75.0, 194.5]
        np.testing.assert_allclose(mover.bbox_px, edges, atol=8.0)


def holed(frame: int) -> FloatArray:
    """One person in two parts: a row of depth is missing above the shoes."""
    x_m = -0.9 + way_m(frame)
    body = plate(3.0, (x_m - 0.25, x_m + 0.25), (-0.9, 0.6))
    shoes = plate(3.0, (x_m - 0.25, x_m + 0.25), (0.72, 0.95))
    return nearest(body, shoes)


def test_shoes_parted_from_their_body_by_a_hole_become_part_of_it() -> None:
    percepts = track([holed(k) for k in range(40)])
    assert len(percepts[2].scene.obstacles) == 2  # at first nothing is known of them
    for percept in percepts[20:]:
        (person,) = percept.scene.obstacles
        assert person.moving
        assert person.bbox_px[3] - person.bbox_px[1] > 0.95 * (1.85 / 3.0 * 300.0)


def test_a_vanished_mover_is_listed_for_a_moment_only() -> None:
    depths_m = [walker(-0.9 + way_m(k)) for k in range(24)] + [no_depth()] * 8
    percepts = track(depths_m)
    listed = [len(one.scene.obstacles) for one in percepts[24:]]
    # 0.15 s are four frames of 33 ms.
    assert listed == [1, 1, 1, 1, 0, 0, 0, 0]
    kept = percepts[24 + 3].scene.obstacles[0]
    assert kept.unseen_s == pytest.approx(4 * FRAME_S)
    # It goes on as it went.
    assert kept.position_m[0] == pytest.approx(-0.9 + way_m(27), abs=0.1)


def test_a_mover_that_has_left_the_view_is_not_listed() -> None:
    # The right edge of the view is 160 / 300 * 4 = 2.1 m away.
    depths_m = [walker(0.4 + way_m(k)) for k in range(75)]
    for k, percept in enumerate(track(depths_m)):
        if 0.4 + way_m(k) > 2.35 + 0.1:
            assert percept.scene.obstacles == ()


def test_a_break_in_sight_begins_the_surfaces_proof_anew() -> None:
    eyes = Tracker(PerceptionConfig(), body_height_m=1.5, clearance_m=0.05)
    velocity_measured_s = []
    for k, depth_m in enumerate([walker(-0.9 + way_m(k)) for k in range(15)] + [no_depth()] * 3):
        eyes.step(detection(grid_of(depth_m, None, 1.0), k), None)
        velocity_measured_s.append(float(eyes._tracks.velocity_measured_s.max()))
    assert velocity_measured_s[14] > 0.2
    assert velocity_measured_s[15:] == [0.0, 0.0, 0.0]


def owner_of(left_px: float, near_m: float, before: FloatArray) -> tuple[int, Percept]:
    """Obstacle of an upright fragment at left_px and near_m, in the third sight of before."""
    tracker = Tracker(PerceptionConfig(), 0.8, 0.05)
    ends = np.array([[[left_px, 60.0], [left_px, 110.0]]], np.float32)
    for frame in range(3):
        seen = replace(
            detection(grid_of(before), frame),
            ids=np.array([7]),
            ends_px=ends,
            near_m=np.full((1, 2), near_m, np.float32),
            age_frames=np.array([frame]),
            motion=unknown_residuals(2),
        )
        percept = tracker.step(seen, None)
    return int(percept.fragments.obstacle_id[0]), percept


# Two bodies, one 0.3 m behind the other: they meet in the image at column 159.5.
FRONT_M, BACK_M = 2.6, 2.9
PASSING = nearest(plate(FRONT_M, (-0.5, 0.0), (-0.9, 0.9)), plate(BACK_M, (-0.2, 0.5), (-0.9, 0.9)))


@pytest.mark.parametrize(("near_m", "left_px"), [(FRONT_M, 166.0), (FRONT_M, 140.0), (BACK_M, 175.0)])
def test_an_outline_belongs_to_the_body_at_whose_depth_it_is(near_m: float, left_px: float) -> None:
    """Also where it lies on a cell of the body behind, and that is near enough to be its own."""
    owner, percept = owner_of(left_px, near_m, PASSING)
    (body,) = (one for one in percept.scene.obstacles if one.id == owner)
    assert body.position_m[2] == pytest.approx(near_m, abs=0.01)


def test_a_line_beside_a_body_is_none_of_its_outline() -> None:
    """Within reach beside it, but not on it."""
    alone = plate(FRONT_M, (-0.5, 0.0), (-0.9, 0.9))
    assert owner_of(164.0, FRONT_M, alone)[0] == -1
    assert owner_of(150.0, FRONT_M, alone)[0] >= 0
