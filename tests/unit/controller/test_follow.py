"""The path follower in a closed loop with a base that lags and slips in yaw."""

from __future__ import annotations

import math

import pytest

from config.path import ArcSpec, LineSpec, PathSpec
from config.robot import Robot
from controller.follow import PathFollower
from controller.path.path import OnPath, Path
from hal.geometry import advance_pose
from hal.types import PlanarPose

STEP_S = 0.02
ROBOT = Robot()


def line(length_m: float) -> LineSpec:
    return LineSpec(kind="line", length_m=length_m)


def arc(radius_m: float, angle_deg: float, blend_m: float = 0.0) -> ArcSpec:
    return ArcSpec(kind="arc", radius_m=radius_m, angle_deg=angle_deg, blend_m=blend_m)


def hook(radius_m: float, blend_m: float = 0.0) -> Path:
    segments = (line(5.0), arc(radius_m, 90.0, blend_m), line(4.0), arc(radius_m, -90.0, blend_m), line(5.0))
    return Path(PathSpec(segments=segments), ROBOT)


def greatest_offset(
    path: Path,
    v_mps: float,
    slip: float = 1.0,
    lag_s: float = 0.1,
    start: PlanarPose | None = None,
    after_m: float = 0.0,
) -> float:
    """|d| of the true pose over a whole drive; the follower is given the true pose, one step old."""
    follower = PathFollower(path, ROBOT.limits, preview_s=lag_s)
    pose = start or path.start
    s = w = worst = 0.0
    while s < path.length_m - 0.05:
        on_path = path.project(pose, s)
        s = on_path.s_m
        speed = min(v_mps, path.speed_limit(s))
        wanted = follower.step(on_path, speed)
        assert abs(wanted) <= ROBOT.limits.max_yaw_rate_radps
        w += (wanted - w) * (1.0 - math.exp(-STEP_S / lag_s))
        pose = advance_pose(pose, speed, slip * w, STEP_S)
        if s >= after_m:
            worst = max(worst, abs(path.project(pose, s).d_m))
    return worst


@pytest.mark.parametrize("v_mps", [0.3, 1.0, 1.5])
@pytest.mark.parametrize("slip", [0.9, 1.0, 1.1])
@pytest.mark.parametrize("radius_m", [1.5, 2.0, 4.0])
def test_holds_the_path_under_yaw_slip(v_mps: float, slip: float, radius_m: float) -> None:
    assert greatest_offset(hook(radius_m), v_mps, slip) < 0.05


def test_holds_tight_blended_bends() -> None:
    assert greatest_offset(hook(1.0, blend_m=0.5), 1.5, 0.9) < 0.05


def test_comes_back_onto_the_path() -> None:
    path = Path(PathSpec(segments=(line(12.0),)), ROBOT)
    start = PlanarPose(0.0, 0.3, 0.2)
    assert greatest_offset(path, 1.0, start=start) > 0.3
    assert greatest_offset(path, 1.0, start=start, after_m=4.0) < 0.01


def test_correction_has_the_right_sign() -> None:
    follower = PathFollower(Path(PathSpec(segments=(line(12.0),)), ROBOT), ROBOT.limits)
    # n = 2 per metre: k_d = 4, k_psi = 4.
    assert follower.step(OnPath(2.0, 0.1, 0.0), 0.5) == pytest.approx(-0.5 * 0.4)
    assert follower.step(OnPath(2.0, -0.1, 0.0), 0.5) == pytest.approx(0.5 * 0.4)
    assert follower.step(OnPath(2.0, 0.0, 0.1), 0.5) == pytest.approx(-0.5 * 4.0 * math.sin(0.1))


def test_on_the_path_of_a_bend_it_turns_with_it() -> None:
    follower = PathFollower(Path(PathSpec(segments=(arc(2.0, -90.0),)), ROBOT), ROBOT.limits)
    assert follower.step(OnPath(1.0, 0.0, 0.0), 1.0) == pytest.approx(-0.5)


def test_beside_a_bend_it_turns_as_the_bend_through_the_robot_does() -> None:
    """5 cm inside a bend of 2 m the radius is 1.95 m, outside 2.05 m; the rest is as on a line."""

    def difference(path: Path, s_m: float) -> float:
        follower = PathFollower(path, ROBOT.limits)
        inside, outside = (follower.step(OnPath(s_m, d_m, 0.0), 0.4) for d_m in (0.05, -0.05))
        return inside - outside

    bend = Path(PathSpec(segments=(arc(2.0, 90.0),)), ROBOT)
    straight = Path(PathSpec(segments=(line(6.0),)), ROBOT)
    assert difference(bend, 1.5) - difference(straight, 1.5) == pytest.approx(0.4 / 1.95 - 0.4 / 2.05)


@pytest.mark.parametrize("v_mps", [0.0, -0.5, math.nan])
def test_no_yaw_without_speed(v_mps: float) -> None:
    follower = PathFollower(hook(2.0), ROBOT.limits)
    assert follower.step(OnPath(2.0, 0.4, 0.4), v_mps) == 0.0


def test_unknown_pose_means_straight_on() -> None:
    follower = PathFollower(hook(2.0), ROBOT.limits)
    assert follower.step(OnPath(2.0, math.nan, 0.0), 1.0) == 0.0
    assert follower.step(OnPath(2.0, 0.0, math.inf), 1.0) == 0.0


def test_yaw_rate_stays_within_its_limit_far_from_the_path() -> None:
    follower = PathFollower(hook(2.0), ROBOT.limits)
    assert follower.step(OnPath(2.0, 3.0, 1.5), 1.5) == -ROBOT.limits.max_yaw_rate_radps
    assert follower.step(OnPath(2.0, -3.0, -1.5), 1.5) == ROBOT.limits.max_yaw_rate_radps
