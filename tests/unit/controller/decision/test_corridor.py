"""The swept corridor and where bodies stand in it, by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.robot import Body
from controller.decision.corridor import Corridor, path_velocities, place
from tests.support.floor_bodies import arc_path, box, line_path

BODY = Body(width_m=0.8, length_m=1.0, rear_m=0.5)


def test_on_a_straight_path_the_body_sweeps_its_width() -> None:
    corridor = Corridor(line_path(), BODY)
    assert corridor.half_width(np.array([0.0, 7.3, 20.0])).tolist() == pytest.approx([0.4, 0.4, 0.4])


def test_on_a_bend_the_outer_front_corner_sweeps_further() -> None:
    corridor = Corridor(arc_path(3.0, 90.0), BODY)
    expected = math.hypot(3.4, 0.5) - 3.0
    assert corridor.half_width(np.array([2.0]))[0] == pytest.approx(expected)
    # The front is in the bend before the turning centre is.
    assert corridor.half_width(np.array([-0.3]))[0] == pytest.approx(expected)


def test_before_and_behind_the_path_it_is_as_wide_as_at_its_ends() -> None:
    corridor = Corridor(arc_path(3.0, 90.0), BODY)
    places = [-50.0, -0.5, -0.44, 1.23, 4.0, 500.0]
    widths = corridor.half_width(np.array(places))
    assert (widths[0], widths[-1]) == (widths[1], 0.4)
    assert [corridor.half_width_at(s_m) for s_m in places] == widths.tolist()
    # Where nobody knows the place, it has some width.
    assert corridor.half_width_at(math.nan) == widths[0]


def test_points_are_located_with_the_swept_width_where_they_are() -> None:
    """One beside the middle of a quarter turn, and one that is searched for no farther than to 1.0 m."""
    corridor = Corridor(arc_path(4.0, 90.0), BODY)
    middle = 4.0 * math.sin(math.pi / 4.0)
    points = np.array([[middle - 0.5 * math.sqrt(0.5), 4.0 - middle + 0.5 * math.sqrt(0.5)]])
    s_m, d_m, half_width_m = corridor.locate(points, 0.0, 6.0)[:, 0]
    assert (s_m, d_m) == (pytest.approx(math.pi), pytest.approx(0.5))
    assert half_width_m == corridor.half_width_at(math.pi)
    assert corridor.locate(points, 0.0, 1.0)[0, 0] == 1.0


def test_a_standing_body_blocks_the_robot_from_front_to_tail() -> None:
    corridor = Corridor(line_path(), BODY)
    placed = place(box(8.0, 0.9), corridor, np.array([0.0, 4.0]), 0.0, 12.0)
    assert placed.s_m.tolist() == [pytest.approx([8.0, 8.0])]
    assert placed.d_m[0, 0] == pytest.approx(0.9)
    assert placed.block_from_s_m[0, 0] == pytest.approx(8.0 - 0.2 - 0.5)
    assert placed.block_to_s_m[0, 0] == pytest.approx(8.0 + 0.2 + 0.5)
    assert placed.clearance_m[0, 0] == pytest.approx(0.9 - 0.25 - 0.4)


def test_a_moving_body_is_followed_in_time() -> None:
    corridor = Corridor(line_path(), BODY)
    placed = place(box(8.0, 2.0, -0.5, -1.0), corridor, np.array([0.0, 1.0, 2.0]), 0.0, 12.0)
    assert placed.s_m[0].tolist() == pytest.approx([8.0, 7.5, 7.0])
    assert placed.d_m[0].tolist() == pytest.approx([2.0, 1.0, 0.0])


def test_a_body_beside_a_bend_is_turned_against_the_path() -> None:
    """Seen along x, at the end of a quarter turn: what was its depth lies across the path there."""
    corridor = Corridor(arc_path(4.0, 90.0), BODY)
    placed = place(box(4.0, 4.0, half_view_m=0.1, half_across_m=0.6), corridor, np.zeros(1), 3.0, 12.0)
    assert placed.s_m[0, 0] == pytest.approx(2.0 * math.pi)
    assert placed.half_s_m[0, 0] == pytest.approx(0.6, abs=1e-6)
    assert placed.clearance_m[0, 0] == pytest.approx(-0.1 - corridor.half_width(placed.s_m[0])[0], abs=1e-6)


def test_velocity_along_and_across_the_path() -> None:
    corridor = Corridor(arc_path(4.0, 90.0), BODY)
    body = box(4.0, 4.0, -0.3, -1.0, sigma_mps=0.2)
    # At the end of the quarter turn the path leads to +y; its left is -x.
    heading = place(body, corridor, np.zeros(1), 3.0, 12.0).heading_rad[:, 0]
    velocities = path_velocities(body, heading)
    assert (velocities.along_mps[0], velocities.left_mps[0]) == pytest.approx((-1.0, 0.3), abs=1e-6)
    assert (velocities.sigma_along_mps[0], velocities.sigma_left_mps[0]) == pytest.approx((0.2, 0.2))
