"""The camera's motion from exact anchors whose true motion is known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from hal.types import Pose
from tests.support.anchored_points import (
    CAMERA,
    DT_S,
    GLOBAL_SHUTTER,
    IDENTITY,
    SETTINGS,
    TRUE,
    anchors,
    odometry,
    seen,
)
from vision.camera.lens import rotation_from_vector, vector_from_rotation
from vision.ego_motion import camera_motion
from vision.ego_motion.camera_motion import CameraEstimate, estimate
from vision.ego_motion.motion_prior import MotionPrior, steady_prior
from vision.ego_motion.reprojection import Anchors
from vision.ego_motion.robust_fit import fit


def off(found: CameraEstimate, motion: Pose = TRUE) -> tuple[float, float]:
    """Errors in metres and radians."""
    rest = motion.inverse() @ found.pose
    turn = vector_from_rotation(rest.rotation)
    return float(np.linalg.norm(rest.translation_m)), float(np.linalg.norm(turn))


def nothing_known() -> MotionPrior:
    return steady_prior(IDENTITY, 0.0, DT_S, SETTINGS)


def share(count: int, ratio: float) -> NDArray[np.bool_]:
    chosen = np.zeros(count, np.bool_)
    chosen[: round(ratio * count)] = True
    return chosen


@pytest.mark.parametrize("prior", [odometry(), nothing_known()])
def test_exact_points_give_the_exact_motion(prior: MotionPrior) -> None:
    static = anchors()
    found = estimate(static, seen(static.points_m), IDENTITY, prior, GLOBAL_SHUTTER, CAMERA)
    metres, radians = off(found)
    assert metres < 1e-3
    assert radians < 2e-4
    assert found.visual
    assert found.inlier_ratio > 0.98


def test_the_motion_starts_from_where_the_camera_was() -> None:
    before = Pose(rotation_from_vector(np.array([0.0, 0.4, 0.0])), np.array([2.0, 0.1, 5.0]))
    local = anchors()
    placed = Anchors(
        before.apply(local.points_m),
        local.range_m @ before.rotation.T,
        local.depth_sigma_m,
        local.pixel_cov,
        local.usable,
        local.left_out,
    )
    found = estimate(placed, seen(local.points_m), before, nothing_known(), GLOBAL_SHUTTER, CAMERA)
    metres, radians = off(found, before @ TRUE)
    assert metres < 1e-3
    assert radians < 2e-4


@pytest.mark.parametrize("prior", [odometry(), nothing_known()])
def test_40_percent_that_move_do_not_carry_the_camera_away(prior: MotionPrior) -> None:
    static = anchors()
    moving = share(160, 0.4)
    now = static.points_m + np.where(moving[:, None], [0.035, 0.0, -0.02], 0.0)  # 1.2 m/s
    found = estimate(static, seen(now, noise_px=0.1), IDENTITY, prior, GLOBAL_SHUTTER, CAMERA)
    metres, radians = off(found)
    assert metres < 3e-3
    assert radians < 1e-3
    assert found.visual
    assert 0.5 < found.inlier_ratio < 0.75


@pytest.mark.parametrize("ratio", [0.6, 0.75, 0.85])
@pytest.mark.parametrize("way_m", [(0.05, 0.0, 0.0), (0.027, 0.0, 0.0), (0.0, 0.0, -0.03)])
def test_the_odometry_decides_when_a_near_body_fills_most_of_the_view(
    way_m: tuple[float, float, float], ratio: float
) -> None:
    static = anchors()
    moving = share(160, ratio)
    depth_m = np.where(moving, np.linspace(2.0, 2.4, 160), np.linspace(3.5, 8.0, 160))
    points = static.range_m * depth_m[:, None]
    now = points + np.where(moving[:, None], way_m, 0.0)
    crowded = replace(static, points_m=points)
    found = estimate(crowded, seen(now, noise_px=0.1), IDENTITY, odometry(), GLOBAL_SHUTTER, CAMERA)
    metres, radians = off(found)
    assert metres < 2e-3  # the majority went 27 to 50 mm
    # Where only the odometry speaks, what it cannot know is missing: 2.2 mrad of pitch and roll.
    assert radians < (1e-3 if found.visual else 2.3e-3)
    assert found.inlier_ratio < 1.05 - ratio


@pytest.mark.parametrize("way_m", [(0.05, 0.0, 0.0), (0.0, 0.0, -0.03)])
def test_a_prior_that_nearly_all_points_contradict_is_disputed(way_m: tuple[float, float, float]) -> None:
    """Also where the odometry is so wrong that nearly no point is where it expects it."""
    static = anchors()
    now = static.points_m + np.where(share(160, 0.95)[:, None], way_m, 0.0)
    found = estimate(static, seen(now, noise_px=0.1), IDENTITY, odometry(), GLOBAL_SHUTTER, CAMERA)
    metres, radians = off(found, Pose(np.eye(3), -np.array(way_m)) @ TRUE)
    assert found.disputed
    assert not found.visual
    assert metres < 5e-3
    assert radians < 2e-3
    assert found.inlier_ratio > 0.9


def test_points_of_seeming_movers_have_no_vote_but_deny_a_dispute() -> None:
    """A vehicle that filled the view was taken for static; now the racks beside it seem to move."""
    points = anchors(200)
    vehicle = share(200, 0.5)
    moved = points.points_m + np.where(vehicle[:, None], [0.0, 0.0, 0.03], 0.0)
    racks_left_out = replace(points, usable=vehicle, left_out=~vehicle)
    for static, disputed in ((racks_left_out, False), (replace(points, usable=vehicle), True)):
        found = estimate(static, seen(moved, IDENTITY), IDENTITY, odometry(IDENTITY), GLOBAL_SHUTTER, CAMERA)
        assert found.disputed == disputed


def test_points_marked_as_not_usable_have_no_say() -> None:
    static = anchors()
    moving = share(160, 0.8)
    now = static.points_m + np.where(moving[:, None], [0.05, 0.0, 0.0], 0.0)
    known = replace(static, usable=~moving)
    found = estimate(known, seen(now), IDENTITY, nothing_known(), GLOBAL_SHUTTER, CAMERA)
    metres, _ = off(found)
    assert metres < 2e-3
    assert found.inlier_ratio > 0.95


def test_with_too_few_points_only_the_prior_speaks() -> None:
    static = anchors(7)
    prior = odometry()
    found = estimate(static, seen(static.points_m), IDENTITY, prior, GLOBAL_SHUTTER, CAMERA)
    assert not found.visual
    assert np.isnan(found.inlier_ratio)
    np.testing.assert_allclose(found.pose.translation_m, prior.motion.translation_m)
    np.testing.assert_allclose(found.pose.rotation, prior.motion.rotation)
    np.testing.assert_allclose(np.diag(found.covariance)[:6], np.square(prior.sigma))


def test_a_motion_whose_uncertainty_cannot_be_told_is_not_known(monkeypatch: pytest.MonkeyPatch) -> None:
    def singular(*given: Any) -> Any:
        return replace(fit(*given), information=np.zeros((8, 8)))

    monkeypatch.setattr(camera_motion, "fit", singular)
    static, prior = anchors(), odometry()
    found = estimate(static, seen(static.points_m), IDENTITY, prior, GLOBAL_SHUTTER, CAMERA)
    assert not found.visual
    np.testing.assert_allclose(np.diag(found.covariance)[:6], np.square(prior.sigma))


def test_points_that_agree_with_nothing_are_not_believed() -> None:
    static = anchors()
    pixels = np.random.default_rng(4).uniform((0.0, 0.0), (639.0, 479.0), (160, 2))
    found = estimate(static, pixels, IDENTITY, odometry(), GLOBAL_SHUTTER, CAMERA)
    assert not found.visual
    assert found.inlier_ratio < 0.25
    np.testing.assert_allclose(found.pose.translation_m, odometry().motion.translation_m)


def test_sigma_tells_the_error() -> None:
    """The camera is off by no more than the covariance says, which shrinks with the number of points."""
    sigmas = []
    for count in (40, 160):
        static = anchors(count)
        found = estimate(
            static, seen(static.points_m, noise_px=0.14), IDENTITY, nothing_known(), GLOBAL_SHUTTER, CAMERA
        )
        back = found.pose.inverse() @ TRUE
        error = np.concatenate((vector_from_rotation(back.rotation), back.translation_m))
        assert (
            error @ np.linalg.solve(found.covariance[:6, :6], error) < 16.8
        )  # 99 % of chi2 with 6 degrees of freedom
        sigmas.append(float(np.sqrt(np.trace(found.covariance[3:6, 3:6]))))
    assert sigmas[1] < 0.75 * sigmas[0]


def test_ends_on_upright_edges_count_across_them_only() -> None:
    """Errors of several pixels along the edges, in every point alike, do not turn the camera."""
    static = anchors()
    slid = seen(static.points_m) + np.array([0.0, 4.0])
    upright = replace(static, pixel_cov=np.tile([0.02, 0.0, 400.0], (len(slid), 1)))
    found = estimate(upright, slid, IDENTITY, odometry(), GLOBAL_SHUTTER, CAMERA)
    assert found.visual
    yaw = vector_from_rotation((TRUE.inverse() @ found.pose).rotation)[1]
    assert abs(yaw) < 2e-4


def test_points_behind_the_camera_have_no_say() -> None:
    static = anchors()
    behind = share(160, 0.3)
    passed = replace(static, points_m=np.where(behind[:, None], -static.points_m, static.points_m))
    found = estimate(passed, seen(static.points_m), IDENTITY, nothing_known(), GLOBAL_SHUTTER, CAMERA)
    metres, radians = off(found)
    assert metres < 1e-3
    assert radians < 2e-4
    assert found.inlier_ratio == pytest.approx(0.7, abs=0.02)


@pytest.mark.parametrize(("noise_px", "agree"), [(0.1, 0.9), (0.5, 0.0)])
def test_without_odometry_a_blurred_frame_is_fitted_with_its_own_noise(noise_px: float, agree: float) -> None:
    """The assumed sigma is 0.14 px."""
    static = anchors()
    found = estimate(
        static, seen(static.points_m, noise_px=noise_px), IDENTITY, nothing_known(), GLOBAL_SHUTTER, CAMERA
    )
    metres, radians = off(found)
    assert found.visual
    assert metres < 5e-3
    assert radians < 1e-3
    assert found.inlier_ratio >= agree


def test_the_noise_of_a_blurred_frame_is_measured_and_the_agreement_is_that_under_the_assumed_noise() -> None:
    """The assumed sigma is 0.14 px; more than twice of it is not assumed."""
    exact = replace(anchors(), depth_sigma_m=np.full(160, 1e-4))
    sharp, blurred, torn = (
        estimate(exact, seen(exact.points_m, noise_px=px), IDENTITY, nothing_known(), GLOBAL_SHUTTER, CAMERA)
        for px in (0.14, 0.5, 3.0)
    )
    assert not sharp.noisy
    assert blurred.noisy
    assert blurred.noise_scale == 4.0
    assert blurred.inlier_ratio < 0.45
    assert not torn.noisy
    assert torn.inlier_ratio < 0.45


def test_points_that_move_are_no_noise() -> None:
    """Where most of the view moves, the rest is not declared to be static by assuming more noise."""
    static = anchors()
    away = np.linspace(0.01, 0.08, 160)[:, None] * [1.0, 0.0, 0.0]
    now = static.points_m + np.where(share(160, 0.65)[:, None], away, 0.0)
    found = estimate(static, seen(now, noise_px=0.1), IDENTITY, nothing_known(), GLOBAL_SHUTTER, CAMERA)
    assert not found.noisy
