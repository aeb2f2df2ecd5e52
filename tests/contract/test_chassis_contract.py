"""What every chassis driver must do, over every link that it has: see tests/support/contract_rigs.py."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import pytest

from hal.types import ChassisMode, ChassisState
from tests.support.chassis_rig import MS, Rig
from tests.support.contract_rigs import EMULATED, open_real

REAL = "real base"


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Every emulated base; or, with --channel, the real one alone."""
    if "rig" in metafunc.fixturenames:
        real = metafunc.config.getoption("--channel") is not None
        metafunc.parametrize("rig", [REAL] if real else list(EMULATED), indirect=True)


@pytest.fixture
def rig(request: pytest.FixtureRequest) -> Iterator[Rig]:
    opened = open_real(request.config) if request.param == REAL else EMULATED[request.param]()
    with opened as one:
        yield one


def test_nothing_is_known_before_the_base_speaks(rig: Rig) -> None:
    rig.require_emulator("it speaks as soon as the port is open")
    state = rig.chassis.exchange(None, 1 * MS)
    assert state.mode is ChassisMode.STANDBY
    assert state.feedback_ns is None
    assert math.isnan(state.v_mps)
    assert math.isnan(state.w_radps)
    assert math.isnan(state.battery_v)
    assert state.stamp_ns == 1 * MS


def test_does_not_move_without_consent(rig: Rig) -> None:
    for _ in range(100):
        state = rig.step(0.5, 0.2)
        assert state.mode is ChassisMode.STANDBY
        assert state.sent is None or (state.sent.v_mps, state.sent.w_radps) == (0.0, 0.0)
    assert rig.plant.track_travel_m == (0.0, 0.0)


def test_arms_and_stands_until_told(rig: Rig) -> None:
    rig.run(0.5)
    rig.arm()
    state = rig.run(1.0)
    assert (state.mode, state.reason) == (ChassisMode.ARMED, "armed")
    assert rig.plant.track_travel_m == (0.0, 0.0)
    assert state.battery_v == pytest.approx(rig.battery_v, nan_ok=True) or math.isnan(rig.battery_v)
    assert state.faults == () or math.isnan(rig.battery_v), "a real base may complain and yet drive"


def test_does_not_arm_into_a_command(rig: Rig) -> None:
    rig.run(0.2)
    rig.chassis.arm(rig.now_ns)
    assert rig.run(0.8, 0.5).mode is ChassisMode.ARMING
    assert rig.plant.track_travel_m == (0.0, 0.0)


@pytest.mark.parametrize(
    ("v_mps", "w_radps"), [(0.5, 0.0), (0.4, 0.3), (0.4, -0.3), (-0.2, 0.0), (0.0, 0.45)]
)
def test_moves_as_commanded(rig: Rig, v_mps: float, w_radps: float) -> None:
    """The true body makes the commanded twist, slip and all, and the driver reports it. A SCOUT turns at
    0.476 rad/s at the most: 0.5235 on the wire, less slip."""
    rig.run(0.2)
    rig.arm()
    state = rig.run(2.0, v_mps, w_radps)
    rounding_radps = 0.5 * rig.wire_step_radps
    assert rig.plant.twist[0] == pytest.approx(v_mps, abs=rig.tolerance_mps)
    assert rig.plant.twist[1] == pytest.approx(w_radps, abs=rig.tolerance_radps + rounding_radps)
    assert state.v_mps == pytest.approx(v_mps, abs=rig.tolerance_mps + 0.003)
    assert state.w_radps == pytest.approx(w_radps, abs=rig.tolerance_radps + 0.003 + rounding_radps)
    assert state.feedback_ns is not None
    assert rig.now_ns - state.feedback_ns <= 100 * MS


def test_dead_reckoning_follows_the_true_body(rig: Rig) -> None:
    rig.require_emulator("where it truly is, nobody knows")
    rig.run(0.2)
    rig.arm()
    rig.run(2.0, 0.5)
    rig.run(3.0, 0.5, 0.4)
    rig.run(2.0, 0.5, -0.4)
    state = rig.run(2.0)
    true = rig.plant.pose
    assert math.hypot(state.pose.x_m - true.x_m, state.pose.y_m - true.y_m) < 0.01
    assert state.pose.heading_rad == pytest.approx(true.heading_rad, abs=0.01)
    assert true.y_m > 0.5, "the path did turn"


