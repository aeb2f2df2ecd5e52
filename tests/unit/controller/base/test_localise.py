import math
from dataclasses import replace

import numpy as np
import pytest

from controller.base.localise import Localiser, PoseHistory
from hal.geometry import advance_pose, camera_in_body
from hal.types import CameraMount, PlanarPose, Pose
from vision.scene import EgoMotion

MOUNT = CameraMount(forward_m=0.4, left_m=0.0, height_m=0.6, pitch_rad=0.1)
ORIGIN = PlanarPose(0.0, 0.0, 0.0)
MS = 1_000_000


def ego(turn_rad: float, dt_s: float, source: str = "visual") -> EgoMotion:
    c, s = math.cos(turn_rad), math.sin(turn_rad)
    in_body = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    camera = camera_in_body(MOUNT).rotation
    return EgoMotion(Pose(camera.T @ in_body @ camera, np.zeros(3)), dt_s, source, 1.0, 0.01, 0.002)


def test_a_pose_between_two_known_ones_is_interpolated_the_short_way_round() -> None:
    history = PoseHistory()
    history.append(0, PlanarPose(0.0, 0.0, math.radians(170)))
    history.append(100, PlanarPose(1.0, 2.0, math.radians(-170)))
    pose = history.at(50)
    assert pose is not None
    assert (pose.x_m, pose.y_m) == pytest.approx((0.5, 1.0))
    assert math.degrees(pose.heading_rad) == pytest.approx(-180.0)


def test_pose_outside_the_history_is_unknown() -> None:
    history = PoseHistory(reach_s=0.1)
    assert history.at(0) is None
    history.append(1000 * MS, ORIGIN)
    assert history.at(999 * MS) is None
    assert history.at(1100 * MS) is ORIGIN
    assert history.at(1101 * MS) is None


def test_pose_is_extrapolated_by_at_most_the_last_interval() -> None:
    """A frame that is exposed between two steps of the control loop is looked at before the second."""
    history = PoseHistory(reach_s=0.1)
    history.append(1000 * MS, ORIGIN)
    history.append(1020 * MS, PlanarPose(0.02, 0.0, 0.01))
    between, later = history.at(1030 * MS), history.at(1060 * MS)
    assert between is not None
    assert later is not None
    assert (between.x_m, between.heading_rad) == pytest.approx((0.03, 0.015))
    assert (later.x_m, later.heading_rad) == pytest.approx((0.04, 0.02))
    assert history.at(1121 * MS) is None


def test_a_stamp_that_does_not_advance_replaces() -> None:
    history = PoseHistory()
    history.append(5, ORIGIN)
    history.append(5, PlanarPose(1.0, 0.0, 0.0))
    assert history.at(5) == PlanarPose(1.0, 0.0, 0.0)


def test_without_scenes_the_pose_is_the_odometry_from_the_start() -> None:
    start = PlanarPose(2.0, 1.0, math.pi / 2)
    localiser = Localiser(start, MOUNT)
    odometry = PlanarPose(5.0, 5.0, 1.0)
    for step in range(51):
        localiser.add_odometry(step * 20 * MS, odometry)
        odometry = advance_pose(odometry, 0.5, 0.2, 0.02)
    expected = advance_pose(start, 0.5, 0.2, 1.0)
    assert (localiser.pose.x_m, localiser.pose.y_m) == pytest.approx((expected.x_m, expected.y_m), abs=1e-6)
    assert localiser.pose.heading_rad == pytest.approx(expected.heading_rad)


@pytest.mark.parametrize("missing", [math.nan, math.inf])
def test_a_pose_that_is_not_known_is_not_kept_and_the_last_one_grows_old(missing: float) -> None:
    history = PoseHistory(reach_s=0.1)
    history.append(0, ORIGIN)
    history.append(50 * MS, PlanarPose(0.0, missing, 0.0))
    assert history.at(50 * MS) is ORIGIN
    history.append(150 * MS, PlanarPose(0.0, 0.0, missing))
    assert history.at(150 * MS) is None


