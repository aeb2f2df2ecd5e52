"""The shaper: hand-over between profiles, and what happens when ruckig fails."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from ruckig import Result, RuckigError  # type: ignore[import-not-found]  # a compiled module without stubs

from config.robot import Limits
from controller import braking
from controller.shape import SpeedShaper
from tests.support.shaper_run import PERIOD_S


def test_reset_forgets_where_the_end_was() -> None:
    shaper = SpeedShaper(Limits(), PERIOD_S)
    shaper.step(0.0, distance_to_end_m=0.3)
    shaper.reset()
    # 5 mm are not worth a start; the 30 cm of before would be.
    command = shaper.step(1.0, distance_to_end_m=0.005)
    assert (command.v_mps, command.a_mps2) == (0.0, 0.0)


def test_emergency_brakes_harder_and_returns_to_comfort() -> None:
    shaper = SpeedShaper(Limits(), PERIOD_S)
    for _ in range(400):
        shaper.step(1.5)
    assert shaper.v_mps == pytest.approx(1.5)
    for _ in range(50):
        shaper.step(0.0, emergency=True)
    assert shaper.a_mps2 == pytest.approx(-0.7)
    first = shaper.step(0.0)
    assert first.a_mps2 == pytest.approx(-0.7 + 2.0 * PERIOD_S)  # eased at the emergency's jerk
    lows = [shaper.step(0.0) for _ in range(40)]
    assert lows[-1].a_mps2 == pytest.approx(-0.3)


@pytest.mark.parametrize("jerk_mps3", [0.6, 0.2])
def test_hand_over_at_low_speed_does_not_reverse(jerk_mps3: float) -> None:
    """v 0.2, a -0.7: comfort's jerk 0.6 would need v >= 0.41; the emergency's is kept to the end. With 0.2 it
    would need 0.23 even for the comfortable -0.3."""
    shaper = SpeedShaper(Limits(max_jerk_mps3=jerk_mps3), PERIOD_S)
    for _ in range(300):
        shaper.step(0.7)
    while shaper.v_mps > 0.2:
        shaper.step(0.0, emergency=True)
    assert shaper.a_mps2 < -0.5
    while shaper.v_mps > 0.0:
        command = shaper.step(0.0)
        assert command.v_mps >= 0.0
        assert command.fault == ""
    assert shaper.a_mps2 == pytest.approx(0.0, abs=0.04)


@pytest.mark.parametrize("release_mps", [0.3, 0.34, 0.38, 0.42, 0.46, 0.5, 0.7])
def test_back_from_an_emergency_comfort_is_kept_as_soon_as_it_cannot_reverse(release_mps: float) -> None:
    """From when a >= -0.3 and v >= a^2 / 2J, with J 0.2, and not before; then also when it drives on."""
    shaper = SpeedShaper(Limits(max_jerk_mps3=0.2), PERIOD_S)
    for _ in range(500):
        shaper.step(1.0)
    while shaper.v_mps > release_mps:
        shaper.step(0.0, emergency=True)
    comfortable = False
    for k in range(400):
        v, a = shaper.v_mps, shaper.a_mps2
        comfortable |= a >= -0.3 and v >= a * a / (2.0 * 0.2)
        command = shaper.step(0.0 if k < 200 else 1.0)
        jerk = abs(command.a_mps2 - a) / PERIOD_S
        assert command.fault == ""
        if comfortable:
            assert jerk <= 0.2 + 1e-6
        elif a < -0.301 and shaper.v_mps > 0.0:
            assert jerk == pytest.approx(2.0, abs=0.01) or command.a_mps2 == pytest.approx(-0.3)
    assert shaper.v_mps > 0.5


def test_the_speed_limit_is_not_overshot_when_an_emergency_ends_while_it_speeds_up() -> None:
    """At 1.44 m/s with 0.3 m/s2, comfort's jerk would let the speed rise to 1.515."""
    shaper = SpeedShaper(Limits(), PERIOD_S)
    while shaper.v_mps < 1.44:
        shaper.step(1.5, emergency=True)
    assert shaper.a_mps2 == pytest.approx(0.3)
    commands = [shaper.step(1.5) for _ in range(50)]
    assert {command.fault for command in commands} == {""}
    assert max(command.v_mps for command in commands) <= 1.5 + 1e-9


def test_comfort_is_back_at_once_after_an_emergency_at_the_top_speed() -> None:
    """An obstacle that was none, at v_max and a = 0: the stop after it begins at comfort's jerk."""
    shaper = SpeedShaper(Limits(), PERIOD_S)
    for _ in range(400):
        shaper.step(1.5)
    shaper.step(1.5, emergency=True)
    assert shaper.step(0.0).a_mps2 == pytest.approx(-0.6 * PERIOD_S)


@pytest.mark.parametrize(("below_mps", "spare_m"), [(0.3, 0.004), (0.36, 0.006), (0.4, 0.01), (0.42, 0.012)])
def test_near_the_end_too_an_emergency_is_let_go_of_at_its_own_jerk(below_mps: float, spare_m: float) -> None:
    """At -0.7 the plan's jerk of 0.54 would need 0.45 m/s to let go before standstill."""
    shaper = SpeedShaper(Limits(), PERIOD_S)
    for _ in range(300):
        shaper.step(1.0)
    while shaper.v_mps > below_mps:
        shaper.step(0.0, emergency=True)
    plan = braking.BrakeLimits(0.97 * 0.3, 0.9 * 0.6)
    to_end_m = braking.stop(shaper.v_mps, shaper.a_mps2, plan).distance_m + spare_m
    command = shaper.step(1.5, distance_to_end_m=to_end_m)
    assert command.a_mps2 == pytest.approx(-0.7 + 2.0 * PERIOD_S)