def test_dead_reckoning_moves_with_every_exchange(rig: Rig) -> None:
    """However seldom the base reports: who compares poses must not see them stand and jump."""
    rig.require_emulator("its frames come when they like")
    rig.run(0.2)
    rig.arm()
    rig.run(1.0, 0.5)
    travelled = [rig.step(0.5).pose.x_m for _ in range(50)]
    steps = [after - before for before, after in pairwise(travelled)]
    assert min(steps) > 0.008
    assert max(steps) < 0.012


def sent_twists(states: list[ChassisState]) -> list[tuple[float, float]]:
    """(v, w) of all that went out."""
    return [(state.sent.v_mps, state.sent.w_radps) for state in states if state.sent is not None]


def test_says_what_was_sent(rig: Rig) -> None:
    rig.run(0.2)
    rig.arm()
    twists = sent_twists([rig.step(0.3, 0.1) for _ in range(10)])
    assert len(twists) >= 3, "at least every third period"
    assert set(twists) == {(0.3, 0.1)}


def test_too_fast_a_command_is_slowed_on_the_same_curve(rig: Rig) -> None:
    rig.require_emulator("its full speed is not wanted")
    rig.run(0.2)
    rig.arm()
    twists = sent_twists([rig.step(100.0, 50.0) for _ in range(10)])
    assert twists
    for v_mps, w_radps in twists:
        assert 0.1 < v_mps <= 3.0
        assert w_radps == pytest.approx(0.5 * v_mps)


def test_the_newest_command_arrives_within_three_periods(rig: Rig) -> None:
    rig.require_emulator("how soon it brakes is its own affair")
    rig.run(0.2)
    rig.arm()
    rig.run(2.0, 0.5)
    before_mps = rig.plant.twist[0]
    rig.run(0.06, 0.0)
    rig.step(0.0)
    assert rig.plant.twist[0] < before_mps - 0.001, "it brakes"


def test_stop_is_explicit_zero_then_standby_and_may_be_repeated(rig: Rig) -> None:
    rig.run(0.2)
    rig.arm()
    rig.run(1.0, 0.5)
    for _ in range(3):
        rig.chassis.stop(rig.now_ns)
    rig.run_emulator_only(rig.braking_s)
    assert rig.plant.twist[0] < 0.35, "braking by the explicit zero, well before the base's own time-out"
    state = rig.run(2.0, 0.5)
    assert rig.is_standing()
    assert (state.mode, state.reason) == (ChassisMode.STANDBY, "stopped")


def test_leaving_the_context_stops(rig: Rig) -> None:
    rig.run(0.2)
    rig.arm()
    rig.run(1.0, 0.5)
    rig.require_emulator("its driver is closed, so nobody could tell")
    rig.chassis.__exit__(None, None, None)
    rig.run_emulator_only(0.1)
    assert rig.plant.twist[0] < 0.35


def assert_latched(rig: Rig, mode: ChassisMode, word: str) -> None:
    """The mode holds, nothing moves, whatever is commanded, until consent."""
    assert rig.state.mode is mode
    assert word in rig.state.reason
    rig.run(1.5, 0.5)
    travelled = rig.plant.track_travel_m
    state = rig.run(1.0, 0.5)
    assert state.mode is mode
    assert rig.plant.track_travel_m == pytest.approx(travelled, abs=0.05 * rig.tolerance_mps)
    assert state.sent is None or (state.sent.v_mps, state.sent.w_radps) == (0.0, 0.0)


def assert_drives_again_after_consent(rig: Rig) -> None:
    rig.chassis.arm(rig.now_ns)
    assert rig.state.mode in (ChassisMode.ESTOP, ChassisMode.LOST)
    rig.step(0.5)
    assert rig.state.mode in (ChassisMode.ESTOP, ChassisMode.LOST), "consent needs a zero command"
    rig.step()
    rig.arm()
    rig.run(2.0, 0.3)
    assert rig.plant.twist[0] == pytest.approx(0.3, abs=rig.tolerance_mps)


