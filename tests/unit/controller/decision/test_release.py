"""Slower at once, faster later, with a fake clock."""

from __future__ import annotations

import numpy as np
import pytest

from config.decision import Release
from controller.decision.release import ReleaseGate, StartDelay

STEP_NS = 20_000_000
STEP_S = 0.02


class Gate:
    """Steps a gate with the speed following the target by 0.3 m/s2."""

    def __init__(self, v: float = 1.0, config: Release | None = None) -> None:
        self.gate = ReleaseGate(config or Release())
        self.now_ns = 0
        self.v = v
        self.target = self.step(v) if v > 0.0 else 0.0

    def step(self, raw: float) -> float:
        self.target = self.gate.step(raw, self.v, self.v, self.now_ns)
        self.now_ns += STEP_NS
        self.v += min(max(self.target - self.v, -0.3 * STEP_S), 0.3 * STEP_S)
        return self.target

    def hold(self, raw: float, seconds: float) -> float:
        for _ in range(round(seconds / STEP_S)):
            self.step(raw)
        return self.target


def rolling() -> Gate:
    """At 0.1 m/s, which is all that has been allowed for long."""
    gate = Gate(0.1)
    gate.step(1.0)
    gate.hold(0.1, 3.0)
    gate.v = 0.1
    return gate


def standing() -> Gate:
    """At rest for long, because the way was blocked."""
    gate = Gate(0.0)
    gate.step(1.0)
    gate.hold(0.0, 3.0)
    gate.v = 0.0
    return gate


def released_after_s(gate: Gate) -> float:
    """For how long the way must be free up to 1.5 m/s until the target rises above the speed."""
    began_ns = gate.now_ns
    while gate.step(1.5) <= gate.v + 1e-9:
        assert gate.now_ns - began_ns < 3e9
    return (gate.now_ns - began_ns) / 1e9


def test_the_first_way_is_free_at_once() -> None:
    assert Gate(v=0.0).step(1.5) == 1.5


def test_a_falling_target_is_passed_on_at_once() -> None:
    gate = Gate(1.0)
    assert gate.step(0.4) == 0.4
    assert gate.step(0.0) == 0.0


def test_a_rising_target_waits_for_a_free_way() -> None:
    """From standstill the decrease is long ago: only delay_s counts."""
    gate = standing()
    assert gate.hold(0.2, 0.28) == 0.0
    assert gate.hold(0.2, 0.06) == 0.2


def test_release_to_a_much_higher_speed_waits_less_long() -> None:
    gate = rolling()
    assert gate.hold(0.6, 0.1) == 0.1
    assert gate.hold(0.6, 0.06) == 0.6


def test_release_from_rest_never_waits_less_long() -> None:
    """Who follows somebody that has just gone by comes into view right before the nose."""
    gate = standing()
    assert gate.hold(1.5, 0.28) == 0.0
    assert gate.hold(1.5, 0.06) == 1.5


def test_far_above_the_speed_counts_the_least_of_that_time() -> None:
    """A single frame that is not free: no more than it showed, until far_delay_s after it."""
    gate = rolling()
    gate.hold(1.5, 0.06)
    gate.step(0.2)
    assert gate.hold(1.5, 0.1) == 0.1
    assert gate.hold(1.5, 0.06) == 1.5


def test_a_break_in_the_free_way_starts_the_delay_anew() -> None:
    gate = Gate(0.0)
    gate.step(0.0)
    gate.hold(1.0, 0.2)
    gate.step(0.0)
    assert gate.hold(1.0, 0.2) == 0.0


def test_no_increase_sooner_than_hold_after_a_decrease_began() -> None:
    gate = Gate(1.0)
    gate.step(0.3)
    assert released_after_s(gate) == pytest.approx(2.0, abs=0.05)


def test_while_it_waits_it_does_not_go_on_braking() -> None:
    gate = Gate(1.0)
    gate.hold(0.3, 0.4)
    slow = gate.v
    gate.hold(1.5, 0.4)
    assert gate.v >= slow - 0.3 * 0.35
    gate.hold(1.5, 0.6)
    assert gate.v >= slow - 0.3 * 0.35


