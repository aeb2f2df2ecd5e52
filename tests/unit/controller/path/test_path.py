"""Path geometry against hand-computed points, and the refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.loader import ConfigError
from config.path import ArcSpec, LineSpec, PathSpec, StartSpec
from config.robot import Body, Limits, Robot
from controller.path.path import Path, PathError
from hal.types import PlanarPose

ROBOT = Robot()


def line(length_m: float, max_speed_mps: float | None = None) -> LineSpec:
    return LineSpec(kind="line", length_m=length_m, max_speed_mps=max_speed_mps)


def arc(radius_m: float, angle_deg: float, blend_m: float = 0.0) -> ArcSpec:
    return ArcSpec(kind="arc", radius_m=radius_m, angle_deg=angle_deg, blend_m=blend_m)


def path(*segments: LineSpec | ArcSpec, start: StartSpec | None = None, robot: Robot = ROBOT) -> Path:
    return Path(PathSpec(start=start or StartSpec(), segments=segments), robot)


HOOK = path(line(4.0), arc(2.0, 90.0), line(3.0), arc(2.0, -90.0), line(5.0))


def near(pose: PlanarPose, x: float, y: float, heading: float) -> None:
    assert (pose.x_m, pose.y_m, pose.heading_rad) == pytest.approx((x, y, heading), abs=1e-9)


def test_poses_along_lines_and_arcs() -> None:
    quarter = math.pi  # a quarter of a circle of 2 m
    assert HOOK.length_m == pytest.approx(4 + quarter + 3 + quarter + 5)
    near(HOOK.start, 0, 0, 0)
    near(HOOK.pose(2.5), 2.5, 0, 0)
    near(HOOK.pose(4 + quarter / 2), 4 + math.sqrt(2), 2 - math.sqrt(2), math.pi / 4)
    near(HOOK.pose(4 + quarter), 6, 2, math.pi / 2)
    near(HOOK.pose(4 + quarter + 3), 6, 5, math.pi / 2)
    near(HOOK.pose(HOOK.length_m), 13, 7, 0)
    near(HOOK.pose(HOOK.length_m + 1.5), 14.5, 7, 0)
    near(HOOK.pose(-1.0), -1, 0, 0)


def test_curvature_has_the_sign_of_the_turn() -> None:
    assert HOOK.curvature(1.0) == 0.0
    assert HOOK.curvature(5.0) == pytest.approx(0.5)
    assert HOOK.curvature(4 + math.pi + 3 + 1) == pytest.approx(-0.5)
    assert HOOK.curvatures(np.array([1.0, 5.0])).tolist() == pytest.approx([0.0, 0.5])


def test_start_pose_moves_the_whole_path() -> None:
    moved = path(line(2.0), arc(1.0, -90.0), start=StartSpec(x_m=1.0, y_m=2.0, heading_deg=90.0))
    near(moved.pose(2.0), 1, 4, math.pi / 2)
    near(moved.pose(moved.length_m), 2, 5, 0)


def test_a_blend_keeps_the_angle_and_bends_gradually() -> None:
    blended = path(line(1.0), arc(2.0, 90.0, blend_m=1.0), line(1.0))
    assert blended.length_m == pytest.approx(1 + math.pi + 1 + 1)
    assert blended.pose(blended.length_m).heading_rad == pytest.approx(math.pi / 2)
    curvatures = [blended.curvature(s) for s in (1.05, 1.5, 1.95, 2.5)]
    assert curvatures == sorted(curvatures)
    assert curvatures[1] == pytest.approx(0.25, abs=0.02)
    assert curvatures[3] == pytest.approx(0.5)


def test_a_full_circle_closes() -> None:
    ring = path(arc(3.0, 360.0))
    near(ring.pose(ring.length_m), 0, 0, 0)
    s, d = ring.project_points(np.array([[0.0, 6.5]]), 5.0, 15.0)
    assert (s[0], d[0]) == pytest.approx((3 * math.pi, -0.5))


def test_points_beside_lines_and_arcs() -> None:
    points = np.array(
        [
            [2.0, 0.7],  # left of the first line
            [2.0, -0.7],
            [4.0, 1.5],  # inside the left turn, at its beginning: centre is (4, 2)
            [4 + 2.5 / math.sqrt(2), 2 - 2.5 / math.sqrt(2)],  # outside it, half way
            [8.0, 5.4],  # outside of nothing: centre of the right turn is (8, 5), half way is left
        ]
    )
    s, d = HOOK.project_points(points)
    assert s[:4].tolist() == pytest.approx([2.0, 2.0, 4.0, 4 + math.pi / 2])
    assert d[:4].tolist() == pytest.approx([0.7, -0.7, 1.5, -0.5])
    assert d[4] == pytest.approx(-1.6)


def test_moving_point_is_located_like_a_point_at_its_later_place() -> None:
    """Along the first line alone, and where bends are looked at."""
    points, velocity = np.array([[2.0, 0.7], [4.0, 1.2]]), np.array([[0.2, 0.3], [0.5, -0.4]])
    times = np.array([0.0, 0.5, 2.0])
    for to_s_m in (3.5, 9.0):
        s, d, heading = HOOK.projection.locate(points, velocity, times, 0.0, to_s_m)
        assert s.shape == d.shape == heading.shape == (2, 3)
        for k, t_s in enumerate(times.tolist()):
            expected = HOOK.project_points(points + t_s * velocity, 0.0, to_s_m)
            assert (s[:, k].tolist(), d[:, k].tolist()) == (expected[0].tolist(), expected[1].tolist())
        assert heading[0, 0] == 0.0


@pytest.mark.parametrize("to_s_m", [3.5, 9.0])
def test_nan_point_has_no_place_along_the_path(to_s_m: float) -> None:
    s, d = HOOK.project_points(np.array([[math.nan, 1.0], [1.0, 1.0]]), 0.0, to_s_m)
    assert math.isnan(d[0])
    assert (s[1], d[1]) == pytest.approx((1.0, 1.0))


def test_points_beyond_the_end_are_measured_straight_on() -> None:
    s, d = HOOK.project_points(np.array([[14.0, 7.25], [-0.5, 0.0]]))
    assert s.tolist() == pytest.approx([HOOK.length_m + 1.0, -0.5])
    assert d.tolist() == pytest.approx([0.25, 0.0])


def test_a_pose_in_path_coordinates() -> None:
    on = HOOK.project(PlanarPose(6.1, 3.0, math.pi / 2 + 0.1), hint_s_m=8.0)
    assert (on.s_m, on.d_m, on.heading_rad) == pytest.approx((4 + math.pi + 1, -0.1, 0.1))


def test_projection_does_not_jump_to_another_turn_of_the_path() -> None:
    """A figure that crosses itself: the same point lies at two places; the hint says which."""
    loop = path(line(6.0), arc(2.0, 270.0), line(6.0))
    crossing = PlanarPose(4.0 + 2.0 - 2.0, 0.0, 0.0)
    first = loop.project(crossing, hint_s_m=3.8)
    assert first.s_m == pytest.approx(4.0)
    second = loop.project(PlanarPose(4.0, 0.0, -math.pi / 2), hint_s_m=6 + 3 * math.pi + 1.9)
    assert second.s_m == pytest.approx(6 + 3 * math.pi + 2.0)


def test_projection_stays_within_its_window() -> None:
    assert HOOK.project(PlanarPose(0.0, 0.0, 0.0), hint_s_m=3.0).s_m == pytest.approx(2.75)
    assert HOOK.project(PlanarPose(6.0, 4.5, 1.5), hint_s_m=3.0).s_m <= 5.0


def test_sections_and_bends_limit_the_speed_ahead_of_them() -> None:
    slow = path(line(10.0), line(3.0, max_speed_mps=0.5), line(10.0))
    assert slow.speed_limit(11.0) == pytest.approx(0.5)
    assert slow.speed_limit(10.0) == pytest.approx(0.5)
    assert slow.speed_limit(13.2) == pytest.approx(1.5)
    # Slowing from 1.5 to 0.5 takes 1 / 0.3 + 0.5 s at 1 m/s: 3.83 m (one 5 cm step of the table early).
    assert slow.speed_limit(10.0 - 3.84 - 0.1) == pytest.approx(1.5)
    assert slow.speed_limit(10.0 - 3.70) < 1.5
    assert slow.speed_limit(8.0) == pytest.approx(1.08, abs=0.02)


def test_bends_limit_the_speed_by_the_yaw_rate() -> None:
    bend = path(line(10.0), arc(1.0, 90.0), line(5.0))
    assert bend.speed_limit(10.5) == pytest.approx(0.8 * 0.8)
    assert bend.speed_limit(2.0) == pytest.approx(1.5)
    assert path(line(5.0), arc(2.0, 90.0)).speed_limit(6.0) == pytest.approx(0.8 * 0.8 * 2.0)


def test_a_section_cannot_allow_more_than_the_robot() -> None:
    assert path(line(5.0, max_speed_mps=5.0)).speed_limit(2.0) == pytest.approx(1.5)


def test_too_tight_bends_are_refused() -> None:
    with pytest.raises(PathError, match=r"segments\.1: radius_m 0\.2 is tighter .* at least 0\.39 m"):
        path(line(1.0), arc(0.2, 90.0))
    lazy = Robot(limits=Limits(max_yaw_rate_radps=0.1))
    with pytest.raises(PathError, match=r"at least 1\.25 m"):
        path(arc(1.0, 90.0), robot=lazy)


def test_a_path_that_doubles_back_is_refused() -> None:
    with pytest.raises(PathError, match="doubles back on itself"):
        path(line(10.0), arc(0.5, 180.0), arc(3.0, 20.0), line(10.0), robot=Robot(body=Body(width_m=0.9)))
    with pytest.raises(ConfigError, match="doubles back"):
        path(line(5.0), arc(1.0, 225.0), line(8.0), arc(1.0, 135.0), line(1.0), arc(1.0, 180.0), line(6.0))


def test_wide_turns_and_crossings_are_accepted() -> None:
    turn = path(line(5.0), arc(0.5, 180.0), line(5.0))
    crossing = path(line(6.0), arc(2.0, 270.0), line(6.0))
    assert turn.length_m == pytest.approx(10.0 + 0.5 * math.pi, rel=0.2)  # blends lengthen the bend
    assert crossing.length_m == pytest.approx(12.0 + 3.0 * math.pi, rel=0.2)


@pytest.mark.parametrize(
    ("segments", "reason"),
    [
        ([], "at least one"),
        ([{"kind": "line", "length_m": 0.0}], "greater than 0"),
        ([{"kind": "line", "length_m": -1.0}], "greater than 0"),
        ([{"kind": "arc", "radius_m": 0.0, "angle_deg": 90}], "greater than 0"),
        ([{"kind": "arc", "radius_m": 1.0, "angle_deg": 0}], "must not be zero"),
        ([{"kind": "arc", "radius_m": 1.0, "angle_deg": 90, "blend_m": 2.0}], "blend_m must not exceed"),
        ([{"kind": "spiral", "length_m": 1.0}], "spiral"),
        ([{"kind": "line", "length_m": 1.0, "speed": 1.0}], "Extra inputs"),
    ],
)
def test_impossible_segments_are_refused(segments: list[object], reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        PathSpec.model_validate({"segments": segments})


@given(st.floats(0.0, HOOK.length_m), st.floats(-1.2, 1.2))
def test_a_point_beside_the_path_is_found_again(s: float, d: float) -> None:
    pose = HOOK.pose(s)
    point = np.array([[pose.x_m - d * math.sin(pose.heading_rad), pose.y_m + d * math.cos(pose.heading_rad)]])
    found_s, found_d = HOOK.project_points(point, s - 0.5, s + 0.5)
    assert found_s[0] == pytest.approx(s, abs=1e-6)
    assert found_d[0] == pytest.approx(d, abs=1e-6)


def test_nowhere_on_the_path_there_is_no_speed() -> None:
    with pytest.raises(ValueError, match="is not known"):
        HOOK.speed_limit(math.nan)


def test_the_path_ahead_is_told_in_the_body_frame() -> None:
    straight = path(line(20.0))
    points = straight.ahead(5.0, PlanarPose(5.0, 0.2, 0.0))
    assert points[0] == pytest.approx([0.0, -0.2])
    assert points[-1] == pytest.approx([12.0, -0.2])
    near_end = straight.ahead(19.0, PlanarPose(19.0, 0.0, 0.0))
    assert near_end[-1] == pytest.approx([1.0, 0.0])


def test_a_bend_ahead_bends_to_its_side() -> None:
    points = path(arc(5.0, 90.0)).ahead(0.0, PlanarPose(0.0, 0.0, 0.0))
    assert points[-1] == pytest.approx([5.0, 5.0], abs=1e-6)
    assert np.all(np.diff(points[:, 1]) >= 0.0)
