"""The robot's forward speed without odometry: by hand, and against what a tracked robot cannot do."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.perception import EgoMotionSettings
from hal.types import CameraMount, Pose
from vision.ego_motion.forward_speed import UNKNOWN_SPEED, ForwardSpeed
from vision.ego_motion.motion_memory import MotionMemory

SETTINGS = EgoMotionSettings(rolling_accel_mps2=1.5)
DT_S = 0.05
LEVEL = CameraMount(0.3, 0.0, 0.5, 0.0)


def step(speed_mps: float) -> Pose:
    return Pose(np.eye(3), np.array([0.02, -0.01, speed_mps * DT_S]))


def test_first_frame_is_taken_as_it_is() -> None:
    assert UNKNOWN_SPEED.seen(step(0.8), DT_S, LEVEL, SETTINGS) == pytest.approx((0.8, 0.1))


def test_a_further_frame_by_hand() -> None:
    """Prior 0.08 m/s and 1.5 m/s^2 for 0.05 s: variance 0.0064 + 0.005625; gain 0.012025 / 0.022025."""
    after = ForwardSpeed(1.0, 0.08).seen(step(0.6), DT_S, LEVEL, SETTINGS)
    gain = 0.012025 / 0.022025
    assert after == pytest.approx((1.0 - 0.4 * gain, 0.1 * math.sqrt(gain)))


def test_frames_that_tell_nothing_leave_the_speed_and_widen_it_by_the_acceleration() -> None:
    later = ForwardSpeed(1.0, 0.08).unseen(DT_S, SETTINGS).unseen(DT_S, SETTINGS)
    assert later == pytest.approx((1.0, 0.08 + 2 * 1.5 * DT_S))


def test_a_camera_that_looks_down_measures_along_the_floor() -> None:
    tilted = CameraMount(0.3, 0.0, 0.5, math.radians(30.0))
    along = Pose(np.eye(3), DT_S * np.array([0.0, -0.5, 0.5 * math.sqrt(3.0)]))
    assert UNKNOWN_SPEED.seen(along, DT_S, tilted, SETTINGS).mps == pytest.approx(1.0)


def prior_mps(memory: MotionMemory) -> tuple[float, float]:
    prior = memory.prior(None, None, DT_S)
    return float(prior.motion.translation_m[2]) / DT_S, float(prior.sigma[5]) / DT_S


def test_one_odd_frame_does_not_carry_the_prior_away() -> None:
    """By the images of one frame the robot has lost 0.5 m/s in 50 ms: nearly all of it is a mistake."""
    memory = MotionMemory(LEVEL, SETTINGS)
    for _ in range(20):
        memory.learn(step(1.4), DT_S, "visual")
    memory.learn(step(0.9), DT_S, "visual")
    speed_mps, sigma_mps = prior_mps(memory)
    assert 1.1 < speed_mps < 1.25
    assert sigma_mps < 0.15


def test_after_a_gap_nothing_is_known() -> None:
    memory = MotionMemory(LEVEL, SETTINGS)
    memory.learn(step(1.4), DT_S, "visual")
    memory.forget()
    assert prior_mps(memory) == pytest.approx((0.0, SETTINGS.steady_speed_mps * SETTINGS.unknown_factor))


def test_images_that_take_the_robot_backwards_are_refuted() -> None:
    memory = MotionMemory(LEVEL, SETTINGS)
    assert not memory.refutes(step(-0.049), DT_S, "none")  # at first they are taken as they are
    assert memory.refutes(step(-0.051), DT_S, "none")
    assert not memory.refutes(step(-0.051), DT_S, "odometry")
    assert not MotionMemory(None, SETTINGS).refutes(step(-0.051), DT_S, "none")  # a hand goes any way
    for _ in range(5):
        memory.learn(step(0.0), DT_S, "visual")
    assert not memory.refutes(step(-0.08), DT_S, "none")  # half of it may be an error of one frame
    assert memory.refutes(step(-0.15), DT_S, "none")


def test_after_a_refuted_motion_the_robot_may_go_ahead_at_any_speed() -> None:
    memory = MotionMemory(LEVEL, SETTINGS)
    memory.learn(step(0.0), DT_S, "visual")
    memory.begin_again()
    speed_mps, sigma_mps = prior_mps(memory)
    assert speed_mps == pytest.approx(0.5)
    assert sigma_mps == pytest.approx(np.hypot(0.5, 1.5 * DT_S))


def test_a_camera_in_the_hand_goes_on_as_in_the_last_frame() -> None:
    memory = MotionMemory(None, SETTINGS)
    memory.learn(step(1.4), DT_S, "visual")
    memory.learn(step(0.9), DT_S, "visual")
    assert prior_mps(memory)[0] == pytest.approx(0.9)


def test_odometry_of_two_frames_is_the_prior() -> None:
    memory = MotionMemory(LEVEL, SETTINGS)
    memory.note_odometry(Pose(np.eye(3), np.array([0.0, 0.0, 1.0])))
    prior = memory.prior(Pose(np.eye(3), np.array([0.0, 0.0, 1.05])), None, DT_S)
    np.testing.assert_allclose(prior.motion.translation_m, [0.0, 0.0, 0.05])
    assert prior.source == "odometry"
