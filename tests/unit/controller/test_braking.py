"""The stopping model against values computed by hand (motion formulas 4.7, 4.8; paper eqs. 1, 2)."""

from __future__ import annotations

import math

import pytest

from config.robot import Limits
from controller import braking
from controller.braking import BrakeLimits


@pytest.mark.parametrize(
    ("v", "big_a", "j", "distance"),
    [
        (0.5, 1.0, 2.0, 0.25),
        (1.0, 1.0, 1.0, 1.0),
        (1.0, 1.0, 5.0, 0.6),
        (1.5, 2.0, 4.0, 0.9375),
        (3.0, 1.5, 3.0, 3.75),
        (0.2, 1.0, 1.0, 0.2 * math.sqrt(0.2)),  # A is not reached
    ],
)
def test_distance_from_steady_speed(v: float, big_a: float, j: float, distance: float) -> None:
    assert braking.stop(v, 0.0, BrakeLimits(big_a, j)).distance_m == pytest.approx(distance, abs=1e-12)


def test_time_from_steady_speed() -> None:
    assert braking.stop(1.5, 0.0, BrakeLimits(0.3, 0.6)).time_s == pytest.approx(1.5 / 0.3 + 0.3 / 0.6)
    assert braking.stop(0.04, 0.0, BrakeLimits(1.0, 1.0)).time_s == pytest.approx(0.4)  # 2 sqrt(v / J)


def test_comfort_stop_of_the_default_robot() -> None:
    stop = braking.stop(1.5, 0.0, braking.comfort(Limits()))
    assert stop.distance_m == pytest.approx(1.5**2 / 0.6 + 1.5 * 0.25)  # 4.125 m
    assert stop.time_s == pytest.approx(5.5)


def test_emergency_stop_of_the_default_robot() -> None:
    stop = braking.stop(1.5, 0.0, braking.emergency(Limits()))
    assert stop.distance_m == pytest.approx(1.5**2 / 1.4 + 1.5 * 0.7 / 4.0)
    assert stop.time_s == pytest.approx(1.5 / 0.7 + 0.35)


def test_full_acceleration_at_the_onset_costs_what_the_reference_says() -> None:
    v, big_a, j = 2.0, 0.5, 1.0
    expected = v * v / (2 * big_a) + 2 * v * big_a / j + 17.0 / 24.0 * big_a**3 / j**2
    assert braking.stop(v, big_a, BrakeLimits(big_a, j)).distance_m == pytest.approx(expected, abs=1e-12)


def test_stop_that_was_already_begun() -> None:
    """v 0.5, a -0.5, J 1: easing off takes 0.5 s and leaves v1 = 0.5 + 0.125 as if from steady."""
    stop = braking.stop(0.5, -0.5, BrakeLimits(0.5, 1.0))
    # 0.375 m/s are shed at 0.5 m/s2 in 0.75 s, then 0.125 m/s by the ease-out of 0.5 s.
    assert stop.time_s == pytest.approx(0.75 + 0.5)
    assert stop.distance_m == pytest.approx((0.5 + 0.125) / 2 * 0.75 + 0.5**3 / 6.0)


def test_a_deceleration_that_fades_just_in_time_is_all_of_the_stop() -> None:
    """v = a^2 / 2J exactly: the deceleration fades to nothing at standstill."""
    stop = braking.stop(0.125, -0.5, BrakeLimits(0.5, 1.0))
    assert stop.time_s == pytest.approx(0.5)
    assert stop.distance_m == pytest.approx(0.5**3 / 6.0)


def test_too_slow_to_let_go_ends_at_standstill() -> None:
    """v 0.105, a -0.5, J 1: v(t) = 0.105 - 0.5 t + t^2 / 2 is zero at t = 0.3."""
    stop = braking.stop(0.105, -0.5, BrakeLimits(0.5, 1.0))
    assert stop.time_s == pytest.approx(0.3)
    assert stop.distance_m == pytest.approx(0.105 * 0.3 - 0.25 * 0.09 + 0.027 / 6.0)


