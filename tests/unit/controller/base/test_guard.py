"""The output guard: what it stops, what it lets pass, and that it stays shut until consent."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import Any

import pytest

from config.robot import Limits
from controller.base import guard
from controller.base.guard import GuardedCanLink, GuardedChassis, GuardLimits, objection, self_check
from hal.chassis.agilex import COMMANDS
from hal.errors import LinkLost
from hal.links.scripted import ScriptedCanLink
from hal.types import CanFrame, ChassisMode, ChassisState, Setpoint
from tests.support.chassis_rig import MS, Rig, agilex_rig, kobuki_rig, roboclaw_rig, roboteq_rig

# The paper's limits, and ours in an emergency: 1.5 m/s, 0.8 rad/s, +0.3 and -0.7 m/s2, 2 m/s3, 50 Hz.
LIMITS = GuardLimits.of(Limits(), 0.02, 0.1)
NOW = 1_000 * MS
LAST = Setpoint(NOW - 20 * MS, 1.0, 0.0, 0.0)


def next_to_last(
    v_mps: float = 1.0, a_mps2: float = 0.0, w_radps: float = 0.0, stamp_ns: int = NOW
) -> Setpoint:
    return Setpoint(stamp_ns, v_mps, a_mps2, w_radps)


def test_the_bounds_are_the_robot_s() -> None:
    assert GuardLimits(1.5, 0.8, 0.3, 0.7, 2.0, 0.02, 0.1) == LIMITS


@pytest.mark.parametrize(
    ("setpoint", "words"),
    [
        (next_to_last(), ""),
        (next_to_last(v_mps=1.006, a_mps2=0.04), ""),
        (next_to_last(v_mps=0.986, a_mps2=-0.04), ""),
        (next_to_last(w_radps=-0.8), ""),
        (next_to_last(v_mps=math.nan), "not finite"),
        (next_to_last(a_mps2=-math.inf), "not finite"),
        (next_to_last(w_radps=math.nan), "not finite"),
        (next_to_last(v_mps=-0.001), "backwards: -0.001 m/s"),
        (next_to_last(v_mps=1.501), "too fast: 1.501 m/s, at most 1.5"),
        (next_to_last(w_radps=0.801), "turns too fast: 0.801 rad/s, at most 0.8"),
        (next_to_last(v_mps=1.0062), "accelerates too hard: 0.310 m/s2, allowed -0.7..0.3"),
        (next_to_last(v_mps=0.985), "accelerates too hard: -0.750 m/s2"),
        (next_to_last(a_mps2=0.31), "accelerates too hard: 0.310 m/s2"),
        (next_to_last(v_mps=0.0), "accelerates too hard: -50.000 m/s2"),
        (next_to_last(a_mps2=0.041), "jerks: 2.050 m/s3, at most 2"),
        (next_to_last(a_mps2=-0.041), "jerks: -2.050 m/s3"),
        (next_to_last(stamp_ns=NOW + 1), "the command is from the future"),
        (next_to_last(stamp_ns=NOW - 21 * MS), "the command is 1 ms older than the one before"),
    ],
)
def test_guard_objects_to_bad_setpoints_only(setpoint: Setpoint, words: str) -> None:
    said = objection(setpoint, LAST, LIMITS, NOW)
    assert said.startswith(words)
    assert bool(said) is bool(words)


def test_a_command_is_too_old_after_100_ms() -> None:
    old = Setpoint(NOW - 100 * MS, 0.0, 0.0, 0.0)
    assert objection(old, None, LIMITS, NOW) == ""
    assert objection(old, None, LIMITS, NOW + 1) == "the command is 100 ms old"


def test_the_clock_s_jitter_is_no_jerk() -> None:
    """One step late and the next on time: the steps are a period's, whatever the stamps say."""
    close = replace(LAST, stamp_ns=NOW - 2 * MS)
    assert objection(next_to_last(v_mps=1.006, a_mps2=0.04), close, LIMITS, NOW) == ""


def test_the_deceleration_left_at_standstill_ends_there() -> None:
    crawling = Setpoint(NOW - 20 * MS, 0.005, -0.5, 0.0)
    assert objection(Setpoint(NOW, 0.0, 0.0, 0.0), crawling, LIMITS, NOW) == ""


