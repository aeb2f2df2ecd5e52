"""The speed of half hidden bodies by their free rims."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hal.types import FloatArray, Pose
from tests.support.detections import AT_ORIGIN, FRAME_NS
from tests.support.grids import grid_of, labelled, nearest, plate, wall
from vision.bodies import rim_motion
from vision.bodies.rim_motion import RimMemory, RimVelocities
from vision.bodies.tracks import Tracks

FRAME_S = FRAME_NS * 1e-9
BODY_M = 4.0
SPEED_MPS = 0.9


def tracks_of(count: int = 1) -> Tracks:
    tracks = Tracks()
    tracks.start(np.tile((0.0, 0.0, BODY_M), (count, 1)), 0.2, 1.5, 0.0, 0)
    return tracks


def body(x_m: float, top_m: float = -0.8) -> FloatArray:
    return plate(BODY_M, (x_m - 0.25, x_m + 0.25), (top_m, 0.8))


def measured(views: list[FloatArray], poses: list[Pose] | None = None) -> RimVelocities:
    """The velocity of the body, whose cells are those at BODY_M, after the views at 30 frames a second."""
    memory, tracks = RimMemory(2.4), tracks_of()
    for k, depth_m in enumerate(views):
        pose = AT_ORIGIN if poses is None else poses[k]
        labels = labelled(np.isclose(depth_m, np.median(depth_m[(depth_m > 3.0) & (depth_m < 5.0)])))
        found = memory.velocities(grid_of(depth_m), labels, tracks, pose, k * FRAME_NS)
    return found


def coming_out(frames: int = 8, speed_mps: float = SPEED_MPS) -> list[FloatArray]:
    """From behind something 2 m away, to the right, in front of a wall: the left side is the occluder's."""
    occluder = plate(2.0, (-1.5, 0.0), (-1.2, 1.2))
    return [nearest(body(speed_mps * k * FRAME_S), occluder, wall(7.0)) for k in range(frames)]


def test_who_comes_out_from_behind_something_goes_as_fast_as_his_free_rim() -> None:
    """His middle goes half as fast. A cell is 5.3 cm wide at 4 m, 0.27 m/s over 0.2 s."""
    found = measured(coming_out())
    assert found.mps[0] == pytest.approx(SPEED_MPS, abs=0.2)
    assert abs(found.mps[0] - SPEED_MPS) < 2.0 * found.sigma_mps[0] < 0.3
    assert found.lag_s[0] == pytest.approx(0.2, abs=0.02)
    np.testing.assert_allclose(found.direction[0], [0.994, 0.0, -0.11], atol=0.01)  # to 0.45 m aside


def test_what_stands_and_is_uncovered_stands_by_its_free_rim() -> None:
    views = [
        nearest(body(0.0), plate(2.0, (-1.5, 0.05 - 0.03 * k), (-1.2, 1.2)), wall(7.0)) for k in range(8)
    ]
    assert measured(views).mps[0] == 0.0


def test_a_body_that_ends_nowhere_freely_tells_nothing() -> None:
    views = [nearest(body(0.05 * k), wall(4.1)) for k in range(8)]
    assert np.isinf(measured(views).sigma_mps[0])


def test_a_younger_track_is_measured_over_a_shorter_time_and_less_surely() -> None:
    long, short = measured(coming_out(8)), measured(coming_out(4))
    assert short.lag_s[0] == pytest.approx(0.1, abs=0.02)
    assert short.sigma_mps[0] == pytest.approx(2.0 * long.sigma_mps[0], rel=0.1)
    assert np.isinf(measured(coming_out(3)).sigma_mps[0])


def test_a_few_rows_are_too_few() -> None:
    """A row is 5.3 cm high at 4 m; of one side 7 and 9 of them."""
    occluder = plate(2.0, (-1.5, 0.0), (-1.2, 1.2))
    for height_m, known in ((0.37, False), (0.48, True)):
        views = [nearest(body(0.03 * k, 0.8 - height_m), occluder, wall(7.0)) for k in range(8)]
        assert np.isfinite(measured(views).sigma_mps[0]) == known


def test_an_arm_that_swings_does_not_carry_the_body_along() -> None:
    """A quarter of the rows go 1.5 m/s, the others stand."""
    views = [
        nearest(body(0.0), plate(BODY_M, (0.0, 0.3 + 0.05 * k), (-0.4, 0.0)), wall(7.0)) for k in range(8)
    ]
    found = measured(views)
    assert abs(found.mps[0]) < 0.05


@pytest.mark.parametrize("frames_ago", range(1, 7))
def test_a_rim_that_jumps_once_tells_no_velocity(frames_ago: int) -> None:
    """A post beside what stands joins it: 0.21 m to the right from one frame to the next, and stays there."""
    stood = 9 - frames_ago
    views = [nearest(body(0.0), wall(7.0))] * stood
    views += [nearest(body(0.0), plate(BODY_M, (0.2, 0.46), (-0.8, 0.8)), wall(7.0))] * frames_ago
    occluder = plate(2.0, (-1.5, 0.0), (-1.2, 1.2))
    found = measured([nearest(view, occluder) for view in views])
    assert np.isinf(found.sigma_mps[0])


