"""A Roboteq that stops, restarts, refuses or is none: what latches, what is told, what only consent ends."""

from __future__ import annotations

import math

import pytest

from hal.chassis.roboteq import RoboteqChassis
from hal.types import ChassisMode
from tests.support.chassis_rig import roboteq_config
from tests.support.roboteq_bench import Bench
from tests.support.serial_bench import arming_failure_reason


def test_a_watchdog_that_does_not_hold_is_told() -> None:
    bench = Bench()
    bench.emulator.settable_watchdog = False
    bench.chassis.arm(0)
    reasons = [bench.step().reason for _ in range(160)]
    waiting = "the base does not take commands: its watchdog reads 1000 ms, not 300 ms"
    assert f"arming: {waiting}" in reasons
    assert reasons[-1] == f"arming gave up after 3.0 s: {waiting}"


def test_the_emergency_stop_stays_in_the_controller_until_consent() -> None:
    bench = Bench()
    bench.arm()
    bench.run(50, 0.5)
    bench.emulator.press_estop()
    state = bench.run(20, 0.5)
    assert (state.mode, state.reason) == (
        ChassisMode.ESTOP,
        "emergency stop is active; release the button, then arm",
    )
    bench.emulator.release_estop()
    bench.run(100)
    assert bench.emulator.fault_flags == 0x10, "nobody but a person ends it"
    bench.chassis.arm(bench.now_ns)
    assert bench.run(30).mode is ChassisMode.ARMED
    assert bench.emulator.fault_flags == 0


def test_consent_while_the_button_is_pressed_leads_nowhere() -> None:
    bench = Bench()
    bench.arm()
    bench.emulator.press_estop()
    bench.run(20)
    bench.chassis.arm(bench.now_ns)
    states = [bench.step() for _ in range(160)]
    assert ChassisMode.ARMED not in {state.mode for state in states}
    assert states[-1].mode is ChassisMode.ESTOP
    bench.emulator.release_estop()
    assert bench.run(100).mode is ChassisMode.ESTOP, "!MG was said once, with the consent, and never again"


@pytest.mark.parametrize("ends", ["reading", "writing"])
def test_a_consent_that_a_lost_link_ended_resets_nothing_later(ends: str) -> None:
    """Pressed and released meanwhile: the controller's latch is not the one that was consented to end."""
    bench = Bench()
    bench.run(10)
    bench.chassis.arm(bench.now_ns)
    if ends == "reading":
        bench.near.unplug()
    else:
        bench.near.fail_writes(1)
    assert bench.step().mode is ChassisMode.LOST
    bench.emulator.press_estop()
    bench.emulator.release_estop()
    bench.near.plug()
    lines: list[bytes] = []
    for _ in range(100):
        bench.step()
        lines += bench.written()
    assert b"!M 0 0" in lines, "it speaks again"
    assert b"!MG" not in lines
    assert bench.emulator.fault_flags == 0x10


def test_a_fault_beside_the_emergency_stop_is_not_reset() -> None:
    bench = Bench()
    bench.arm()
    bench.emulator.fault_flags = 0x18
    bench.run(20)
    bench.chassis.arm(bench.now_ns)
    state = bench.step()
    assert state.mode is ChassisMode.ESTOP
    assert "arming refused: error: short circuit" in state.reason
    assert state.faults == ("error: short circuit",)


@pytest.mark.parametrize("refused", [True, False])
def test_a_base_whose_motor_flags_are_not_told_is_not_armed(refused: bool) -> None:
    """A stalled motor, or one that stopped for safety, would not show."""
    bench = Bench()
    bench.far.set_filter(lambda data: data.replace(b"?FM\r", b"?FMX\r" if refused else b""))
    bench.chassis.arm(0)
    for _ in range(155):
        assert bench.step().mode is not ChassisMode.ARMED
    assert bench.step().reason == (
        "arming gave up after 3.0 s: no status heard from the base: it answers ?FF, but not ?FM (motor "
        "flags) for two motors; is it a two-channel controller?"
    )


