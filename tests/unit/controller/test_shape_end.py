"""The shaper: closing in on the target point, behind whatever chassis."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from config.robot import Limits
from controller import braking
from controller.shape import SpeedShaper
from tests.support.shaper_run import PERIOD_S, Run


@pytest.mark.parametrize("length_m", [0.05, 0.3, 1.0, 3.0, 8.25, 30.0])
def test_stops_on_the_target_point(length_m: float) -> None:
    run = Run(length_m)
    run.until_rest()
    assert run.x_m == pytest.approx(length_m, abs=0.005)


@pytest.mark.parametrize(("lag_s", "delay_s"), [(0.1, 0.2), (0.15, 0.0), (0.2, 0.2), (0.2, 0.1), (0.3, 0.2)])
@pytest.mark.parametrize("gain", [0.97, 1.0, 1.03])
def test_stops_on_the_target_point_behind_a_lagging_chassis(
    lag_s: float, delay_s: float, gain: float
) -> None:
    run = Run(20.0, lag_s, delay_s, gain)
    run.until_rest()
    assert run.x_m == pytest.approx(20.0, abs=0.012)


def test_a_wrong_guess_of_the_lag_costs_no_time() -> None:
    known, unknown = Run(20.0, 0.1, 0.1), Run(20.0, 0.1, 0.3)
    known.until_rest()
    unknown.until_rest()
    assert unknown.time_s <= known.time_s + 0.1


def test_the_closing_loses_little_time_and_does_not_creep() -> None:
    run = Run(30.0)
    run.until_rest()
    stop = braking.stop(1.5, 0.0, braking.comfort(Limits()))
    optimum_s = 2 * stop.time_s + (30.0 - 2 * stop.distance_m) / 1.5
    assert run.time_s <= 1.01 * optimum_s
    creeping = [c for c in run.commands[100:] if 0.0 < c.v_mps < 0.05]
    assert len(creeping) * PERIOD_S < 1.0


def test_the_closing_brakes_once() -> None:
    """No flapping: the speed rises, stays, falls."""
    run = Run(20.0, lag_s=0.15, delay_s=0.2)
    run.until_rest()
    signs = [math.copysign(1.0, c.a_mps2) for c in run.commands if abs(c.a_mps2) > 0.01]
    assert sum(before != after for before, after in pairwise(signs)) == 1


@pytest.mark.parametrize("jerk_mps3", [0.2, 0.6, 3.0])
@pytest.mark.parametrize("length_m", [0.1, 0.3, 2.0, 9.0])
def test_behind_a_chassis_that_obeys_at_once_the_end_is_met_exactly(
    length_m: float, jerk_mps3: float
) -> None:
    """The position interface aims at the point itself; a plain stop would be a tenth of a millimetre off."""
    run = Run(length_m)
    run.shaper = SpeedShaper(Limits(max_jerk_mps3=jerk_mps3, emergency_jerk_mps3=3.0), PERIOD_S)
    run.until_rest()
    assert run.x_m == pytest.approx(length_m, abs=2e-5)


@pytest.mark.parametrize("seed", range(4))
def test_odometry_that_shakes_by_a_centimetre_does_not_shake_the_closing(seed: int) -> None:
    run, random = Run(12.0, lag_s=0.1, delay_s=0.1), np.random.default_rng(seed)
    while run.time_s < 1.0 or run.commands[-1].v_mps > 0.0:
        run.length_m = 12.0 + 0.01 * float(random.standard_normal())
        run.step()
    signs = [math.copysign(1.0, c.a_mps2) for c in run.commands if abs(c.a_mps2) > 0.01]
    assert sum(before != after for before, after in pairwise(signs)) == 1
    assert run.x_m == pytest.approx(12.0, abs=0.01)


@pytest.mark.parametrize("pushed_m", [-0.2, 0.2])
def test_being_pushed_while_not_armed_is_not_taken_for_lag(pushed_m: float) -> None:
    run = Run(20.0, lag_s=0.2, delay_s=0.2)
    while run.x_m < 8.0:
        run.step()
    while run.shaper.v_mps > 0.0 or run.v_mps > 1e-4:
        run.step(0.0)
    run.shaper.reset()
    run.x_m += pushed_m
    run.until_rest()
    assert run.x_m == pytest.approx(20.0, abs=0.005)


def test_a_target_behind_is_not_chased_in_reverse() -> None:
    run = Run(5.0)
    for _ in range(150):
        run.step()
    run.length_m = run.x_m - 1.0
    passed = braking.stop(run.v_mps, run.commands[-1].a_mps2, braking.comfort(Limits()))
    at = run.x_m
    run.until_rest()
    assert run.x_m == pytest.approx(at + passed.distance_m, abs=0.01)
    assert {command.fault for command in run.commands} == {""}
