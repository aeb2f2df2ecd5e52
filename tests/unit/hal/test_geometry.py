import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hal.geometry import (
    advance_pose,
    body_in_floor,
    camera_in_body,
    camera_in_floor,
    planar,
    wrap_angle_rad,
)
from hal.types import CameraMount, PlanarPose, Pose

LEVEL = CameraMount(forward_m=0.4, left_m=0.1, height_m=0.6, pitch_rad=0.0)


def test_a_level_camera_looks_along_the_body() -> None:
    # 2 m ahead on the axis, 1 m to the right, 0.5 m down: body x 2.4, y -0.9, z 0.1
    point = camera_in_body(LEVEL).apply(np.array([[1.0, 0.5, 2.0]]))
    assert point == pytest.approx(np.array([[2.4, -0.9, 0.1]]))


def test_a_positive_pitch_looks_down() -> None:
    mount = CameraMount(forward_m=0.0, left_m=0.0, height_m=1.0, pitch_rad=math.radians(30))
    # The axis meets the floor where 1 m height / tan 30 deg says.
    axis = camera_in_body(mount).apply(np.array([[0.0, 0.0, 2.0]]))
    assert axis == pytest.approx(np.array([[math.sqrt(3.0), 0.0, 0.0]]))


def test_a_turned_body_carries_its_camera() -> None:
    pose = camera_in_floor(PlanarPose(1.0, 2.0, math.pi / 2), LEVEL)
    assert pose.translation_m == pytest.approx(np.array([0.9, 2.4, 0.6]))
    assert pose.rotation @ np.array([0.0, 0.0, 1.0]) == pytest.approx(np.array([0.0, 1.0, 0.0]))


def test_inverse_and_chain_cancel() -> None:
    pose = camera_in_floor(PlanarPose(1.0, 2.0, 0.7), LEVEL)
    identity = pose @ pose.inverse()
    assert identity.rotation == pytest.approx(np.eye(3))
    assert identity.translation_m == pytest.approx(np.zeros(3))


def test_chain_applies_the_inner_pose_first() -> None:
    turn = Pose(np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.zeros(3))
    shift = Pose(np.eye(3), np.array([1.0, 0.0, 0.0]))
    assert (turn @ shift).apply(np.zeros((1, 3))) == pytest.approx(np.array([[0.0, 1.0, 0.0]]))


def test_a_quarter_circle_ends_where_geometry_says() -> None:
    # v 1 m/s, w 0.5 rad/s: radius 2 m; after pi s a quarter turn to (2, 2).
    pose = advance_pose(PlanarPose(0.0, 0.0, 0.0), 1.0, 0.5, math.pi)
    assert (pose.x_m, pose.y_m, pose.heading_rad) == pytest.approx((2.0, 2.0, math.pi / 2))


def test_straight_motion_needs_no_turn() -> None:
    pose = advance_pose(PlanarPose(1.0, 1.0, math.pi / 2), 2.0, 0.0, 0.5)
    assert (pose.x_m, pose.y_m, pose.heading_rad) == pytest.approx((1.0, 2.0, math.pi / 2))


@given(st.floats(-1e4, 1e4))
def test_a_wrapped_angle_is_the_same_angle_in_one_turn(angle_rad: float) -> None:
    wrapped = wrap_angle_rad(angle_rad)
    assert -math.pi <= wrapped < math.pi + 1e-12
    assert math.cos(wrapped) == pytest.approx(math.cos(angle_rad), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle_rad), abs=1e-9)


@pytest.mark.parametrize("heading_rad", [-3.0, -0.5, 0.0, 2.0])
def test_a_body_on_the_floor_is_found_again(heading_rad: float) -> None:
    found = planar(body_in_floor(PlanarPose(1.5, -2.0, heading_rad)))
    assert (found.x_m, found.y_m, found.heading_rad) == pytest.approx((1.5, -2.0, heading_rad))