def test_the_longest_period_and_the_laziest_chassis() -> None:
    assert SpeedShaper(Limits(), 0.5, 2.0).step(1.0).v_mps > 0.0


def test_a_chassis_lags_by_nothing_and_rests_unless_told_otherwise() -> None:
    plain, told = SpeedShaper(Limits(), PERIOD_S), SpeedShaper(Limits(), PERIOD_S, 0.0)
    for k in range(100):
        assert plain.step(1.5, distance_to_end_m=1.0 - 0.005 * k) == told.step(
            1.5, distance_to_end_m=1.0 - 0.005 * k
        )
    assert plain.v_mps > 0.0
    plain.reset()
    assert (plain.v_mps, plain.a_mps2) == (0.0, 0.0)


def test_targets_beyond_the_limit_are_capped_also_while_accelerating() -> None:
    shaper = SpeedShaper(Limits(), PERIOD_S)
    speeds = [shaper.step(9.0).v_mps for _ in range(400)]
    assert max(speeds) == pytest.approx(1.5)


@pytest.mark.parametrize("target", [math.nan, -1.0, -math.inf])
def test_a_senseless_target_means_stop(target: float) -> None:
    shaper = SpeedShaper(Limits(), PERIOD_S)
    for _ in range(200):
        shaper.step(1.0)
    for _ in range(400):
        shaper.step(target)
    assert shaper.v_mps == 0.0


def test_an_unknown_distance_to_the_end_means_stop() -> None:
    shaper = SpeedShaper(Limits(), PERIOD_S)
    for _ in range(200):
        shaper.step(1.0, distance_to_end_m=50.0)
    for _ in range(400):
        assert shaper.step(1.0, distance_to_end_m=math.nan).fault == ""
    assert shaper.v_mps == 0.0


def _raise_error(*_: object) -> object:
    raise RuckigError("error in step 1: 0.1\n0.2")


def _return_nothing(*_: object) -> object:
    return Result.ErrorInvalidInput


@pytest.mark.parametrize("failure", [_raise_error, _return_nothing])
@pytest.mark.parametrize("warm_up", [30, 120, 400])
def test_shaper_brakes_by_the_stop_profile_if_ruckig_fails(
    failure: Callable[..., object], warm_up: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    shaper = SpeedShaper(Limits(), PERIOD_S)
    for _ in range(warm_up):
        shaper.step(1.5)

    class Broken:
        calculate = staticmethod(failure)

    monkeypatch.setattr(shaper, "_otg", Broken())
    model = braking.stop(shaper.v_mps, shaper.a_mps2, braking.comfort(Limits()))
    steps = distance = 0.0
    a = shaper.a_mps2
    while shaper.v_mps > 0.0:
        before = shaper.v_mps
        command = shaper.step(1.4)
        assert command.fault.startswith("ruckig: ")
        assert "\n" not in command.fault
        assert abs(command.a_mps2 - a) <= 0.6 * PERIOD_S + 1e-9
        a = command.a_mps2
        distance += 0.5 * (before + command.v_mps) * PERIOD_S
        steps += 1
    assert steps * PERIOD_S == pytest.approx(model.time_s, abs=0.05)
    assert distance == pytest.approx(model.distance_m, abs=0.005)


def test_a_result_outside_the_limits_is_not_passed_on(monkeypatch: pytest.MonkeyPatch) -> None:
    shaper = SpeedShaper(Limits(), PERIOD_S)
    for _ in range(200):
        shaper.step(1.0)
    monkeypatch.setattr(shaper, "_follow", lambda target: (3.0, 0.0))
    command = shaper.step(1.0)
    assert "outside the limits" in command.fault
    assert command.a_mps2 == pytest.approx(-0.6 * PERIOD_S)


def test_a_jump_of_the_acceleration_is_not_passed_on(monkeypatch: pytest.MonkeyPatch) -> None:
    shaper = SpeedShaper(Limits(), PERIOD_S)
    for _ in range(400):
        shaper.step(1.0)
    monkeypatch.setattr(shaper, "_follow", lambda target: (1.0, -0.02))
    command = shaper.step(1.0)
    assert "1.000000 m/s3" in command.fault
    assert command.a_mps2 == pytest.approx(-0.6 * PERIOD_S)


def test_reset_begins_from_rest() -> None:
    shaper = SpeedShaper(Limits(), PERIOD_S)
    for _ in range(50):
        shaper.step(1.0)
    shaper.reset()
    assert (shaper.v_mps, shaper.a_mps2) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("period_s", "delay_s"),
    [(0.0, 0.0), (-0.02, 0.0), (math.nan, 0.0), (0.02, -1.0), (0.51, 0.0), (0.02, 2.1)],
)
def test_impossible_periods_are_refused(period_s: float, delay_s: float) -> None:
    with pytest.raises(ValueError, match="impossible"):
        SpeedShaper(Limits(), period_s, delay_s)
