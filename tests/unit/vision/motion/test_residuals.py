"""Residuals of ends whose way is known exactly: a camera that stands still, no images."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from config.perception import DepthNoise
from hal.types import FloatArray, Intrinsics, Pose
from tests.support.point_motion import project
from vision.ego_motion.camera_motion import CameraEstimate
from vision.fragments.candidates import NewFragments
from vision.fragments.store import FragmentStore
from vision.motion import residuals as module
from vision.motion.anchor_depths import average_depth, depths_with_sigma, static_points
from vision.motion.residuals import observed_variance_scale, residuals
from vision.motion.velocities import EndResiduals

CAMERA = Intrinsics(640, 480, 600.0, 600.0, 320.0, 240.0)
NOISE = DepthNoise(floor_m=0.005, quadratic_per_m=0.0075)
FRAME_NS = 33_333_333
FRAME_S = FRAME_NS * 1e-9
WINDOW_S = 0.25
STILL = Pose(np.eye(3), np.zeros(3))
HERE = CameraEstimate(STILL, np.zeros(2), np.zeros(2), np.ones(2), 1e-12 * np.eye(8), 0.9, True)
ENDS_M = np.array([[-0.2, 0.1, 5.0], [0.3, 0.1, 5.0]])


@dataclass
class Way:
    """One fragment, frame by frame. motions: the residuals of every frame but the first."""

    store: FragmentStore
    motions: list[EndResiduals]


def follow(ends_m: list[FloatArray], far_m: float | None = None, scale: float = 1.0) -> Way:
    """ends_m: the two ends (2, 3) in each frame. far_m: what lies behind them, in every frame."""
    store = FragmentStore()
    way = Way(store, [])
    for k, points in enumerate(ends_m):
        stamp_ns = (k + 1) * FRAME_NS
        pixels = project(points, CAMERA).astype(np.float32)[None]
        near = points[None, :, 2].astype(np.float32)
        far = near if far_m is None else np.full((1, 2), far_m, np.float32)
        if k == 0:
            covariance = np.tile(np.array([0.02, 0.0, 0.02], np.float32), (1, 2, 1))
            store.add(NewFragments(pixels, near, far, covariance))
        else:
            store.ends_px, store.near_m, store.far_m = pixels, near, far
            anchor = store.anchors(stamp_ns, WINDOW_S)
            way.motions.append(
                residuals(store, anchor, depths_with_sigma(anchor, NOISE), HERE, CAMERA, NOISE, scale)
            )
            average_depth(store, store.last_entries(stamp_ns), STILL, NOISE)
        store.commit(stamp_ns, STILL, CAMERA, np.zeros(2))
    return way


def going(velocity_mps: tuple[float, float, float], count: int) -> list[FloatArray]:
    return [ENDS_M + np.array(velocity_mps) * (k * FRAME_S) for k in range(count)]


@pytest.mark.parametrize("speed_mps", [-1.0, 1.0])
def test_averaged_depth_of_a_mover_gives_its_speed_along_the_axis_without_bias(speed_mps: float) -> None:
    """Depth is averaged as if it stood still and therefore late; the time is that late, too. What is
    remembered when the average has just become a running one is by how much it is not known exactly."""
    motions = follow(going((0.0, 0.0, speed_mps), 31)).motions
    speeds = np.array([motion.depth_step_m / motion.depth_lag_s for motion in motions])
    np.testing.assert_allclose(speeds[:11], speed_mps, rtol=0.02)
    np.testing.assert_allclose(speeds[11:], speed_mps, rtol=0.15)
    assert speeds[11:].mean() == pytest.approx(speed_mps, rel=0.06)
    # By the time since the anchor alone it would be too much by half.
    assert (motions[-1].depth_step_m / motions[-1].lag_s / speed_mps > 1.4).all()


def test_depth_and_image_agree_on_a_static_end() -> None:
    for motion in follow(going((0.0, 0.0, 0.0), 12)).motions:
        np.testing.assert_allclose(motion.depth_step_m, 0.0, atol=1e-5)
        np.testing.assert_allclose(motion.residual_m, 0.0, atol=1e-4)
        assert (motion.static_chi2 < 0.01).all()
        assert motion.usable.all()


def test_depth_lag_by_hand() -> None:
    """In the second frame one look, a frame ago. Later the window of 0.25 s is seven frames, and what is
    remembered from then on is an average that is late itself."""
    motions = follow(going((0.0, 0.0, 0.0), 20)).motions
    np.testing.assert_allclose(motions[0].lag_s, FRAME_S)
    np.testing.assert_allclose(motions[0].depth_lag_s, FRAME_S)
    # Third frame: the anchor is still the first one, of one look.
    np.testing.assert_allclose(motions[1].depth_lag_s, 2.0 * FRAME_S)
    # Frame 10: anchored seven frames ago, in the third frame, the mean of three looks: one frame late.
    np.testing.assert_allclose(motions[8].lag_s, 7.0 * FRAME_S)
    np.testing.assert_allclose(motions[8].depth_lag_s, 8.0 * FRAME_S)
    # The longest memory: four frames late.
    np.testing.assert_allclose(motions[-1].depth_lag_s, 11.0 * FRAME_S)


def test_a_step_across_is_seen_as_a_miss_in_metres() -> None:
    motion = follow(going((0.6, 0.0, 0.0), 6)).motions[-1]
    np.testing.assert_allclose(motion.residual_m[:, 0], 0.6 * motion.lag_s, rtol=1e-3)
    np.testing.assert_allclose(motion.residual_m[:, 1], 0.0, atol=1e-4)
    assert (motion.static_chi2 > 50.0).all()


def test_a_leap_in_depth_begins_the_average_anew() -> None:
    leap = going((0.0, 0.0, 0.0), 8) + [ENDS_M - np.array([0.0, 0.0, 2.0])] * 2
    store = follow(leap).store
    np.testing.assert_allclose(store.depth_m, 3.0, atol=1e-5)
    np.testing.assert_allclose(store.depth_samples, 2.0)


def test_an_average_is_of_six_looks_at_most() -> None:
    np.testing.assert_allclose(follow(going((0.0, 0.0, 0.0), 20)).store.depth_samples, 6.0)


def test_missing_depth_is_a_distant_point_hardly_known_and_not_used() -> None:
    store = FragmentStore()
    pixels = project(ENDS_M, CAMERA).astype(np.float32)[None]
    nothing = np.full((1, 2), np.nan, np.float32)
    store.add(NewFragments(pixels, nothing, nothing, np.ones((1, 2, 3), np.float32)))
    store.commit(FRAME_NS, STILL, CAMERA, np.zeros(2))
    anchor = store.anchors(2 * FRAME_NS, WINDOW_S)
    depths = depths_with_sigma(anchor, NOISE)
    np.testing.assert_array_equal(depths.near_m, 12.0)
    np.testing.assert_array_equal(depths.sigma_m, 10.0)
    assert not depths.known.any()
    motion = residuals(store, anchor, depths, HERE, CAMERA, NOISE, 1.0)
    assert not motion.usable.any()
    assert np.isnan(motion.depth_step_m).all()
    assert np.isfinite(motion.static_chi2).all()


def test_an_end_before_a_distant_surface_measures_the_cameras_turn_on_either_surface() -> None:
    store = FragmentStore()
    pixels = project(ENDS_M, CAMERA).astype(np.float32)[None]
    near, far = np.full((1, 2), 5.0, np.float32), np.array([[14.0, 9.9]], np.float32)
    store.add(NewFragments(pixels, near, far, np.ones((1, 2, 3), np.float32)))
    store.commit(FRAME_NS, STILL, CAMERA, np.zeros(2))
    anchor = store.anchors(2 * FRAME_NS, WINDOW_S)
    points = static_points(anchor, depths_with_sigma(anchor, NOISE), store.pixel_cov, np.array([False]), 10.0)
    assert points.usable.tolist() == [True, False]
    assert points.depth_sigma_m[0] == pytest.approx(9.0)


def test_looks_make_depth_surer_but_never_more_than_twice() -> None:
    """Of neighbouring pixels noise is alike in part."""
    store = follow(going((0.0, 0.0, 0.0), 20)).store
    single = 0.005 + 0.0075 * 25.0
    settled = depths_with_sigma(store.last_entries(21 * FRAME_NS), NOISE)
    np.testing.assert_allclose(settled.sigma_m, 0.5 * single, rtol=1e-4)
    young = depths_with_sigma(follow(going((0.0, 0.0, 0.0), 2)).store.last_entries(3 * FRAME_NS), NOISE)
    np.testing.assert_allclose(young.sigma_m, single / np.sqrt(2.0), rtol=1e-4)


def test_ends_on_two_surfaces_and_ends_of_movers_are_no_static_points() -> None:
    store = follow(going((0.0, 0.0, 0.0), 3), far_m=8.0).store
    anchor = store.anchors(4 * FRAME_NS, WINDOW_S)
    depths = depths_with_sigma(anchor, NOISE)
    assert depths.mixed.all()
    assert not static_points(anchor, depths, store.pixel_cov, np.array([False]), 10.0).usable.any()
    store = follow(going((0.0, 0.0, 0.0), 3)).store
    anchor = store.anchors(4 * FRAME_NS, WINDOW_S)
    depths = depths_with_sigma(anchor, NOISE)
    assert not depths.mixed.any()
    assert not static_points(anchor, depths, store.pixel_cov, np.array([True]), 10.0).usable.any()
    points = static_points(anchor, depths, store.pixel_cov, np.array([False]), 10.0)
    assert points.usable.all()
    np.testing.assert_allclose(points.points_m, ENDS_M, atol=1e-4)


def test_an_end_at_the_rim_of_something_slides_along_its_fragment_only() -> None:
    """The fragment lies level: along it three pixels are doubtful, across it three tenths."""
    plain = follow(going((0.0, 0.0, 0.0), 3)).motions[-1]
    rim = follow(going((0.0, 0.0, 0.0), 3), far_m=8.0).motions[-1]
    more = (rim.covariance - plain.covariance) / (5.0 / 600.0) ** 2
    np.testing.assert_allclose(more, [[9.09, 0.0, 0.09]] * 2, rtol=1e-3, atol=1e-6)


def some(chi2: FloatArray, usable: bool = True) -> EndResiduals:
    count = len(chi2)
    pair = np.zeros((count, 2))
    return EndResiduals(
        static_m=np.zeros((count, 3)),
        ray=pair,
        lag_s=np.zeros(count),
        residual_m=pair,
        covariance=np.ones((count, 3)),
        depth_effect=pair,
        depth_step_m=np.zeros(count),
        depth_step_sigma_m=np.ones(count),
        depth_lag_s=np.zeros(count),
        static_chi2=chi2,
        usable=np.full(count, usable),
    )


def test_the_scatter_of_static_ends_is_learned_slowly_from_their_lower_third() -> None:
    """A third of chi-square with two degrees of freedom lies below 0.811."""
    old, nobody = np.full(20, 5), np.zeros(20, np.bool_)
    chi2 = np.sort(np.random.default_rng(2).chisquare(2, 40))
    third = float(np.quantile(chi2, 1.0 / 3.0))
    learned = observed_variance_scale(some(chi2), old, nobody, 1.0, 1.0)
    assert learned == pytest.approx(1.0 + 0.15 * (third / 0.811 - 1.0))
    # Half of the view moves: the lower third does not care.
    chi2[20:] += 500.0
    assert observed_variance_scale(some(chi2), old, nobody, 1.0, 1.0) == pytest.approx(learned)
    # Twice the deviation everywhere.
    twice = some(4.0 * np.full(40, 0.811))
    assert observed_variance_scale(twice, old, nobody, 1.0, 1.0) == pytest.approx(1.45)
    # The same scatter, measured in a frame that was taken for noisy.
    as_assumed = some(np.full(40, 0.811))
    assert observed_variance_scale(as_assumed, old, nobody, 4.0, 1.0) == pytest.approx(1.45)


def test_the_scatter_has_bounds_and_needs_enough_settled_ends() -> None:
    old, nobody = np.full(20, 5), np.zeros(20, np.bool_)
    wild = some(np.full(40, 1e6))
    unusable = some(np.full(40, 1e6), usable=False)
    assert observed_variance_scale(wild, old, nobody, 1.0, 1.0) == 8.0
    assert observed_variance_scale(some(np.zeros(40)), old, nobody, 0.31, 0.31) == 0.3
    assert observed_variance_scale(wild, np.full(20, 2), nobody, 1.0, 1.0) == 1.0
    assert observed_variance_scale(wild, old, ~nobody, 1.0, 1.0) == 1.0
    assert observed_variance_scale(unusable, old, nobody, 1.0, 1.0) == 1.0


@pytest.mark.parametrize(
    ("miss", "covariance", "effect", "expected"),
    [
        ((3.0, 4.0), (9.0, 0.0, 16.0), (0.0, 0.0), 2.0),
        # The inverse of [[2, 1], [1, 2]] is [[2, -1], [-1, 2]] / 3.
        ((1.0, 0.0), (2.0, 1.0, 2.0), (0.0, 0.0), 2.0 / 3.0),
        # Depth's effect (1, 0) doubles the variance along x.
        ((2.0, 1.0), (1.0, 0.0, 1.0), (1.0, 0.0), 3.0),
        # Effect (1, 1) on the unit matrix makes [[2, 1], [1, 2]] again.
        ((1.0, 0.0), (1.0, 0.0, 1.0), (1.0, 1.0), 2.0 / 3.0),
    ],
)
def test_chi2_by_numbers(
    miss: tuple[float, float],
    covariance: tuple[float, float, float],
    effect: tuple[float, float],
    expected: float,
) -> None:
    assert module._squared_sigmas(miss, covariance, effect) == pytest.approx(expected)


def test_no_fragments_give_no_residuals() -> None:
    store = FragmentStore()
    store.commit(FRAME_NS, STILL, CAMERA, np.zeros(2))
    anchor = store.anchors(2 * FRAME_NS, WINDOW_S)
    depths = depths_with_sigma(anchor, NOISE)
    motion = residuals(store, anchor, depths, HERE, CAMERA, NOISE, 1.0)
    assert motion.static_m.shape == (0, 3)
    assert len(motion.usable) == len(motion.depth_step_m) == 0
    moving = np.empty(0, np.bool_)
    assert len(static_points(anchor, depths, store.pixel_cov, moving, 10.0).usable) == 0
    average_depth(store, store.last_entries(2 * FRAME_NS), STILL, NOISE)
    assert store.depth_m.shape == store.depth_samples.shape == (0, 2)


def test_a_camera_that_went_past_an_end_does_not_use_it() -> None:
    """Nor one whose way is no number."""
    store = follow(going((0.0, 0.0, 0.0), 3)).store
    anchor = store.anchors(4 * FRAME_NS, WINDOW_S)
    depths = depths_with_sigma(anchor, NOISE)
    for beyond_m in (4.95, 6.0, np.nan):
        now = replace(HERE, pose=Pose(np.eye(3), np.array([0.0, 0.0, beyond_m])))
        assert not residuals(store, anchor, depths, now, CAMERA, NOISE, 1.0).usable.any()