def test_too_slow_to_let_go_from_harder_braking_than_allowed() -> None:
    """v 1.6, a -3, J 2: v(t) = 1.6 - 3 t + t^2 is zero at t = (3 - sqrt(2.6)) / 2, before a is -0.6."""
    stop = braking.stop(1.6, -3.0, BrakeLimits(0.6, 2.0))
    time_s = (3.0 - math.sqrt(2.6)) / 2.0
    assert stop.time_s == pytest.approx(time_s)
    assert stop.distance_m == pytest.approx(1.6 * time_s - 1.5 * time_s**2 + time_s**3 / 3.0)


def test_ease_out_alone_where_rounding_leaves_less_than_nothing() -> None:
    """v = a^2 / 2J in floats, but a^2 - 2 J v = -1e-19."""
    stop = braking.stop(0.0005, -0.03, BrakeLimits(0.3, 0.9))
    assert stop.time_s == pytest.approx(0.03 / 0.9)


def test_standing_still_takes_nothing() -> None:
    stop = braking.stop(0.0, 0.0, BrakeLimits(0.3, 0.6))
    assert (stop.distance_m, stop.time_s) == (0.0, 0.0)


def test_harder_braking_than_allowed_is_first_eased() -> None:
    """v 1, a -0.7 under A 0.3, J 2: 0.2 s of easing to -0.3 at v 0.9, then the usual law from there."""
    limits = BrakeLimits(0.3, 2.0)
    rest = braking.stop(0.9, -0.3, limits)
    stop = braking.stop(1.0, -0.7, limits)
    assert stop.time_s == pytest.approx(0.2 + rest.time_s)
    assert stop.distance_m == pytest.approx(0.2 - 0.7 * 0.02 + 2.0 * 0.008 / 6.0 + rest.distance_m)


def test_harder_acceleration_than_allowed_is_first_eased() -> None:
    """v 1, a 0.7 under A 0.3, J 2: after 0.2 s the speed is 1.1."""
    limits = BrakeLimits(0.3, 2.0)
    rest = braking.stop(1.1, 0.3, limits)
    stop = braking.stop(1.0, 0.7, limits)
    assert stop.time_s == pytest.approx(0.2 + rest.time_s)
    assert stop.distance_m == pytest.approx(0.2 + 0.7 * 0.02 - 2.0 * 0.008 / 6.0 + rest.distance_m)


@pytest.mark.parametrize("a", [0.5, -0.5, -0.1, 0.3])
def test_with_infinite_jerk_the_present_acceleration_is_gone_at_once(a: float) -> None:
    """Also from outside the limits, and at standstill."""
    limits = BrakeLimits(0.3, math.inf)
    stop = braking.stop(1.0, a, limits)
    assert stop.distance_m == pytest.approx(1.0 / 0.6)
    assert stop.time_s == pytest.approx(1.0 / 0.3)
    assert braking.stop(0.0, a, limits) == braking.Stop(0.0, 0.0)


@pytest.mark.parametrize(
    ("v", "v_o", "big_a", "j", "full"),
    [
        (0.5, 1.6, 1.0, 2.0, 2.38),
        (1.0, 0.0, 1.0, 2.0, 1.00),
        (1.0, 1.6, 1.0, 2.0, 3.80),
        (1.0, 1.6, 1.0, 1.0, 4.85),
        (1.5, 1.6, 1.0, 2.0, 5.47),
        (1.5, 1.6, 2.0, 4.0, 3.71),
    ],
)
def test_full_detection_distance(v: float, v_o: float, big_a: float, j: float, full: float) -> None:
    """The table of 4.8, which is rounded to 1 cm."""
    distance = braking.required_distance(v, 0.0, v_o, 0.25, BrakeLimits(big_a, j))
    assert distance == pytest.approx(full, abs=0.00501)


def test_required_distance_adds_the_margin_and_ignores_a_receding_obstacle() -> None:
    limits = BrakeLimits(1.0, 2.0)
    standing = braking.required_distance(1.0, 0.0, 0.0, 0.25, limits)
    assert braking.required_distance(1.0, 0.0, -1.0, 0.25, limits, margin_m=0.4) == pytest.approx(
        standing + 0.4
    )


