"""What is known of the camera before looking: by odometry, by a gyro, or on a robot that says nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.perception import EgoMotionSettings
from hal.types import CameraMount, FloatArray, Intrinsics, Pose
from tests.support.point_motion import project
from vision.camera.lens import rays, rotation_from_vector, vector_from_rotation
from vision.ego_motion.camera_motion import estimate
from vision.ego_motion.forward_speed import UNKNOWN_SPEED, ForwardSpeed
from vision.ego_motion.motion_memory import MotionMemory
from vision.ego_motion.motion_prior import (
    MotionPrior,
    SweepPrior,
    odometry_prior,
    rolling_prior,
    steady_prior,
    with_gyro,
)
from vision.ego_motion.reprojection import Anchors

CAMERA = Intrinsics(640, 480, 610.0, 610.0, 319.5, 239.5)
SETTINGS = EgoMotionSettings()
IDENTITY = Pose(np.eye(3), np.zeros(3))
DT_S = 1.0 / 30.0
GLOBAL_SHUTTER = SweepPrior(np.full(2, 1e-4), np.full(2, 1e-4))
LEVEL = CameraMount(0.3, 0.0, 0.5, 0.0)


def motion(turn: tuple[float, float, float], way: tuple[float, float, float]) -> Pose:
    return Pose(rotation_from_vector(np.array(turn)), np.array(way))


def test_the_robot_goes_on_ahead_and_turns_as_it_did() -> None:
    prior = rolling_prior(0.2, ForwardSpeed(0.5, 0.1), 0.2, LEVEL, SETTINGS)
    # Across its way the camera only swings around the turning centre, 0.3 m behind.
    np.testing.assert_allclose(vector_from_rotation(prior.motion.rotation), [0.0, 0.04, 0.0], atol=1e-12)
    np.testing.assert_allclose(prior.motion.translation_m, [0.3 * 0.04, 0.0, 0.1], atol=1e-12)
    assert prior.source == "none"


def test_a_camera_that_looks_down_goes_along_the_floor() -> None:
    tilted = CameraMount(0.3, 0.0, 0.5, math.radians(30.0))
    prior = rolling_prior(0.0, ForwardSpeed(0.1 / DT_S, 0.1), DT_S, tilted, SETTINGS)
    np.testing.assert_allclose(prior.motion.translation_m, [0.0, -0.05, 0.05 * math.sqrt(3.0)], atol=1e-12)
    turned = rolling_prior(0.6, ForwardSpeed(0.0, 0.1), DT_S, tilted, SETTINGS)
    expected = 0.02 * np.array([0.0, math.cos(math.radians(30.0)), 0.5])
    np.testing.assert_allclose(vector_from_rotation(turned.motion.rotation), expected, atol=1e-12)


def test_sigma_per_axis() -> None:
    known = rolling_prior(0.0, ForwardSpeed(0.0, 0.12), DT_S, LEVEL, SETTINGS).sigma / DT_S
    # 0.12 m/s as it was, and 1.5 m/s^2 for 1/30 s.
    np.testing.assert_allclose(known, [0.25, 0.6, 0.25, math.hypot(0.1, 0.3 * 0.6), 0.1, 0.13])
    # Where not even the motion before is known, speed and turn are wider; what robots cannot do is not.
    first = rolling_prior(None, UNKNOWN_SPEED, DT_S, LEVEL, SETTINGS)
    np.testing.assert_array_equal(first.motion.rotation, np.eye(3))
    np.testing.assert_array_equal(first.motion.translation_m, 0.0)
    np.testing.assert_allclose(first.sigma / DT_S, [0.25, 1.8, 0.25, math.hypot(0.1, 0.3 * 1.8), 0.1, 1.5])


def seen_mps(prior: MotionPrior, ahead_mps: float, crowd_mps: tuple[float, float]) -> FloatArray:
    """(3,) how fast the camera seems to go, which drives ahead_mps; two thirds of what is seen go crowd_mps
    to the right and ahead."""
    rng = np.random.default_rng(3)
    pixels = rng.uniform((20.0, 20.0), (620.0, 460.0), (90, 2))
    direction = rays(pixels, CAMERA)
    points = direction * rng.uniform(2.0, 6.0, 90)[:, None]
    covariance = np.tile([0.02, 0.0, 0.02], (90, 1))
    anchors = Anchors(
        points, direction, np.full(90, 0.02), covariance, np.ones(90, np.bool_), np.zeros(90, np.bool_)
    )
    now: FloatArray = points.copy()
    now[:60, 0] += crowd_mps[0] * DT_S
    now[:60, 2] += crowd_mps[1] * DT_S
    now[:, 2] -= ahead_mps * DT_S
    found = estimate(anchors, project(now, CAMERA), IDENTITY, prior, GLOBAL_SHUTTER, CAMERA)
    return np.asarray(found.pose.translation_m / DT_S)


def test_a_crowd_that_crosses_does_not_pass_for_the_robots_own_motion() -> None:
    last = motion((0.0, 0.0, 0.0), (0.0, 0.0, 0.5 * DT_S))
    rolling = rolling_prior(0.0, ForwardSpeed(0.5, 0.1), DT_S, CameraMount(0.0, 0.0, 0.5, 0.0), SETTINGS)
    by_hand = steady_prior(last, DT_S, DT_S, SETTINGS)
    assert seen_mps(rolling, 0.5, (0.7, 0.0))[0] == pytest.approx(0.0, abs=0.1)
    # A camera carried by hand may well have gone to the left: then the majority decides.
    assert seen_mps(by_hand, 0.5, (0.7, 0.0))[0] == pytest.approx(-0.7, abs=0.1)


@pytest.mark.parametrize("before_mps", [0.7, 0.8, 0.9])
def test_nor_does_a_crowd_that_goes_ahead_at_its_pace(before_mps: float) -> None:
    """Beside which it seems to stand; a frame ago it went before_mps, and may have gathered speed since."""
    last = motion((0.0, 0.0, 0.0), (0.0, 0.0, before_mps * DT_S))
    rolling = rolling_prior(0.0, ForwardSpeed(before_mps, 0.1), DT_S, LEVEL, SETTINGS)
    by_hand = steady_prior(last, DT_S, DT_S, SETTINGS)
    assert seen_mps(rolling, 0.8, (0.0, 0.8))[2] == pytest.approx(0.8, abs=0.1)
    assert seen_mps(by_hand, 0.8, (0.0, 0.8))[2] == pytest.approx(0.0, abs=0.1)


def test_odometry_prior_by_hand() -> None:
    settings = EgoMotionSettings(
        odometry_yaw_ratio=0.2,
        odometry_rotation_radps=0.04,
        vibration_radps=0.25,
        odometry_speed_ratio=0.06,
        odometry_speed_mps=0.03,
    )
    turned = Pose(rotation_from_vector(np.array([0.0, 0.05, 0.0])), np.array([0.0, 0.0, 0.1]))
    prior = odometry_prior(turned, 0.1, settings)
    # Yaw 0.2 0.05 + 0.04 0.1; tilt 0.25 0.1 + 0.1 0.05; way 0.06 0.1 + 0.03 0.1.
    np.testing.assert_allclose(prior.sigma, [0.03, 0.014, 0.03, 0.009, 0.009, 0.009])
    assert prior.source == "odometry"
    assert prior.motion is turned


def test_steady_prior_goes_on_as_before() -> None:
    last = Pose(rotation_from_vector(np.array([0.0, 0.02, 0.0])), np.array([0.0, 0.0, 0.05]))
    prior = steady_prior(last, 0.1, 0.2, SETTINGS)
    np.testing.assert_allclose(prior.motion.translation_m, [0.0, 0.0, 0.1])
    np.testing.assert_allclose(vector_from_rotation(prior.motion.rotation), [0.0, 0.04, 0.0])
    np.testing.assert_allclose(prior.sigma, [0.6 * 0.2] * 3 + [0.5 * 0.2] * 3)
    assert prior.source == "none"
    blind = steady_prior(last, 0.0, 0.2, SETTINGS)
    np.testing.assert_allclose(blind.motion.translation_m, 0.0)
    np.testing.assert_allclose(blind.sigma, 3.0 * prior.sigma)


def test_a_gyro_gives_the_rotation_and_how_sure_it_is() -> None:
    prior = odometry_prior(motion((0.002, 0.01, -0.001), (0.0, 0.0, 0.02)), 0.1, SETTINGS)
    turned = with_gyro(prior, np.array([0.0, 0.05, 0.0]), 0.1, SETTINGS)
    np.testing.assert_allclose(vector_from_rotation(turned.motion.rotation), [0.0, 0.05, 0.0])
    np.testing.assert_allclose(turned.motion.translation_m, prior.motion.translation_m)
    np.testing.assert_allclose(turned.sigma[:3], 0.02 * 0.1)
    np.testing.assert_allclose(turned.sigma[3:], prior.sigma[3:])
    assert (turned.source, turned.trusted) == (prior.source, prior.trusted)


def test_a_gyro_also_tells_how_a_turn_swings_the_camera_of_a_robot() -> None:
    known = rolling_prior(0.6, ForwardSpeed(0.0, 0.12), DT_S, LEVEL, SETTINGS, turn_sigma_radps=0.02)
    np.testing.assert_allclose(known.motion.translation_m, [0.3 * 0.6 * DT_S, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(known.sigma / DT_S, [0.25, 0.02, 0.25, math.hypot(0.1, 0.3 * 0.02), 0.1, 0.13])
    memory = MotionMemory(LEVEL, SETTINGS)
    turned = memory.prior(None, np.array([0.001, 0.02, -0.001]), DT_S)
    np.testing.assert_allclose(turned.motion.translation_m, [0.3 * 0.02, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(turned.sigma[:3], 0.02 * DT_S)
    assert turned.sigma[3] == pytest.approx(math.hypot(0.1, 0.3 * 0.02) * DT_S)
