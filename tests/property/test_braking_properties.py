"""The stopping model against ruckig, and against itself, on random states."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from ruckig import (  # type: ignore[import-not-found]  # a compiled module without stubs
    ControlInterface,
    InputParameter,
    Result,
    Ruckig,
    Trajectory,
)

from controller import braking
from controller.braking import BrakeLimits

speeds = st.floats(0.0, 5.0)
limit_pairs = st.builds(BrakeLimits, st.floats(0.1, 5.0), st.floats(0.1, 20.0))
shares = st.floats(-1.0, 1.0)


def ruckig_stop(v: float, a: float, limits: BrakeLimits) -> tuple[float, float]:
    problem = InputParameter(1)
    problem.control_interface = ControlInterface.Velocity
    problem.current_position, problem.current_velocity, problem.current_acceleration = [0.0], [v], [a]
    problem.target_velocity, problem.target_acceleration = [0.0], [0.0]
    problem.max_velocity = [100.0]
    problem.max_acceleration, problem.max_jerk = [limits.decel_mps2], [limits.jerk_mps3]
    trajectory = Trajectory(1)
    assert Ruckig(1).calculate(problem, trajectory) == Result.Working
    position, _, _ = trajectory.at_time(trajectory.duration)
    return float(position[0]), float(trajectory.duration)


@given(speeds, shares, limit_pairs)
def test_agrees_with_ruckig(v: float, share: float, limits: BrakeLimits) -> None:
    a = share * limits.decel_mps2
    assume(a >= 0 or v >= a * a / (2 * limits.jerk_mps3))
    distance, time = ruckig_stop(v, a, limits)
    ours = braking.stop(v, a, limits)
    assert ours.distance_m == pytest.approx(distance, abs=1e-7)
    assert ours.time_s == pytest.approx(time, abs=1e-7)


@given(speeds, st.floats(1.0, 3.0), st.booleans(), limit_pairs)
def test_agrees_with_ruckig_from_outside_the_limits(
    v: float, factor: float, accelerating: bool, limits: BrakeLimits
) -> None:
    a = math.copysign(factor * limits.decel_mps2, 1 if accelerating else -1)
    assume(accelerating or v >= a * a / (2 * limits.jerk_mps3))
    distance, time = ruckig_stop(v, a, limits)
    ours = braking.stop(v, a, limits)
    assert ours.distance_m == pytest.approx(distance, abs=1e-7)
    assert ours.time_s == pytest.approx(time, abs=1e-7)


@given(
    distance=st.floats(0.0, 30.0),
    share=st.floats(-1.5, 1.5),
    closing=st.floats(-1.0, 3.0),
    latency=st.floats(0.0, 1.0),
    margin=st.floats(0.0, 1.0),
    limits=limit_pairs,
)
@example(
    distance=0.0,
    share=-1.0439174505618068e-159,
    closing=1.0,
    latency=0.0,
    margin=1.3059287670137526e-240,
    limits=BrakeLimits(1.0, 1.0),
).via("next to no room and next to no acceleration: the root of a negative number")
def test_the_inverse_is_the_greatest_speed_that_fits(
    distance: float, share: float, closing: float, latency: float, margin: float, limits: BrakeLimits
) -> None:
    a = share * limits.decel_mps2
    speed = braking.speed_for_distance(
        distance, limits, latency_s=latency, closing_mps=closing, margin_m=margin, a_mps2=a
    )
    if speed == 0.0:
        needed = braking.required_distance(1e-6, a, closing, latency, limits, margin)
        assert needed >= distance - 1e-6
        return
    needed = braking.required_distance(speed, a, closing, latency, limits, margin)
    assert needed == pytest.approx(distance, abs=1e-6)
    assert braking.required_distance(speed + 1e-4, a, closing, latency, limits, margin) > distance


@given(speeds, st.floats(0.0, 5.0), limit_pairs)
def test_slowing_and_its_inverse(v: float, end: float, limits: BrakeLimits) -> None:
    assume(end <= v)
    distance = braking.slowing_distance(v, end, limits)
    assert braking.speed_before_section(distance, end, limits) == pytest.approx(v, abs=1e-4)


@given(speeds, st.floats(0.01, 2.0), shares, limit_pairs)
def test_a_faster_robot_needs_more_way_and_time_to_stop(
    v: float, more: float, share: float, limits: BrakeLimits
) -> None:
    a = share * limits.decel_mps2
    slow, fast = braking.stop(v, a, limits), braking.stop(v + more, a, limits)
    assert fast.distance_m > slow.distance_m
    assert fast.time_s > slow.time_s