def test_the_paper_is_the_case_of_infinite_jerk_and_no_latency() -> None:
    assert braking.paper_braking_distance(1.5, 0.3) == pytest.approx(3.75)
    assert braking.paper_stopping_time(1.5, 0.3) == pytest.approx(5.0)
    assert braking.paper_detection_distance(1.5, 1.5, 0.3) == pytest.approx(11.25)
    # Eq. 1 of the paper: V_r = sqrt(2 a S_r).
    assert braking.paper_braking_distance(1.5, 0.3) == pytest.approx(1.5**2 / (2.0 * 0.3))


def test_slowing_to_a_section() -> None:
    """From 1.5 to 0.5 under A 0.3, J 0.6: 1 / 0.3 + 0.5 s at 1 m/s on average."""
    limits = BrakeLimits(0.3, 0.6)
    assert braking.slowing_distance(1.5, 0.5, limits) == pytest.approx(1.0 / 0.3 + 0.5)
    assert braking.slowing_distance(1.5, 0.0, limits) == pytest.approx(4.125)
    assert braking.speed_before_section(1.0 / 0.3 + 0.5, 0.5, limits) == pytest.approx(1.5)
    assert braking.speed_before_section(0.0, 0.5, limits) == 0.5
    assert braking.speed_before_section(-0.1, 0.5, limits) == 0.5


def test_how_far_it_comes_while_it_lets_go_of_its_acceleration() -> None:
    """From 1 m/s with a 0.3 under J 0.6: 0.5 s at 1 m/s, and 0.025 m more."""
    limits = BrakeLimits(0.3, 0.6)
    assert braking.letting_go_distance(1.0, 0.3, limits) == pytest.approx(0.525)
    assert braking.letting_go_distance(1.0, 0.0, limits) == 0.0
    assert braking.letting_go_distance(1.0, -0.3, limits) == 0.0


@pytest.mark.parametrize(
    ("v", "a"), [(-0.1, 0.0), (math.nan, 0.0), (math.inf, 0.0), (1.0, math.nan), (1.0, -math.inf)]
)
def test_an_unknown_state_is_refused(v: float, a: float) -> None:
    with pytest.raises(ValueError, match="known speed"):
        braking.stop(v, a, BrakeLimits(0.3, 0.6))
    with pytest.raises(ValueError, match="known speed"):
        braking.required_distance(v, a, 0.0, 0.0, BrakeLimits(0.3, 0.6))


@pytest.mark.parametrize(
    ("a", "j"), [(0.0, 1.0), (1.0, 0.0), (-1.0, 1.0), (math.nan, 1.0), (1.0, math.nan), (math.inf, 1.0)]
)
def test_impossible_limits_are_refused(a: float, j: float) -> None:
    with pytest.raises(ValueError, match="must be positive"):
        BrakeLimits(a, j)


@pytest.mark.parametrize("section_mps", [-0.1, math.nan])
def test_a_section_without_a_speed_is_refused(section_mps: float) -> None:
    with pytest.raises(ValueError, match="a section has a place and a speed >= 0"):
        braking.speed_before_section(2.0, section_mps, BrakeLimits(0.3, 0.6))


def test_speeding_up_is_no_slowing_down() -> None:
    with pytest.raises(ValueError, match="can only slow down"):
        braking.slowing_distance(0.5, 1.0, BrakeLimits(0.3, 0.6))
    with pytest.raises(ValueError, match="can only slow down"):
        braking.slowing_distance(0.5, -0.5, BrakeLimits(0.3, 0.6))


@pytest.mark.parametrize("unknown", [(math.nan, 0.2, 0.0), (0.5, math.nan, 0.0), (0.5, 0.2, math.nan)])
def test_unknown_value_gives_no_distance(unknown: tuple[float, float, float]) -> None:
    closing_mps, latency_s, margin_m = unknown
    with pytest.raises(ValueError, match=r"known .*nan"):
        braking.required_distance(1.0, 0.0, closing_mps, latency_s, BrakeLimits(0.7, 2.0), margin_m)


def test_a_section_that_is_nobody_knows_where_is_no_speed() -> None:
    with pytest.raises(ValueError, match="a section has a place"):
        braking.speed_before_section(math.nan, 0.5, BrakeLimits(0.3, 0.6))