def test_noise_cannot_turn_it_round_three_times_in_two_seconds() -> None:
    random = np.random.default_rng(3)
    gate = Gate(1.0)
    turns: list[float] = []
    last = 0
    for k in range(6000):
        v = gate.v
        target = gate.step(float(random.uniform(0.2, 1.5)))
        sign = 1 if target > v + 0.03 else -1 if target < v - 0.03 else 0
        if sign and last and sign != last:
            turns.append(k * STEP_S)
        last = sign or last
    assert all(sum(t <= u < t + 2.0 for u in turns) < 3 for t in turns)


def test_a_rising_target_is_followed_without_steps_once_released() -> None:
    gate = Gate(0.0)
    targets = [gate.step(0.2 + 0.004 * k) for k in range(100)]
    assert targets == pytest.approx([0.2 + 0.004 * k for k in range(100)])


def test_stepping_down_further_does_not_begin_the_hold_anew() -> None:
    gate = Gate(1.0)
    gate.hold(0.8, 1.0)
    gate.hold(0.5, 0.9)
    assert released_after_s(gate) < 0.5


def test_released_speed_rises_to_the_minimum_of_the_last_moments() -> None:
    gate = standing()
    for k in range(40):
        target = gate.step(1.4 if k % 2 else 0.7)
    assert target == 0.7


def test_a_hair_is_no_reason_to_go_faster() -> None:
    gate = Gate(1.0)
    gate.hold(0.5, 4.0)
    assert gate.hold(0.58, 1.0) <= 0.5 + 1e-9
    assert gate.hold(0.65, 1.0) == 0.65


def test_nor_where_the_path_hardly_allows_more() -> None:
    gate = Gate(1.0)
    gate.hold(0.5, 4.0)
    for _ in range(60):
        target = gate.gate.step(1.5, 0.5, 0.5, gate.now_ns, max_mps=0.55)
        gate.now_ns += STEP_NS
    assert target == 0.5


def test_what_is_no_reason_at_first_is_one_after_a_while() -> None:
    gate = Gate(1.0)
    gate.hold(0.5, 4.0)
    assert gate.hold(0.58, 1.0) <= 0.5 + 1e-9
    assert gate.hold(0.58, 2.0) == 0.58


def test_a_standing_robot_starts_for_the_little_that_a_slow_section_allows() -> None:
    gate = standing()
    for _ in range(60):
        target = gate.gate.step(1.5, 0.0, 0.0, gate.now_ns, max_mps=0.05)
        gate.now_ns += STEP_NS
    assert target == 1.5


def test_a_stop_from_a_crawl_is_a_turn_too() -> None:
    gate = Gate(1.0)
    gate.hold(0.0, 4.0)
    gate.hold(0.5, 0.4)
    gate.v = 0.02
    gate.step(0.0)
    began = gate.now_ns
    gate.v = 0.0
    while gate.step(0.5) <= 0.0:
        assert gate.now_ns - began < 3e9
    assert (gate.now_ns - began) / 1e9 > 1.9


def test_only_what_comes_back_after_the_way_was_free_delays_the_start() -> None:
    """Steps of 0.1 s: in each, whether something blocks the way, and whether that stands."""
    stands, goes, free = (True, True), (True, False), (False, False)

    def waits(*steps: tuple[bool, bool]) -> list[bool]:
        delay = StartDelay()
        return [delay.step(blocked, still, k * 100_000_000) for k, (blocked, still) in enumerate(steps)]

    assert not any(waits(*[stands] * 3, *[free] * 3))
    assert not any(waits(*[stands] * 3, *[goes] * 3, *[stands] * 3, *[free] * 3))
    came_back = waits(*[stands] * 3, *[free] * 2, stands, *[free] * 12)
    assert came_back == [False] * 6 + [True] * 9 + [False] * 3
    # After five seconds it is something new.
    assert not any(waits(stands, *[free] * 50, stands, *[free] * 3))
