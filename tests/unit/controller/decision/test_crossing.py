"""Conflicts in time, and the two choices of each, by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.robot import Body
from controller.braking import BrakeLimits
from controller.decision.bodies import Bodies
from controller.decision.corridor import Corridor, place
from controller.decision.crossing import Choice, Conflict, choices, find_conflicts, likely_enters
from controller.profile import SpeedRamps
from tests.support.floor_bodies import box, line_path

TIMES = np.arange(0.0, 8.1, 0.2)
CORRIDOR = Corridor(line_path(), Body(width_m=0.8, length_m=1.0, rear_m=0.5))
SPEEDS = np.linspace(0.0, 1.5, 31)
COMFORT = BrakeLimits(0.3, 0.6)


def conflicts(body: Bodies, sigma_mps: float = 0.0, margin_m: float = 0.1) -> list[Conflict]:
    placed = place(body, CORRIDOR, TIMES, 0.0, 12.0)
    rows = np.arange(len(body))
    return find_conflicts(placed, TIMES, np.full(len(body), sigma_mps), np.full(len(body), margin_m), rows)


def test_a_crossing_body_is_in_the_way_between_two_times() -> None:
    """It is outside beyond |y| = 0.4 + 0.25 + 0.1 = 0.75; at 1 m/s from y = 3 that is 2.25 s to 3.75 s."""
    (one,) = conflicts(box(8.0, 3.0, 0.0, -1.0))
    assert (one.in_s, one.out_s) == pytest.approx((2.25, 3.75), abs=1e-6)
    assert (one.lo_in_m, one.hi_in_m) == pytest.approx((7.3, 8.7))


def test_an_oblique_one_blocks_other_places_when_it_leaves() -> None:
    (one,) = conflicts(box(8.0, 3.0, -0.5, -1.0))
    assert one.lo_in_m == pytest.approx(7.3 - 0.5 * 2.25)
    assert one.lo_out_m == pytest.approx(7.3 - 0.5 * 3.75)


def test_conflict_with_a_body_on_the_path_begins_now() -> None:
    (one,) = conflicts(box(8.0, 0.0, 0.0, -1.0))
    assert (one.in_s, one.out_s) == pytest.approx((0.0, 0.75))


def test_conflict_with_a_body_that_stays_never_ends() -> None:
    (one,) = conflicts(box(8.0, 0.0, -0.5, 0.0))
    assert one.in_s == 0.0
    assert math.isinf(one.out_s)


def test_body_that_passes_beside_or_walks_away_is_no_conflict() -> None:
    assert conflicts(box(8.0, 1.0, -1.0, 0.0)) == []
    assert conflicts(box(8.0, 1.0, 0.0, 1.0)) == []


def test_an_unlikely_entry_does_not_count() -> None:
    """It drifts in by 0.05 m/s; with a spread of 0.1 m/s that is noise."""
    assert conflicts(box(8.0, 1.0, -1.0, -0.05), sigma_mps=0.0) != []
    assert conflicts(box(8.0, 1.0, -1.0, -0.05), sigma_mps=0.1) == []


def test_leaving_must_be_certain() -> None:
    """It leaves at 0.3 m/s: with a spread of 0.1 m/s at 0.2 m/s for certain, with 0.3 m/s never."""
    (sure,) = conflicts(box(8.0, 0.0, -0.5, 0.3), sigma_mps=0.1)
    assert sure.out_s == pytest.approx(0.75 / 0.2, abs=1e-6)
    (unsure,) = conflicts(box(8.0, 0.0, -0.5, 0.3), sigma_mps=0.3)
    assert math.isinf(unsure.out_s)


def ramps(v_mps: float) -> SpeedRamps:
    return SpeedRamps(v_mps, 0.0, SPEEDS, COMFORT)


CROSSING = Conflict(0, 4.0, 6.0, 5.0, 5.0, 6.0)


def choose(conflict: Conflict, v_mps: float, enter_s: float = 0.0, leave_s: float = 0.0) -> Choice:
    return choices(conflict, ramps(v_mps), 0.0, 0.0, leave_s, enter_s)


def test_slow_a_little_and_come_when_it_has_left() -> None:
    choice = choose(CROSSING, 1.0)
    assert 0.5 < choice.yield_mps < 1.0
    at_exit = SpeedRamps(1.0, 0.0, np.array([choice.yield_mps]), COMFORT).distance(np.array([[6.0]]))
    # Between two of the 31 speeds it is interpolated.
    assert at_exit[0, 0] == pytest.approx(5.0, abs=0.02)


def test_a_time_margin_slows_it_more() -> None:
    assert choose(CROSSING, 1.0, leave_s=1.0).yield_mps < choose(CROSSING, 1.0).yield_mps


def test_pass_first_when_the_whole_body_is_past_before_it_enters() -> None:
    """At 1.5 m/s the robot is at 6 m after 4 s, exactly at hi: not past. With 5 s it is."""
    assert math.isinf(choose(CROSSING, 1.5).first_mps)
    later = Conflict(0, 5.0, 7.0, 5.0, 5.0, 6.0)
    assert choose(later, 1.5).first_mps < 1.5
    assert choose(later, 1.5, enter_s=1.1).first_mps == math.inf


def test_distant_conflict_does_not_lower_the_speed() -> None:
    far = Conflict(0, 1.0, 2.0, 9.0, 9.0, 10.0)
    assert choose(far, 1.5).yield_mps == math.inf


def test_too_near_even_for_standing() -> None:
    near = Conflict(0, 0.0, 6.0, -0.1, -0.1, 1.0)
    assert choose(near, 0.5).yield_mps == 0.0


def test_yielding_to_a_conflict_without_end_means_stopping() -> None:
    stays = Conflict(0, 3.0, math.inf, 5.0, 3.0, 6.0)
    assert choose(stays, 1.0).yield_mps == 0.0


def test_uncertain_position_makes_a_body_likely_to_enter() -> None:
    """Goes along the way, 0.5 m beside the swept width."""
    placed = place(box(4.0, 0.4 + 0.25 + 0.5, -0.5, 0.0), CORRIDOR, TIMES, 0.0, 12.0)
    assert not likely_enters(placed, TIMES, np.zeros(1), np.array([0.45])).any()
    assert likely_enters(placed, TIMES, np.zeros(1), np.array([0.55])).all()