def test_motor_flags_that_are_no_longer_told_are_a_loss() -> None:
    bench = Bench()
    bench.arm()
    bench.far.set_filter(lambda data: data.replace(b"?FM\r", b"?FMX\r"))
    states = [bench.step(0.3) for _ in range(70)]
    lost = next(state for state in states if state.mode is not ChassisMode.ARMED)
    assert (lost.mode, lost.reason[:13]) == (ChassisMode.LOST, "no status for")


@pytest.mark.parametrize(
    ("flags", "mode", "faults"),
    [
        ([1, 0], ChassisMode.ARMED, ("warning: motor 1 at its current limit",)),
        ([0, 2], ChassisMode.ESTOP, ("error: motor 2 stalled",)),
    ],
)
def test_motor_flags_latch_or_are_told(flags: list[int], mode: ChassisMode, faults: tuple[str, ...]) -> None:
    bench = Bench()
    bench.arm()
    bench.emulator.motor_flags = flags
    state = bench.run(20, 0.3)
    assert (state.mode, state.faults) == (mode, faults)


def test_a_base_that_moves_against_zero_is_shut_down() -> None:
    """A script or a stick may drive the motors; after three seconds of zeros unheeded comes !EX."""
    bench = Bench()
    bench.arm()
    bench.run(20, 0.3)
    bench.far.set_filter(lambda data: data.replace(b"!M 0 0\r", b"!M 300 300\r"))
    bench.step(math.nan)
    lines: list[bytes] = []
    for _ in range(145):
        bench.step()
        lines += bench.written()
    assert b"!EX" not in lines
    bench.run(10)
    assert b"!EX" in bench.written()
    bench.run(50)
    assert bench.plant.twist[0] == pytest.approx(0.0, abs=1e-3)


def test_a_controller_that_refuses_commands_is_told() -> None:
    bench = Bench()
    bench.arm()
    bench.run(20, 0.3)
    bench.far.set_filter(lambda data: data.replace(b"!M", b"!Q"))
    state = bench.run(10, 0.3)
    assert (state.mode, state.reason.split(";")[0]) == (
        ChassisMode.ESTOP,
        "the base no longer obeys: it refuses commands",
    )


@pytest.mark.parametrize(
    ("v_mps", "echo", "watchdog_ms", "words"),
    [
        (0.5, False, 300, "its counters jumped: restarted"),
        (None, False, 1000, "its watchdog reads 1000 ms, not 300 ms"),
        (None, True, 300, "it echoes again: restarted"),
    ],
)
def test_a_restart_shows_in_one_way_or_another(
    v_mps: float | None, echo: bool, watchdog_ms: int, words: str
) -> None:
    """Echo and watchdog may have been saved to come back as they were set, and standing no counter jumps."""
    bench = Bench()
    bench.arm()
    bench.run(100, v_mps)
    bench.emulator.restart()
    bench.emulator.echo, bench.emulator.watchdog_ms = echo, watchdog_ms
    state = bench.run(40, v_mps)
    assert state.mode is ChassisMode.ESTOP
    assert state.reason.startswith(f"the base no longer obeys: {words}")
    bench.arm()


@pytest.mark.parametrize("periods", [10, 20])
def test_a_restart_soon_after_setting_off_is_no_travel_backwards(periods: int) -> None:
    """From some centimetres to 0 a track could jump; against its way it cannot."""
    bench = Bench()
    bench.arm()
    gone_m = bench.run(periods, 0.5).pose.x_m
    bench.emulator.restart()
    bench.emulator.echo, bench.emulator.watchdog_ms = False, 300
    state = bench.run(6, 0.5)
    assert gone_m > 0.02
    assert state.reason.startswith("the base no longer obeys: its counters jumped: restarted")
    assert state.pose.x_m >= gone_m


@pytest.mark.parametrize(
    ("babble", "hint"),
    [
        (b"", "not one byte came; check port, power, baud and the crossed lines"),
        (b"\xff\x00\x12", "bytes came, none an answer to ?FF; check baud and that it is a Roboteq"),
    ],
)
def test_a_device_that_is_no_roboteq_is_told_when_arming_gives_up(babble: bytes, hint: str) -> None:
    assert hint in arming_failure_reason(lambda link: RoboteqChassis(link, roboteq_config()), babble)