def test_emergency_stop_latches(rig: Rig) -> None:
    rig.run(0.2)
    rig.arm()
    rig.run(1.0, 0.5)
    rig.emulator.press_estop()
    rig.run(0.5, 0.5)
    rig.chassis.arm(rig.now_ns)
    assert "arming refused" in rig.step(0.5).reason, "the button is still pressed"
    rig.emulator.release_estop()
    rig.run(0.3, 0.5)
    assert_latched(rig, ChassisMode.ESTOP, "emergency stop")
    assert_drives_again_after_consent(rig)


def test_restart_of_the_base_latches(rig: Rig) -> None:
    rig.run(0.2)
    rig.arm()
    rig.run(1.0, 0.5)
    rig.emulator.restart()
    rig.run(2.0, 0.5)
    assert_latched(rig, ChassisMode.LOST, "feedback")
    assert_drives_again_after_consent(rig)


def test_frozen_base_latches(rig: Rig) -> None:
    rig.run(0.2)
    rig.arm()
    rig.run(1.0, 0.5)
    rig.emulator.freeze()
    rig.run(rig.own_timeout_s + 1.0, 0.5)
    assert rig.is_standing(), "its own time-out stopped the motors"
    rig.emulator.thaw()
    rig.run(0.3, 0.5)
    assert_latched(rig, ChassisMode.LOST, "feedback")
    assert_drives_again_after_consent(rig)


def test_unplugging_latches_and_the_base_stops_by_itself(rig: Rig) -> None:
    rig.require_emulator("unplugged, it cannot tell that it stands: see for yourself")
    rig.run(0.2)
    rig.arm()
    rig.run(1.0, 0.5)
    rig.plug.out = True
    state = rig.step(0.5)
    assert (state.mode, state.sent) == (ChassisMode.LOST, None)
    rig.run(rig.own_timeout_s + 1.0, 0.5)
    assert rig.is_standing()
    rig.chassis.stop(rig.now_ns)
    rig.plug.plug()
    rig.run(1.0, 0.5)
    assert_latched(rig, ChassisMode.LOST, "unplugged")
    assert_drives_again_after_consent(rig)


def test_stop_on_a_lost_link_raises_nothing(rig: Rig) -> None:
    rig.run(0.2)
    rig.arm()
    rig.run(0.5, 0.5)
    rig.plug.out = True
    rig.chassis.stop(rig.now_ns)
    rig.chassis.stop(rig.now_ns)
    assert rig.step(0.5).mode is ChassisMode.LOST
    rig.chassis.__exit__(None, None, None)


def test_stop_on_a_link_that_has_come_back_is_heard(rig: Rig) -> None:
    """The driver has not tried the link again yet, but stop() does."""
    rig.require_emulator("its driver does not read again before the base stands anyway")
    rig.run(0.2)
    rig.arm()
    rig.run(1.0, 0.5)
    rig.plug.out = True
    rig.step(0.5)
    rig.plug.plug()
    rig.chassis.stop(rig.now_ns)
    rig.run_emulator_only(rig.braking_s)
    assert rig.plant.twist[0] < 0.35


def test_a_host_that_dies_leaves_a_base_that_stops(rig: Rig) -> None:
    rig.run(0.2)
    rig.arm()
    rig.run(1.0, 0.5)
    rig.run_emulator_only(rig.own_timeout_s + 1.0)
    assert rig.is_standing()


def test_a_control_loop_that_hung_does_not_go_on_at_the_old_speed(rig: Rig) -> None:
    rig.run(0.2)
    rig.arm()
    rig.run(1.0, 0.5)
    rig.run_emulator_only(rig.own_timeout_s + 0.2)
    rig.step(0.5)
    assert rig.state.mode in (ChassisMode.ESTOP, ChassisMode.LOST)
    rig.run(0.5, 0.5)
    assert_latched(rig, rig.state.mode, "")


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_command_that_is_no_number_latches(rig: Rig, bad: float) -> None:
    rig.run(0.2)
    rig.arm()
    rig.run(0.5, 0.5)
    rig.step(bad)
    assert_latched(rig, ChassisMode.ESTOP, "not finite")
