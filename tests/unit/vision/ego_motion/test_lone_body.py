"""A body that alone tells the camera's turn has a say only as far as slip explains that turn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hal.types import CameraMount, Pose
from tests.support.anchored_points import (
    CAMERA,
    DT_S,
    GLOBAL_SHUTTER,
    IDENTITY,
    SETTINGS,
    anchors,
    odometry,
    seen,
)
from vision.camera.lens import rotation_from_vector, vector_from_rotation
from vision.ego_motion.camera_motion import _implausible, estimate
from vision.ego_motion.forward_speed import ForwardSpeed
from vision.ego_motion.lone_body import without_lone_body
from vision.ego_motion.motion_prior import MotionPrior, odometry_prior, rolling_prior, with_gyro
from vision.ego_motion.reprojection import Anchors, View, view_of
from vision.ego_motion.robust_fit import Fit
from vision.scene import Obstacle

ALONG = np.array([1e5, 0.0, 30.0])  # covariance of a point on a blurred horizontal line, px^2
CRATE_PX = (250.0, 120.0, 420.0, 360.0)
AHEAD = Pose(np.eye(3), np.array([0.0, 0.0, 0.04]))


def rolling(turn_sigma_radps: float | None) -> MotionPrior:
    """The robot goes ahead; turn_sigma_radps: of its gyro, None if it has none."""
    speed, mount = ForwardSpeed(0.04 / DT_S, 0.1), CameraMount(0.45, 0.0, 0.6, 0.0)
    prior = rolling_prior(0.0, speed, DT_S, mount, SETTINGS, turn_sigma_radps)
    return prior if turn_sigma_radps is None else with_gyro(prior, np.zeros(3), DT_S, SETTINGS)


def obstacle(box_px: tuple[float, float, float, float], width_m: float = 1.0) -> Obstacle:
    return Obstacle(
        1, box_px, np.ones(3), np.array([width_m, 1.5, 0.5]), np.zeros(3), np.eye(3), False, 0.5, 0, 1.0, 0.0
    )


CRATE = (obstacle(CRATE_PX),)


def plain_room(cornered: float = 0.0) -> tuple[Anchors, np.ndarray]:
    """Points all over the view, of which only those on the crate, and a share of the others, are corners.

    Also returns which are on the crate.
    """
    points = anchors(400)
    pixels = seen(points.points_m, IDENTITY)
    u0, v0, u1, v1 = CRATE_PX
    crate = (pixels[:, 0] > u0) & (pixels[:, 0] < u1) & (pixels[:, 1] > v0) & (pixels[:, 1] < v1)
    line = ~crate & (np.arange(400) >= cornered * 400)
    covariance = points.pixel_cov.copy()
    covariance[line] = ALONG
    return replace(points, pixel_cov=covariance), crate


def camera_pose(prior: MotionPrior, true: Pose, aside_m: float = 0.0, cornered: float = 0.0) -> Pose:
    """The estimate while the camera moves by true, and the crate by aside_m to the right."""
    points, crate = plain_room(cornered)
    moved = points.points_m + np.where(crate[:, None], [aside_m, 0.0, 0.0], 0.0)
    return estimate(points, seen(moved, true), IDENTITY, prior, GLOBAL_SHUTTER, CAMERA, CRATE).pose


def yaw_rad(prior: MotionPrior, true: Pose, aside_m: float = 0.0, cornered: float = 0.0) -> float:
    """Estimated turn about y; see camera_pose."""
    return float(vector_from_rotation(camera_pose(prior, true, aside_m, cornered).rotation)[1])


def turning(rad: float) -> Pose:
    return Pose(rotation_from_vector(np.array([0.0, rad, 0.0])), AHEAD.translation_m)


def test_a_lone_crate_that_moves_does_not_turn_the_camera() -> None:
    # 0.45 m/s to the right looks like a turn of 0.1 rad/s to the left where the crate is.
    assert yaw_rad(odometry(AHEAD), AHEAD, aside_m=0.015) == pytest.approx(0.0, abs=1e-5)


def test_a_moving_crate_among_many_corners_is_outvoted() -> None:
    assert yaw_rad(odometry(AHEAD), AHEAD, aside_m=0.015, cornered=0.5) == pytest.approx(0.0, abs=3e-4)


@pytest.mark.parametrize("slip", [0.9, 1.1])
def test_a_lone_crate_corrects_the_odometry_for_slip(slip: float) -> None:
    found = yaw_rad(odometry(turning(0.015 * slip)), turning(0.015))
    assert found == pytest.approx(0.015, abs=1e-4)


def test_a_turn_beyond_slip_is_not_believed_from_a_lone_crate_but_from_corners_all_over() -> None:
    prior, true = odometry(turning(0.010)), turning(0.0135)
    assert yaw_rad(prior, true) == pytest.approx(0.010, abs=1e-3)
    assert yaw_rad(prior, true, cornered=0.9) == pytest.approx(0.0135, abs=1e-4)


def test_without_odometry_the_images_tell_any_turn() -> None:
    prior = replace(odometry(AHEAD), slip_rad=np.inf, trusted=False, source="none")
    assert yaw_rad(prior, turning(0.002)) == pytest.approx(0.002, abs=1e-4)


def test_slip_explains_a_fifth_of_the_turn_and_some_noise() -> None:
    assert odometry_prior(turning(0.02), DT_S, SETTINGS).slip_rad == pytest.approx(0.2 * 0.02 + 0.02 * DT_S)


def test_a_gyro_does_not_slip_but_drifts() -> None:
    turn = np.array([0.0, 0.01, 0.0])
    prior = odometry_prior(turning(0.02), DT_S, SETTINGS)
    assert with_gyro(prior, turn, DT_S, SETTINGS).slip_rad == pytest.approx(0.02 * DT_S)
    assert rolling(0.02).knows_turn
    assert not rolling(None).knows_turn


def test_with_a_gyro_a_lone_crate_does_not_drive_the_camera_aside_where_there_is_no_odometry() -> None:
    """0.45 m/s: without a gyro, the robot may turn, which swings its camera aside."""
    swung = camera_pose(rolling(None), AHEAD, aside_m=0.015)
    assert swung.translation_m[0] < -0.01
    steady = camera_pose(rolling(0.02), AHEAD, aside_m=0.015)
    np.testing.assert_allclose(steady.translation_m, AHEAD.translation_m, atol=1e-4)


def view(points: Anchors) -> View:
    return view_of(points, seen(points.points_m, AHEAD), points.usable.nonzero()[0], CAMERA)


def test_the_points_in_the_box_of_a_lone_body_and_close_around_it_are_left_out() -> None:
    points, crate = plain_room()
    kept = without_lone_body(view(points), AHEAD, CRATE, CAMERA)
    left_out = len(crate) - len(kept.seen)
    assert crate.sum() <= left_out < 1.4 * crate.sum()
    whole = view(points)
    other = obstacle((0.0, 0.0, 100.0, 100.0))
    assert without_lone_body(whole, AHEAD, (other,), CAMERA) is whole
    assert without_lone_body(whole, AHEAD, (), CAMERA) is whole


def test_a_point_of_unknown_depth_tells_no_turn_along_its_epipolar_line() -> None:
    """Far corners at the height of the horizon, beside the crate: their shift may be due to their depth."""
    points, crate = plain_room()
    level = ~crate & (abs(seen(points.points_m, IDENTITY)[:, 1] - CAMERA.cy) < 20.0)
    covariance = points.pixel_cov.copy()
    covariance[level] = [0.02, 0.0, 0.02]
    beside = replace(points, pixel_cov=covariance)
    forward = Pose(np.eye(3), np.array([0.0, 0.0, 0.5]))
    assert len(without_lone_body(view(beside), forward, CRATE, CAMERA).seen) == 400
    unknown = replace(beside, depth_sigma_m=np.where(level, 10.0, beside.depth_sigma_m))
    assert len(without_lone_body(view(unknown), forward, CRATE, CAMERA).seen) < 400


def test_a_point_in_the_plane_of_the_lens_does_not_hide_a_lone_body() -> None:
    points, crate = plain_room()
    odd = points.points_m.copy()
    odd[(~crate).nonzero()[0][0]] = [1.0, 0.0, 0.0]
    seen_before, whole = view(points).seen, view(replace(points, points_m=odd))
    kept = without_lone_body(View(whole.lines, seen_before, whole.whitening), IDENTITY, CRATE, CAMERA)
    assert len(kept.seen) < 400


def test_walls_and_racks_are_no_bodies() -> None:
    whole = view(plain_room()[0])
    assert without_lone_body(whole, AHEAD, (obstacle(CRATE_PX, width_m=3.1),), CAMERA) is whole
    assert without_lone_body(whole, AHEAD, (obstacle(CRATE_PX, width_m=2.9),), CAMERA) is not whole


@pytest.mark.parametrize(("sigmas", "implausible"), [(2.9, False), (3.1, True), (-3.1, True)])
def test_a_turn_is_beyond_slip_only_by_three_sigmas(sigmas: float, implausible: bool) -> None:
    """What counts is the uncertainty about y; those about x and z are ten times as small and as large."""
    sigma_rad, prior = 2e-3, odometry(AHEAD)
    information = np.diag([100.0, 1.0, 0.01, 1.0, 1.0, 1.0, 1.0, 1.0]) / sigma_rad**2
    turn_rad = np.copysign(prior.slip_rad + abs(sigmas) * sigma_rad, sigmas)
    back = np.array([0.0, turn_rad, 0.0, 0.0, 0.0, 0.0])
    found = Fit(AHEAD, np.zeros(2), back, information, 100, information, np.zeros(8), np.zeros(2))
    loose = replace(prior, sigma=np.full(6, 1.0))
    assert _implausible(found, loose) == implausible