def test_its_own_check_finds_a_gate_that_is_open(monkeypatch: pytest.MonkeyPatch) -> None:
    assert self_check(LIMITS) == ""
    assert "no limits" in self_check(replace(LIMITS, max_speed_mps=math.nan))
    assert "no limits" in self_check(replace(LIMITS, max_jerk_mps3=math.inf))
    assert "no limits" in self_check(replace(LIMITS, max_accel_mps2=0.0))
    odd = GuardLimits(0.01, 0.01, 5.0, 10.0, 100.0, 0.1, 0.1)
    assert self_check(odd) == "", "however odd, they are limits"
    true_gate = guard.objection
    for blind_to, lets_pass in (
        ("not finite", "NaN"),
        ("backwards", "a reversal"),
        ("too fast", "overspeed"),
        ("turns", "too fast a turn"),
        ("accelerates", "a jump of speed"),
        ("jerks", "a jerk"),
        ("the command is 1", "an old command"),
        ("the command is from", "a command from the future"),
    ):

        def blind(*seen: Any, words: str = blind_to) -> str:
            said = true_gate(*seen)
            return "" if said.startswith(words) else said

        monkeypatch.setattr(guard, "objection", blind)
        assert self_check(LIMITS) == f"it lets pass {lets_pass}"
    monkeypatch.setattr(guard, "objection", lambda *_: "no")
    assert self_check(LIMITS) == "it objects to standing still: no"


RIGS: dict[str, Callable[[str], AbstractContextManager[Rig]]] = {
    "agilex": agilex_rig,
    "roboclaw": roboclaw_rig,
    "roboteq": roboteq_rig,
    "kobuki": kobuki_rig,
}


def accelerate(rig: Rig, periods: int) -> ChassisState:
    """0.25 m/s2 after a jerk of 2 m/s3: well within the bounds."""
    v, a = 0.0, 0.0
    for _ in range(periods):
        rig.now_ns += 20 * MS
        rig.emulator.advance_to(rig.now_ns)
        before, a = a, min(a + 0.04, 0.25)
        v += 0.5 * (before + a) * 0.02
        rig.state = rig.chassis.exchange(Setpoint(rig.now_ns, v, a, 0.0), rig.now_ns)
    return rig.state


@pytest.mark.parametrize("kind", RIGS)
def test_the_guard_works_around_every_driver(kind: str) -> None:
    """A right drive passes; a jump stops the base, latches with its reason, and needs consent."""
    with RIGS[kind]("scripted") as rig:
        rig.chassis = GuardedChassis(rig.chassis, LIMITS)
        rig.run(0.2)
        rig.arm()
        state = accelerate(rig, 100)
        assert (state.mode, state.reason) == (ChassisMode.ARMED, "armed")
        assert rig.plant.twist[0] == pytest.approx(0.47, abs=0.05)
        state = rig.step(0.7)
        assert state.mode is ChassisMode.ESTOP
        assert state.reason.startswith("output guard: accelerates too hard: ")
        assert state.sent is None or state.sent.v_mps == 0.0
        state = rig.run(2.0, 0.7)
        assert rig.is_standing()
        assert state.mode is ChassisMode.ESTOP
        rig.chassis.arm(rig.now_ns)
        assert rig.step(0.7).reason.endswith("arming refused: the command is not zero")
        rig.step()
        rig.arm()
        assert accelerate(rig, 50).mode is ChassisMode.ARMED


def test_time_that_runs_backwards_latches() -> None:
    with agilex_rig("scripted") as rig:
        rig.chassis = GuardedChassis(rig.chassis, LIMITS)
        rig.run(0.2)
        rig.arm()
        rig.state = rig.chassis.exchange(None, rig.now_ns - 5 * MS)
        assert rig.state.mode is ChassisMode.ESTOP
        assert "output guard: time runs backwards by 5 ms" in rig.state.reason


def test_guard_accepts_plausible_commands_before_arming() -> None:
    """Nothing of it goes out; the loop's first steps before the base obeys are no violation."""
    with agilex_rig("scripted") as rig:
        rig.chassis = GuardedChassis(rig.chassis, LIMITS)
        assert rig.run(0.5, 0.5).mode is ChassisMode.STANDBY
        assert rig.step(2.0).reason.startswith("output guard: too fast")


