from __future__ import annotations

import math

import numpy as np
import pytest

from controller.campaign import oracle
from controller.campaign.oracle import Lattice, free_time_s
from tests.support.campaign import crate, mover, stage

TOP, ACCEL, JERK = 1.2, 0.3, 0.6


def test_an_empty_path_takes_the_s_curve_time() -> None:
    """L / v + v / A + A / J = 10 / 1.2 + 4 + 0.5 s."""
    best = oracle.solve(stage(length_m=10.0), TOP, 60.0)
    assert best.total_s == pytest.approx(10.0 / 1.2 + 1.2 / 0.3 + 0.3 / 0.6, abs=1e-3)
    assert best.delay_s == 0.0


def test_a_short_path_never_reaches_the_top_speed() -> None:
    """A triangle: peak sqrt(A L) = 0.3 m/s for 0.3 m, 2 s, and the jerk adds A / J."""
    s = np.linspace(0.0, 0.3, 3001)
    assert free_time_s(s, np.full(3001, TOP), ACCEL, JERK) == pytest.approx(2.0 + 0.5, abs=2e-3)


def test_a_slow_section_is_entered_at_its_speed() -> None:
    """4.5 m to 1.2 m/s and down to 0.6, 2 m at 0.6, then up and down again; by hand, without the jerk."""
    s = np.linspace(0.0, 12.0, 12001)
    speed = np.where((s >= 5.0) & (s <= 7.0), 0.6, 1.2)
    # 0 -> 1.2: 4 s, 2.4 m. 1.2 -> 0.6: 2 s, 1.8 m. So 0.8 m at 1.2 before, and the same mirrored after.
    by_hand = 2 * (4.0 + 0.8 / 1.2 + 2.0) + 2.0 / 0.6
    assert free_time_s(s, speed, ACCEL, math.inf) == pytest.approx(by_hand, abs=2e-3)


def test_the_lattice_arrives_within_a_step_of_the_trapezoid() -> None:
    lattice = Lattice(TOP, ACCEL, 10.0)
    steps = lattice.steps_to_end([[] for _ in range(200)])
    exact = 10.0 / 1.2 + 1.2 / 0.3
    assert exact - lattice.dt_s <= steps * lattice.dt_s <= exact + 2 * lattice.dt_s


@pytest.mark.parametrize(("top_mps", "step_s"), [(0.02, 0.0667), (0.05, 0.1667), (0.3, 0.1)])
def test_a_slow_robot_needs_no_finer_steps(top_mps: float, step_s: float) -> None:
    """With as many speeds as at 1.5 m/s a step would be 3 ms at 0.02 m/s, and one mission take minutes."""
    lattice = Lattice(top_mps, ACCEL, 2.0)
    assert lattice.dt_s == pytest.approx(step_s, rel=0.01)
    exact = 2.0 / top_mps + top_mps / ACCEL
    steps = lattice.steps_to_end([[] for _ in range(2000)])
    assert exact - lattice.dt_s <= steps * lattice.dt_s <= exact + 2 * lattice.dt_s


def test_oracle_never_passes_a_body_that_stays_on_the_path() -> None:
    best = oracle.solve(stage(crate(6.0), length_m=10.0), TOP, 60.0)
    assert math.isinf(best.total_s)


def test_body_beside_the_path_costs_the_oracle_no_time() -> None:
    best = oracle.solve(stage(crate(6.0, 0.39 + 0.3 + 0.02), length_m=10.0), TOP, 60.0)
    assert best.delay_s == 0.0


def test_one_blocking_interval_is_waited_for_and_passed_at_speed() -> None:
    """s = 5..10 m is blocked until t = 12 s. Who knows it is there just then, at full speed, having lost no
    more than the wait: 12 s and the 5 m still to go, of which the last 2.4 m are braking."""
    lattice = Lattice(TOP, ACCEL, 10.0)
    count = round(40.0 / lattice.dt_s)
    blocked = [[(5.0, 11.0)] if k * lattice.dt_s <= 12.0 else [] for k in range(count)]
    steps = lattice.steps_to_end(blocked)
    by_hand = 12.0 + (5.0 - 2.4) / 1.2 + 4.0
    assert by_hand - lattice.dt_s <= steps * lattice.dt_s <= by_hand + 3 * lattice.dt_s


def test_a_blocking_interval_that_can_be_beaten_is_passed_first() -> None:
    lattice = Lattice(TOP, ACCEL, 10.0)
    free = lattice.steps_to_end([[] for _ in range(200)])
    blocked = [[(2.0, 3.0)] if k * lattice.dt_s > 6.0 else [] for k in range(200)]
    assert lattice.steps_to_end(blocked) == free


def test_standing_while_something_passes_over_is_allowed_and_moving_is_not() -> None:
    lattice = Lattice(TOP, ACCEL, 10.0)
    whole = [[(-1.0, 11.0)] if 0 < k * lattice.dt_s < 5.0 else [] for k in range(200)]
    free = lattice.steps_to_end([[] for _ in range(200)])
    delay_s = (lattice.steps_to_end(whole) - free) * lattice.dt_s
    assert delay_s == pytest.approx(5.0, abs=2 * lattice.dt_s)


def test_a_crosser_delays_by_what_it_blocks() -> None:
    """It enters what the robot sweeps at x = 5 when the robot would be there and takes 2.2 s to leave it."""
    crossing = mover(5.0, 4.0, 5.0, -8.0, 0.8, start_s=0.0)
    best = oracle.solve(stage(crossing, length_m=10.0), TOP, 60.0)
    assert 0.2 < best.delay_s < 2.5


def test_a_slow_section_of_the_lattice_is_kept() -> None:
    lattice = Lattice(TOP, ACCEL, 10.0)
    lattice.limit(np.array([0.0, 4.0, 4.01, 10.0]), np.array([1.2, 1.2, 0.3, 0.3]))
    steps = lattice.steps_to_end([[] for _ in range(400)])
    # 6 m at 0.3 m/s alone take 20 s.
    assert steps * lattice.dt_s > 20.0
