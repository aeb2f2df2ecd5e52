"""The speed from which a distance suffices to stop: the inverse of the stopping model, by hand values."""

from __future__ import annotations

import math

import pytest

from controller import braking
from controller.braking import BrakeLimits


def test_inverse_by_the_formula_of_the_reference() -> None:
    """v = -A (tau + A/2J) + sqrt(A^2 (tau + A/2J)^2 + 2 A d) with A 1, J 2, tau 0.25, d 1.0 gives 1.0 m/s."""
    limits = BrakeLimits(1.0, 2.0)
    assert braking.speed_for_distance(1.0, limits, latency_s=0.25) == pytest.approx(1.0, abs=1e-12)
    assert braking.speed_for_distance(1.4, limits, latency_s=0.25, margin_m=0.4) == pytest.approx(1.0)


def test_inverse_in_the_short_case() -> None:
    """A not reached, no latency: v = (J d^2)^(1/3)."""
    limits = BrakeLimits(1.0, 1.0)
    assert braking.speed_for_distance(0.1, limits) == pytest.approx(0.01 ** (1 / 3), abs=1e-12)


def test_inverse_in_the_short_case_with_an_oncoming_obstacle() -> None:
    """v 0.04 under J 1 stands after 2 * 0.2 s and 0.02 * 0.4 m, in which the obstacle comes 0.5 * 0.4 m."""
    speed = braking.speed_for_distance(0.008 + 0.2, BrakeLimits(1.0, 1.0), closing_mps=0.5)
    assert speed == pytest.approx(0.04, abs=1e-12)


def test_inverse_with_an_oncoming_obstacle() -> None:
    limits = BrakeLimits(0.3, 0.6)
    speed = braking.speed_for_distance(10.0, limits, latency_s=0.2, closing_mps=1.5, margin_m=0.4)
    # v^2 / 0.6 + v (0.25 + 0.2 + 5) + 1.5 (0.2 + 0.5) + 0.4 = 10
    assert speed**2 / 0.6 + 5.45 * speed + 1.45 == pytest.approx(10.0)


def test_inverse_of_the_paper() -> None:
    limits = BrakeLimits(0.3, math.inf)
    assert braking.speed_for_distance(3.75, limits) == pytest.approx(1.5)
    assert braking.speed_for_distance(11.25, limits, closing_mps=1.5) == pytest.approx(1.5)
    assert braking.speed_for_distance(3.75, limits, a_mps2=0.3) == pytest.approx(1.5)


def test_inverse_where_the_deceleration_cannot_be_let_go_of_in_time() -> None:
    """v 0.105, a -0.5 under J 1 stands after 0.3 s and 0.0135 m, never letting go (test_braking.py)."""
    limits = BrakeLimits(0.5, 1.0)
    assert braking.speed_for_distance(0.0135, limits, a_mps2=-0.5) == pytest.approx(0.105, abs=1e-9)
    late = braking.speed_for_distance(0.0135 + 0.2 * 0.105, limits, a_mps2=-0.5, latency_s=0.2)
    assert late == pytest.approx(0.105, abs=1e-9)


@pytest.mark.parametrize("a", [-0.7, 0.7, -2.0])
def test_inverse_where_the_acceleration_is_outside_the_limits(a: float) -> None:
    """v 1 under A 0.3, J 2, as it is eased first (test_braking.py); also under an infinite jerk."""
    limits = BrakeLimits(0.3, 2.0)
    distance_m = braking.required_distance(1.0, a, 0.5, 0.2, limits, 0.4)
    speed = braking.speed_for_distance(
        distance_m, limits, a_mps2=a, closing_mps=0.5, latency_s=0.2, margin_m=0.4
    )
    assert speed == pytest.approx(1.0, abs=1e-9)
    assert braking.speed_for_distance(3.75, BrakeLimits(0.3, math.inf), a_mps2=a) == pytest.approx(1.5)


def test_inverse_where_the_formula_with_full_deceleration_has_no_root() -> None:
    """A 1, J 1, V_o 0.5, a -1: b = 0 and c = 1/6 - d: the discriminant 2 d - 1/3 is negative below 1/6 m."""
    limits = BrakeLimits(1.0, 1.0)
    speed = braking.speed_for_distance(0.1, limits, closing_mps=0.5, a_mps2=-1.0)
    assert 0.0 < speed < 0.5
    assert braking.required_distance(speed, -1.0, 0.5, 0.0, limits) == pytest.approx(0.1, abs=1e-9)


def test_inverse_where_the_cubic_is_flat() -> None:
    """a -0.35 under A 0.4, J 0.8, V_o 0: its slope falls to exactly nothing on the way to the root."""
    limits = BrakeLimits(0.4, 0.8)
    speed = braking.speed_for_distance(0.001, limits, a_mps2=-0.35)
    assert braking.required_distance(speed, -0.35, 0.0, 0.0, limits) == pytest.approx(0.001, abs=1e-12)


def test_inverse_under_a_great_jerk() -> None:
    """A not reached: v = (J d^2)^(1/3)."""
    speed = braking.speed_for_distance(0.007, BrakeLimits(2.0, 10.3))
    assert speed == pytest.approx((10.3 * 0.007**2) ** (1 / 3), abs=1e-12)


def test_inverse_where_newton_alone_would_run_away() -> None:
    """A 4, J 0.6, a -1.57: the cubic has a minimum beside its root; only the bracket keeps to the root."""
    limits = BrakeLimits(4.0, 0.6)
    speed = braking.speed_for_distance(0.047, limits, closing_mps=0.3, a_mps2=-1.57)
    assert braking.required_distance(speed, -1.57, 0.3, 0.0, limits) == pytest.approx(0.047, abs=1e-9)


def test_no_speed_fits_when_the_obstacle_is_too_near() -> None:
    limits = BrakeLimits(0.3, 0.6)
    assert braking.speed_for_distance(0.4, limits, margin_m=0.4) == 0.0
    assert braking.speed_for_distance(-1.0, limits) == 0.0
    assert braking.speed_for_distance(0.2, limits, closing_mps=1.5, latency_s=0.2) == 0.0


@pytest.mark.parametrize("name", ["distance_m", "latency_s", "closing_mps", "margin_m", "a_mps2"])
def test_unknown_value_gives_no_speed(name: str) -> None:
    """As stop() refuses it: no comparison with NaN may turn into a speed."""
    given = {"distance_m": 5.0, "latency_s": 0.2, "closing_mps": 0.5, "margin_m": 0.4, "a_mps2": 0.1}
    limits = BrakeLimits(0.7, 2.0)
    assert braking.speed_for_distance(limits=limits, **given) > 0.0
    with pytest.raises(ValueError, match=r"known .*nan"):
        braking.speed_for_distance(limits=limits, **given | {name: math.nan})


@pytest.mark.parametrize(("closing_mps", "latency_s"), [(math.inf, 0.0), (math.inf, 0.2), (0.0, math.inf)])
def test_no_speed_is_slow_enough_for_what_comes_without_end(closing_mps: float, latency_s: float) -> None:
    limits = BrakeLimits(0.7, 2.0)
    assert braking.speed_for_distance(5.0, limits, closing_mps=closing_mps, latency_s=latency_s) == 0.0


def test_a_free_way_without_end_is_as_fast_as_can_be() -> None:
    assert braking.speed_for_distance(math.inf, BrakeLimits(0.7, 2.0)) == math.inf
