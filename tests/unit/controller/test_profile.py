"""Ramps in arrays against ruckig and the stopping model."""

from __future__ import annotations

import numpy as np
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
from controller.profile import SpeedRamps, stop_step

LIMITS = BrakeLimits(0.3, 0.6)


def ramps(v: float, a: float, targets: list[float], latency_s: float = 0.0) -> SpeedRamps:
    limits = BrakeLimits(0.7, 0.6)
    return SpeedRamps(v, a, np.array(targets), limits, accel_mps2=0.3, latency_s=latency_s)


@given(st.floats(0.0, 1.5), st.floats(-0.7, 0.3), st.floats(0.0, 1.5), st.floats(0.0, 12.0))
def test_the_ramps_are_those_of_ruckig(v: float, a: float, target: float, t: float) -> None:
    problem = InputParameter(1)
    problem.control_interface = ControlInterface.Velocity
    problem.current_position, problem.current_velocity, problem.current_acceleration = [0.0], [v], [a]
    problem.target_velocity, problem.target_acceleration = [target], [0.0]
    problem.max_velocity, problem.max_acceleration = [10.0], [0.3]
    problem.min_acceleration, problem.max_jerk = [-0.7], [0.6]
    trajectory = Trajectory(1)
    assert Ruckig(1).calculate(problem, trajectory) == Result.Working
    ours = ramps(v, a, [target])
    assume(v >= a * a / 1.2 or a >= 0)  # ruckig would reverse
    assert ours.duration_s[0] == pytest.approx(trajectory.duration, abs=1e-6)
    t = min(t, trajectory.duration)
    position, velocity, acceleration = trajectory.at_time(t)
    distance, speed, accelerating = ours.state(np.array([[t]]))
    assert distance[0, 0] == pytest.approx(position[0], abs=1e-6)
    assert speed[0, 0] == pytest.approx(velocity[0], abs=1e-6)
    if t < trajectory.duration:
        assert accelerating[0, 0] == pytest.approx(acceleration[0], abs=1e-5)


def test_the_same_times_do_for_all_ramps() -> None:
    some, times = ramps(0.8, 0.1, [0.0, 0.4, 1.2]), np.linspace(0.0, 6.0, 7)
    once, each = some.state(times[None, :]), some.state(np.tile(times, (3, 1)))
    for alone, spelt_out in zip(once, each, strict=True):
        assert alone.tolist() == spelt_out.tolist()
    assert some.distance(times[None, :]).tolist() == each[0].tolist()


def test_goes_on_at_the_target_speed() -> None:
    distance, speed, acceleration = ramps(1.0, 0.0, [1.0, 0.0]).state(np.full((2, 1), 20.0))
    assert distance[0, 0] == pytest.approx(20.0)
    assert distance[1, 0] == pytest.approx(braking.stop(1.0, 0.0, BrakeLimits(0.7, 0.6)).distance_m)
    assert speed[:, 0].tolist() == pytest.approx([1.0, 0.0])
    assert acceleration[:, 0].tolist() == pytest.approx([0.0, 0.0])


def test_holds_the_speed_for_the_latency() -> None:
    late = ramps(1.0, 0.0, [0.0], latency_s=0.5)
    prompt = ramps(1.0, 0.0, [0.0])
    assert late.duration_s[0] == pytest.approx(prompt.duration_s[0] + 0.5)
    assert late.distance(np.array([[0.4]]))[0, 0] == pytest.approx(0.4)
    at = np.array([[1.7]])
    assert late.distance(at)[0, 0] == pytest.approx(0.5 + prompt.distance(at - 0.5)[0, 0])


def test_each_ramp_may_start_from_its_own_speed() -> None:
    both = SpeedRamps(np.array([0.5, 1.5]), 0.0, np.zeros(2), LIMITS)
    stops = [braking.stop(v, 0.0, LIMITS) for v in (0.5, 1.5)]
    assert both.duration_s.tolist() == pytest.approx([stop.time_s for stop in stops])
    at_end = both.distance(both.duration_s[:, None])[:, 0]
    assert at_end.tolist() == pytest.approx([stop.distance_m for stop in stops])


@given(st.floats(0.0, 2.0), st.floats(-0.8, 0.8))
@example(0.4953454590745455, -0.77063679941108)
def test_stop_steps_add_up_to_the_stop(v: float, a: float) -> None:
    """Where the deceleration just fades before the robot stands, a step more or less of it decides how long
    the last millimetres take. So the time is that of a stop from the same speed, give or take a step."""
    model, step_mps = braking.stop(v, a, LIMITS), abs(a) * 0.01
    times_s = [braking.stop(max(v + off, 0.0), a, LIMITS).time_s for off in (-step_mps, 0.0, step_mps)]
    travelled = time = 0.0
    while v > 0.0 or abs(a) > 1e-9:
        before = v
        v, a = stop_step(v, a, LIMITS, 0.01)
        assert v >= 0.0
        travelled += 0.5 * (before + v) * 0.01
        time += 0.01
        assert time < 60.0
    assert travelled == pytest.approx(model.distance_m, abs=2e-3)
    assert min(times_s) - 0.05 <= time <= max(times_s) + 0.05
