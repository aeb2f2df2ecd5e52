from __future__ import annotations

import math

import numpy as np
import pytest

from config.scenario import Go, MotionPlan, Wait
from hal.types import PlanarPose
from sim.motion import Trajectory

ORIGIN = PlanarPose(0.0, 0.0, 0.0)


def go(x_m: float, y_m: float, speed_mps: float = 1.0) -> Go:
    return Go(kind="go", x_m=x_m, y_m=y_m, speed_mps=speed_mps)


def motion(*steps: Go | Wait, start_s: float = 0.0, accel: float = 1.0, turn: float = 90.0) -> MotionPlan:
    return MotionPlan(start_s=start_s, accel_mps2=accel, turn_rate_degps=turn, steps=steps)


def test_a_body_without_a_plan_stands_where_it_was_put() -> None:
    state = Trajectory(PlanarPose(1.0, -2.0, 0.5), None).at(123.0)
    assert (state.x_m, state.y_m, state.heading_rad) == (1.0, -2.0, 0.5)
    assert state.speed_mps == 0.0


def test_trapezium_by_hand() -> None:
    # 4 m at 1 m/s with 1 m/s2: 1 s up (0.5 m), 3 s even, 1 s down.
    trajectory = Trajectory(ORIGIN, motion(go(4.0, 0.0), start_s=2.0))
    assert trajectory.at(1.9).x_m == 0.0
    assert trajectory.at(2.5).x_m == pytest.approx(0.125)
    assert trajectory.at(2.5).vx_mps == pytest.approx(0.5)
    assert trajectory.at(4.0).x_m == pytest.approx(1.5)
    assert trajectory.at(6.5).x_m == pytest.approx(4.0 - 0.125)
    assert trajectory.at(7.5).x_m == pytest.approx(4.0)
    assert trajectory.end_s == pytest.approx(7.0)


def test_a_way_too_short_for_the_cruise_speed_peaks_below_it() -> None:
    # 1 m with 1 m/s2: peak sqrt(1) = 1 m/s in the middle, after 1 s.
    trajectory = Trajectory(ORIGIN, motion(go(0.0, 1.0, speed_mps=3.0)))
    after_the_turn_s = 1.0  # 90 degrees at 90 degrees per second
    assert trajectory.at(after_the_turn_s + 1.0).vy_mps == pytest.approx(1.0)
    assert trajectory.at(after_the_turn_s + 1.0).y_m == pytest.approx(0.5)


def test_wait_lasts_as_long_as_it_says() -> None:
    plan = motion(go(1.0, 0.0), Wait(kind="wait", duration_s=5.0), go(2.0, 0.0))
    trajectory = Trajectory(ORIGIN, plan)
    assert trajectory.at(2.0).x_m == pytest.approx(1.0)
    assert trajectory.at(6.9).speed_mps == 0.0
    assert trajectory.at(7.5).vx_mps == pytest.approx(0.5)


def test_turning_back_stops_turns_on_the_spot_and_returns() -> None:
    trajectory = Trajectory(ORIGIN, motion(go(1.0, 0.0), go(0.0, 0.0)))
    half_turn = trajectory.at(2.0 + 1.0)
    assert half_turn.speed_mps == 0.0
    assert abs(half_turn.heading_rad) == pytest.approx(math.pi / 2)
    assert abs(half_turn.yaw_rate_radps) == pytest.approx(math.pi / 2)
    assert trajectory.at(4.0 + 1.0).vx_mps == pytest.approx(-1.0)
    assert trajectory.at(20.0).x_m == pytest.approx(0.0)


def test_a_gentle_corner_is_passed_without_stopping() -> None:
    trajectory = Trajectory(ORIGIN, motion(go(3.0, 0.0), go(6.0, 1.5)))
    speeds = [trajectory.at(1.0 + 0.05 * k).speed_mps for k in range(90)]
    assert min(speeds) == pytest.approx(1.0)


def test_speed_falls_before_a_slower_leg() -> None:
    trajectory = Trajectory(ORIGIN, motion(go(4.0, 0.0, 1.0), go(8.0, 0.0, 0.5)))
    # At the corner it has slowed to the slower leg's speed: 1 s up, then 3.125 m even, 0.5 s down.
    at_corner = trajectory.at(1.0 + (4.0 - 0.5 - 0.375) / 1.0 + 0.5)
    assert at_corner.x_m == pytest.approx(4.0)
    assert at_corner.vx_mps == pytest.approx(0.5)


def test_a_shift_moves_the_whole_plan_in_time() -> None:
    plan = motion(go(4.0, 1.0), start_s=2.0)
    late, usual = Trajectory(ORIGIN, plan, shift_s=0.7), Trajectory(ORIGIN, plan)
    assert late.at(5.7).x_m == pytest.approx(usual.at(5.0).x_m)


@pytest.mark.parametrize("corner_y", [0.4, 1.2, 3.0, -2.0])
def test_velocity_and_heading_are_derivatives(corner_y: float) -> None:
    trajectory = Trajectory(
        ORIGIN, motion(go(3.0, 0.0), go(5.0, corner_y), Wait(kind="wait", duration_s=0.5), go(6.0, 0.0))
    )
    h = 1e-5
    for k in range(240):
        t_s = 0.0503 * k + 0.013
        before, now, after = (trajectory.at(t_s + d) for d in (-h, 0.0, h))
        assert (after.x_m - before.x_m) / (2 * h) == pytest.approx(now.vx_mps, abs=1e-3)
        assert (after.y_m - before.y_m) / (2 * h) == pytest.approx(now.vy_mps, abs=1e-3)
        assert (after.distance_m - before.distance_m) / (2 * h) == pytest.approx(now.speed_mps, abs=1e-3)
        # A heading may wrap, but it never jumps.
        turn = math.remainder(after.heading_rad - before.heading_rad, 2 * math.pi)
        assert abs(turn) < 2 * h * 10.0


@pytest.mark.parametrize("corner_y", [0.4, 3.0])
def test_states_over_times_equal_the_state_at_each_time(corner_y: float) -> None:
    steps = go(3.0, 0.0), go(5.0, corner_y), Wait(kind="wait", duration_s=0.5), go(6.0, 0.0)
    trajectory = Trajectory(PlanarPose(0.5, -1.0, 2.0), motion(*steps, start_s=0.4))
    times = np.append(np.arange(-0.5, trajectory.end_s + 1.0, 0.037), trajectory.end_s)
    states = [trajectory.at(t_s) for t_s in times.tolist()]
    # Missions are repeated bit for bit, so this is no approximation.
    assert trajectory.sample(times).tolist() == [
        [one.x_m, one.y_m, one.heading_rad, one.vx_mps, one.vy_mps] for one in states
    ]


def test_states_over_times_of_a_standing_body() -> None:
    states = Trajectory(PlanarPose(1.0, -2.0, 0.5), None).sample(np.array([-3.0, 0.0, 99.0]))
    assert states.tolist() == [[1.0, -2.0, 0.5, 0.0, 0.0]] * 3