def test_none_asks_for_the_stop_and_is_no_violation() -> None:
    with agilex_rig("scripted") as rig:
        rig.chassis = GuardedChassis(rig.chassis, LIMITS)
        rig.run(0.2)
        rig.arm()
        accelerate(rig, 50)
        assert rig.step().mode is ChassisMode.ARMED
        assert rig.step(0.2).mode is ChassisMode.ESTOP, "from rest again, not from before"


def test_a_guard_whose_check_fails_does_not_arm() -> None:
    with agilex_rig("scripted") as rig:
        rig.chassis = GuardedChassis(rig.chassis, replace(LIMITS, max_decel_mps2=math.nan))
        rig.run(0.2)
        rig.chassis.arm(rig.now_ns)
        state = rig.run(0.5)
        assert state.mode is ChassisMode.ESTOP
        assert state.reason.startswith("output guard: its own check fails: its limits are no limits")


def test_the_driver_s_own_latch_is_told_too() -> None:
    with agilex_rig("scripted") as rig:
        rig.chassis = GuardedChassis(rig.chassis, LIMITS)
        rig.run(0.2)
        rig.arm()
        rig.step(math.nan)
        rig.plug.out = True
        state = rig.step()
        assert state.mode is ChassisMode.LOST
        assert state.reason.startswith("output guard: not finite")
        assert state.reason.endswith("unplugged")


def test_a_consent_that_the_driver_refuses_ends_no_latch() -> None:
    """Latched while it drove, and consent comes before it stands: the driver is still stopping."""
    with agilex_rig("scripted") as rig:
        rig.chassis = GuardedChassis(rig.chassis, LIMITS)
        rig.run(0.2)
        rig.arm()
        accelerate(rig, 100)
        assert rig.step(0.7).reason.startswith("output guard: accelerates too hard: ")
        why = rig.step().reason
        rig.chassis.arm(rig.now_ns)
        state = rig.step()
        assert (state.mode, state.reason) == (ChassisMode.ESTOP, f"{why}; arming refused: still stopping")
        assert rig.run(2.0).mode is ChassisMode.ESTOP
        rig.emulator.press_estop()
        rig.run(0.2)
        rig.chassis.arm(rig.now_ns)
        state = rig.step()
        assert state.mode is ChassisMode.ESTOP
        assert state.reason.startswith(why)
        assert state.reason.endswith("arming refused: emergency stop is pressed")
        rig.emulator.release_estop()
        rig.run(0.2)
        rig.chassis.arm(rig.now_ns)
        state = rig.step(0.5)
        assert state.mode is ChassisMode.ARMING
        assert state.reason.startswith("arming: ")
        rig.run(0.2)
        assert rig.step().mode is ChassisMode.ARMED


def test_a_latch_tells_no_refusal_from_before_it() -> None:
    """The driver refused a consent while it stopped; what latches later was refused nothing."""
    with agilex_rig("scripted") as rig:
        rig.chassis = GuardedChassis(rig.chassis, LIMITS)
        rig.run(0.2)
        rig.arm()
        accelerate(rig, 100)
        rig.chassis.stop(rig.now_ns)
        rig.chassis.arm(rig.now_ns)
        assert rig.step().reason.endswith("arming refused: still stopping")
        rig.run(2.0)
        assert rig.step(2.0).reason == "output guard: too fast: 2.000 m/s, at most 1.5"


def test_only_what_is_on_the_list_is_sent() -> None:
    wire = ScriptedCanLink()
    with GuardedCanLink(wire, COMMANDS) as link:
        link.send(CanFrame(0x111, bytes(8)))
        link.send(CanFrame(0x421, b"\x01"))
        for frame in (CanFrame(0x211, bytes(8)), CanFrame(0x421, bytes(2)), CanFrame(0x0, b"")):
            with pytest.raises(LinkLost, match="is not on the list"):
                link.send(frame)
        assert [frame.arbitration_id for frame in wire.sent] == [0x111, 0x421]
        wire.deliver(CanFrame(0x7FF, b""))
        assert link.receive() == CanFrame(0x7FF, b"")
        assert link.receive() is None