def test_the_cameras_own_motion_is_taken_out() -> None:
    """The camera goes 0.1 m to the right and 0.3 m ahead; the body stands, its image goes the other way."""
    poses = [Pose(np.eye(3), np.array([0.1, 0.0, 0.3]) * k / 6.0) for k in range(7)]
    views = []
    for pose in poses:
        x_m, ahead_m = pose.translation_m[0], pose.translation_m[2]
        views.append(nearest(plate(4.0 - ahead_m, (0.2 - x_m, 0.7 - x_m), (-0.8, 0.8)), wall(7.0 - ahead_m)))
    found = measured(views, poses)
    assert abs(found.mps[0]) < 2.0 * found.sigma_mps[0] < 0.3


def test_the_direction_is_across_the_line_of_sight_in_the_fixed_frame() -> None:
    """The camera looks 30 degrees to the right; a body in its middle goes across, not along x."""
    c, s = math.cos(0.5), math.sin(0.5)
    turned = Pose(np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]), np.zeros(3))
    found = measured([nearest(body(0.03 * k), wall(7.0)) for k in range(7)], [turned] * 7)
    np.testing.assert_allclose(found.direction[0], [math.cos(0.5), 0.0, -math.sin(0.5)], atol=0.05)


def test_rims_from_before_are_not_compared_once_they_are_forgotten() -> None:
    memory, tracks = RimMemory(2.4), tracks_of()
    for k, depth_m in enumerate(coming_out()):
        if k == 7:
            memory.clear()
        found = memory.velocities(
            grid_of(depth_m), labelled(depth_m == BODY_M), tracks, AT_ORIGIN, k * FRAME_NS
        )
    assert np.isinf(found.sigma_mps[0])


def rims(mps: float, sigma_mps: float) -> RimVelocities:
    return RimVelocities(
        np.array([mps]), np.array([sigma_mps]), np.array([[0.6, 0.0, -0.8]]), np.array([0.2])
    )


def test_time_of_motion_one_way_ends_where_it_turns_or_is_not_clear() -> None:
    so_far_s = np.array([0.1])
    assert rim_motion.one_way_s(so_far_s, rims(0.5, 0.1), 4.0, 0.03)[0] == pytest.approx(0.13)
    assert rim_motion.one_way_s(so_far_s, rims(-0.5, 0.1), 4.0, 0.03)[0] == pytest.approx(-0.03)
    assert rim_motion.one_way_s(so_far_s, rims(0.4, 0.1), 4.0, 0.03)[0] == 0.0  # 4 sigmas of 0.104
    assert rim_motion.one_way_s(so_far_s, rims(0.1, 0.0), 4.0, 0.03)[0] == 0.0  # the camera's own error
    assert rim_motion.one_way_s(so_far_s, rims(0.0, math.inf), 4.0, 0.03)[0] == 0.0


def test_a_walkers_outline_swings_so_that_a_frame_of_it_weighs_less() -> None:
    """The variance of a frame is 0.05^2 * 0.2 / 0.05, and (0.15 * 1 m/s)^2 * 0.5 / 0.05 more if he walks."""
    across, spread = np.array([0.6, 0.0, -0.8]), []
    for moving in (False, True):
        tracks = tracks_of()
        tracks.state[:, 3:] = across
        tracks.moving[:] = moving
        rim_motion.fuse(tracks, rims(1.0, 0.05), 0.05)
        spread.append(across @ tracks.covariance[0, 3:, 3:] @ across)
    stands, walks = spread
    assert 1.0 / stands - 1.0 / 1.5**2 == pytest.approx(1.0 / 0.01, rel=0.01)
    assert 1.0 / walks - 1.0 / 1.5**2 == pytest.approx(1.0 / 0.235, rel=0.01)


def test_the_filters_take_the_velocity_in_the_direction_that_rims_measure_only() -> None:
    tracks = tracks_of(2)
    one = rims(0.8, 0.05)
    two = RimVelocities(
        one.mps.repeat(2), np.array([0.05, math.inf]), one.direction.repeat(2, axis=0), one.lag_s.repeat(2)
    )
    rim_motion.fuse(tracks, two, 0.05)
    across, along = np.array([0.6, 0.0, -0.8]), np.array([0.8, 0.0, 0.6])
    for state, spread in (
        (tracks.state, tracks.covariance),
        (tracks.surface_state, tracks.surface_covariance),
    ):
        assert state[0, 3:] @ across == pytest.approx(0.8, abs=0.01)
        assert state[0, 3:] @ along == pytest.approx(0.0, abs=1e-6)
        # A frame adds a quarter of a measurement: 0.05 s of 0.2.
        assert across @ spread[0, 3:, 3:] @ across == pytest.approx(4.0 * 0.05**2, rel=0.02)
        assert along @ spread[0, 3:, 3:] @ along == pytest.approx(1.5**2, rel=0.01)
        assert not state[1, 3:].any()