def test_odometry_that_is_missing_is_no_pose_and_no_standing_and_then_it_goes_on() -> None:
    """Half a second on an arc of which the odometry tells nothing for a fifth."""
    localiser, odometry = Localiser(ORIGIN, MOUNT), PlanarPose(5.0, 5.0, 1.0)
    for step in range(26):
        missing = 10 <= step < 20
        told = PlanarPose(math.nan, odometry.y_m, 0.0) if missing else odometry
        fused = localiser.add_odometry(step * 20 * MS, told)
        assert fused.finite is not missing
        assert localiser.pose.finite is not missing
        odometry = advance_pose(odometry, 0.5, 0.2, 0.02)
        if step == 19:
            assert localiser.camera_pose(19 * 20 * MS) is None, "10 periods without any"
            assert localiser.body_pose(19 * 20 * MS) is None
            localiser.add_ego_motion(160 * MS, ego(0.004, 0.02))
            assert not localiser.pose.finite, "what a camera sees of earlier does not make it known"
    expected = advance_pose(ORIGIN, 0.5, 0.2, 0.5)
    assert (localiser.pose.x_m, localiser.pose.y_m) == pytest.approx((expected.x_m, expected.y_m), abs=1e-5)
    assert localiser.pose.heading_rad == pytest.approx(expected.heading_rad, abs=1e-3)


@pytest.mark.parametrize("broken", ["rotation", "dt_s"])
def test_ego_motion_that_is_not_a_number_teaches_nothing(broken: str) -> None:
    localiser = Localiser(ORIGIN, MOUNT)
    for step in range(10):
        localiser.add_odometry(step * 20 * MS, PlanarPose(0.01 * step, 0.0, 0.01 * step))
    seen = ego(0.01, 0.02)
    if broken == "rotation":
        seen = replace(seen, motion=Pose(np.full((3, 3), math.nan), np.zeros(3)))
    else:
        seen = replace(seen, dt_s=math.nan)
    localiser.add_ego_motion(180 * MS, seen)
    assert localiser.yaw_ratio == 1.0
    assert localiser.pose.finite


def drive_with_slip(true_ratio: float, source: str) -> tuple[Localiser, PlanarPose]:
    """10 s on an arc; the odometry turns faster than the robot does, the camera sees the truth."""
    localiser = Localiser(ORIGIN, MOUNT)
    odometry = truth = ORIGIN
    for step in range(500):
        localiser.add_odometry(step * 20 * MS, odometry)
        if step and step % 2 == 0:
            localiser.add_ego_motion(step * 20 * MS, ego(0.3 * true_ratio * 0.04, 0.04, source))
        odometry = advance_pose(odometry, 0.8, 0.3, 0.02)
        truth = advance_pose(truth, 0.8, 0.3 * true_ratio, 0.02)
    localiser.add_odometry(500 * 20 * MS, odometry)
    return localiser, truth


def test_the_slip_that_the_camera_sees_is_learnt() -> None:
    localiser, truth = drive_with_slip(0.8, "visual")
    assert localiser.yaw_ratio == pytest.approx(0.8, abs=0.01)
    # Uncorrected it would be 0.2 * 3 rad and metres; what was driven before it was learnt counts too.
    assert abs(localiser.pose.heading_rad - truth.heading_rad) < 0.02
    assert math.hypot(localiser.pose.x_m - truth.x_m, localiser.pose.y_m - truth.y_m) < 0.08


def test_the_oldest_legs_are_settled_so_that_a_long_way_costs_no_more() -> None:
    localiser = Localiser(ORIGIN, MOUNT)
    odometry = ORIGIN
    for step in range(6000):
        localiser.add_odometry(step * 20 * MS, odometry)
        odometry = advance_pose(odometry, 1.5, 0.0, 0.04)
    localiser.add_ego_motion(5998 * 20 * MS, ego(0.0, 0.04))
    assert localiser.pose.x_m == pytest.approx(5999 * 0.06, abs=1e-6)
    assert len(localiser._legs) <= 2001


def test_a_camera_that_saw_nothing_teaches_nothing() -> None:
    localiser, _ = drive_with_slip(0.8, "odometry")
    assert localiser.yaw_ratio == 1.0


def test_the_prior_for_perception_is_dead_reckoning_not_the_fused_pose() -> None:
    localiser, _ = drive_with_slip(0.8, "visual")
    prior = localiser.camera_pose(500 * 20 * MS)
    assert prior is not None
    forward = prior.rotation @ np.array([0.0, 0.0, 1.0])
    assert math.atan2(forward[1], forward[0]) == pytest.approx(math.remainder(0.3 * 10.0, math.tau), abs=1e-6)


def test_an_ego_motion_that_is_not_known_spoils_nothing() -> None:
    """Once in the sums, one NaN would make every pose to come unknown."""
    localiser, _ = drive_with_slip(0.9, "visual")
    before = localiser.yaw_ratio
    for unknown in (ego(math.nan, 0.04), ego(0.01, math.nan), ego(0.01, math.inf)):
        localiser.add_ego_motion(5 * 20 * MS, unknown)
    assert localiser.yaw_ratio == before
    assert localiser.pose.finite
