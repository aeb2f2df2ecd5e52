"""The AgileX driver by the frames it sends and the frames it hears, without an emulator."""

from __future__ import annotations

import math

import pytest

from hal.chassis.agilex import AgilexChassis
from hal.chassis.agilex_messages import (
    ActuatorSlow,
    Battery,
    ControlModeCommand,
    MotionCommand,
    MotionFeedback,
    SystemState,
)
from hal.links.scripted import ScriptedCanLink
from hal.types import CanFrame, ChassisMode, Setpoint
from tests.support.agilex_bench import CAN, REMOTE, SERIAL, STANDBY, Bench, state
from tests.support.chassis_rig import MS, agilex_config, agilex_rig, can_link_config


def test_standby_says_zero_and_leaves_the_mode_alone() -> None:
    bench = Bench()
    bench.exchange()
    assert bench.link.sent == [CanFrame(0x111, bytes(8))]


def test_arming_sends_the_mode_until_the_base_is_in_it_and_never_again() -> None:
    """A base that restarts must not be taken out of standby by a repeated 0x421."""
    bench = Bench()
    bench.chassis.arm(0)
    modes = []
    for _ in range(6):
        bench.deliver(state(STANDBY), MotionFeedback(0.0, 0.0))
        bench.exchange()
        modes += [message for message in bench.sent() if isinstance(message, ControlModeCommand)]
    assert modes == [ControlModeCommand(CAN)] * 3
    bench.deliver(state(CAN), MotionFeedback(0.0, 0.0))
    assert bench.exchange().mode is ChassisMode.ARMED
    for _ in range(50):
        bench.deliver(state(CAN), MotionFeedback(0.0, 0.0))
        bench.exchange(0.1)
        assert bench.sent() == [MotionCommand(0.1, 0.0)]


def test_frames_that_waited_in_the_port_do_not_answer_the_consent() -> None:
    """Frames from before a restart may still say that the base obeys."""
    bench = Bench()
    bench.exchange()
    bench.deliver(state(CAN), MotionFeedback(0.0, 0.0))
    bench.chassis.arm(bench.now_ns)
    seen = bench.exchange()
    assert (seen.mode, seen.reason) == (ChassisMode.ARMING, "arming: no status heard from the base")
    bench.deliver(state(CAN), MotionFeedback(0.0, 0.0))
    assert bench.exchange().mode is ChassisMode.ARMED


def test_the_frames_of_a_drive_byte_for_byte() -> None:
    bench = Bench()
    bench.chassis.arm(0)
    bench.exchange()
    assert bench.link.sent == [CanFrame(0x111, bytes(8)), CanFrame(0x421, b"\x01")]
    bench.arm()
    bench.exchange(-0.5, 0.25)
    assert bench.link.sent == [CanFrame(0x111, bytes.fromhex("FE 0C 00 FA 00 00 00 00"))]
    bench.link.sent.clear()
    bench.chassis.stop(bench.now_ns)
    assert bench.link.sent == [CanFrame(0x111, bytes(8)), CanFrame(0x421, b"\x00")]


@pytest.mark.parametrize(("loop_ms", "sent"), [(5, 50), (10, 50), (16, 62), (20, 50), (40, 25)])
def test_one_command_each_period_whatever_the_loop(loop_ms: int, sent: int) -> None:
    bench = Bench()
    bench.arm()
    count = 0
    for k in range(1000 // loop_ms):
        if k * loop_ms // 20 > (k - 1) * loop_ms // 20:
            bench.deliver(state(), MotionFeedback(0.0, 0.0))
        bench.exchange(0.1, after_ms=loop_ms)
        count += len(bench.link.sent)
    assert count == pytest.approx(sent, abs=1 if loop_ms >= 16 else 17)


def test_a_loop_with_jitter_misses_no_period() -> None:
    bench = Bench()
    bench.arm()
    for after_ms in (20, 18, 23, 17, 21, 20, 19):
        bench.deliver(MotionFeedback(0.0, 0.0))
        bench.exchange(0.1, after_ms=after_ms)
        assert bench.sent() == [MotionCommand(0.1, 0.0)]


def test_a_zero_that_replaces_motion_does_not_wait_for_the_period() -> None:
    bench = Bench()
    bench.arm()
    bench.exchange(0.5)
    assert bench.exchange(0.6, after_ms=1).sent is None
    state_ = bench.exchange(0.0, after_ms=1)
    assert state_.sent is not None
    assert bench.sent() == [MotionCommand(0.0, 0.0)]
    bench.exchange(0.0, after_ms=1)
    assert bench.sent() == []


def test_limits_of_the_model_hold_on_the_wire() -> None:
    bench = Bench()
    bench.arm()
    bench.exchange(9.0, 0.0)
    assert bench.sent() == [MotionCommand(3.0, 0.0)]
    bench.deliver(MotionFeedback(0.0, 0.0))
    bench.exchange(0.0, -9.0)
    assert bench.sent() == [MotionCommand(0.0, -2.524)], "-2.5235 rad/s, rounded"


@pytest.mark.parametrize(
    ("said", "reason"),
    [
        (state(vehicle=1), "emergency stop is pressed"),
        (state(vehicle=2, faults=0x0104), "exception (vehicle state 2: system fault: unknown bit 0x0004"),
        (state(vehicle=77), "exception (vehicle state 77: no fault named)"),
        (state(mode=REMOTE), "remote control has taken over: switch it to command mode (SWB up), or off"),
        (state(mode=SERIAL), "serial has taken over"),
        (state(mode=STANDBY), "no longer obeys: control mode is standby"),
        (state(mode=9), "no longer obeys: control mode is unknown mode 9"),
    ],
)
def test_state_reported_by_the_base_can_latch(said: SystemState, reason: str) -> None:
    bench = Bench()
    bench.arm()
    bench.exchange(0.5)
    bench.deliver(said, MotionFeedback(0.5, 0.0))
    seen = bench.exchange(0.5)
    assert seen.mode is ChassisMode.ESTOP
    assert reason in seen.reason
    assert MotionCommand(0.0, 0.0) in bench.sent(), "zero in the very exchange"
    modes = []
    for _ in range(2):
        bench.deliver(state(), MotionFeedback(0.0, 0.0))
        assert bench.exchange(0.5).mode is ChassisMode.ESTOP
        modes += [message for message in bench.sent() if isinstance(message, ControlModeCommand)]
    assert modes == [ControlModeCommand(STANDBY)], "a base that still obeys is taken out of command mode"


def test_a_remote_control_is_left_in_charge() -> None:
    bench = Bench()
    bench.arm()
    bench.deliver(state(mode=REMOTE))
    for _ in range(10):
        bench.exchange(0.5)
        assert all(isinstance(message, MotionCommand) for message in bench.sent()), "no 0x421"


def test_silence_of_the_system_state_alone_is_a_loss() -> None:
    """Without 0x211 nobody would notice the emergency stop."""
    bench = Bench()
    bench.arm()
    for _ in range(40):
        bench.deliver(MotionFeedback(0.0, 0.0))
        seen = bench.exchange()
    assert (seen.mode, seen.reason) == (ChassisMode.LOST, "no status for 720 ms")


def test_faults_are_sentences_and_unknown_bits_are_not_swallowed() -> None:
    bench = Bench()
    bench.deliver(state(STANDBY, faults=0x8001), ActuatorSlow(1, 48.0, 30, 30, 0x40 | 0x21))
    assert bench.exchange().faults == (
        "system fault: unknown bit 0x0001",
        "system fault: unknown bit 0x8000",
        "driver 1: supply voltage low",
        "driver 1: driver fault",
    )
    bench.deliver(state(STANDBY), ActuatorSlow(1, 48.0, 30, 30, 0x40))
    assert bench.exchange().faults == ()


def test_fault_bits_alone_do_not_stop_the_drive() -> None:
    """Several models set "remote control lost" whenever it is switched off."""
    bench = Bench()
    bench.arm()
    bench.deliver(state(faults=0x0004), MotionFeedback(0.0, 0.0))
    seen = bench.exchange(0.2)
    assert seen.mode is ChassisMode.ARMED
    assert seen.faults == ("system fault: unknown bit 0x0004",)


def test_battery_from_either_frame() -> None:
    bench = Bench()
    assert math.isnan(bench.exchange().battery_v)
    bench.deliver(Battery(80, 100, 47.5, 0.0, 20.0))
    assert bench.exchange().battery_v == pytest.approx(47.5)
    bench.deliver(state(battery_v=48.5))
    assert bench.exchange().battery_v == pytest.approx(48.5)


def test_a_write_that_fails_is_a_lost_link_in_the_same_exchange() -> None:
    bench = Bench()
    bench.arm()
    bench.link.fail_writes(1)
    seen = bench.exchange(0.5)
    assert (seen.mode, seen.sent) == (ChassisMode.LOST, None)


def test_a_lost_link_is_tried_again_twice_a_second() -> None:
    bench = Bench()
    tries = []

    class CountingLink(ScriptedCanLink):
        def receive(self) -> CanFrame | None:
            tries.append(bench.now_ns)
            return super().receive()

    link = CountingLink()
    bench.chassis = AgilexChassis(link, agilex_config())
    link.unplug()
    for _ in range(100):
        bench.exchange()
    assert len(tries) == 4
    link.plug()
    bench.exchange(after_ms=500)
    assert link.sent == [CanFrame(0x111, bytes(8))], "speaks again, but zero"


def test_a_lost_link_is_left_alone_after_a_try_that_took_long() -> None:
    """Two seconds for a port that does not answer, and the loop goes on for half a second before the next."""
    bench = Bench()
    tries = []

    class SlowLink(ScriptedCanLink):
        def receive(self) -> CanFrame | None:
            tries.append(bench.now_ns // MS)
            return super().receive()

    link = SlowLink()
    bench.chassis = AgilexChassis(link, agilex_config())
    link.unplug()
    bench.exchange()
    bench.exchange(after_ms=2000)
    for _ in range(40):
        bench.exchange()
    assert tries == [20, 2520]


def test_a_flood_does_not_hold_the_loop() -> None:
    bench = Bench()
    for _ in range(1000):
        bench.deliver(MotionFeedback(0.0, 0.0))
    bench.exchange()
    heard = 0
    while bench.link.receive() is not None:
        heard += 1
    assert heard == 1000 - 256


def test_an_old_command_stops_and_latches() -> None:
    bench = Bench()
    bench.arm()
    old = Setpoint(bench.now_ns, 0.5, 0.0, 0.0)
    for _ in range(5):
        bench.now_ns += 20 * MS
        bench.deliver(MotionFeedback(0.0, 0.0))
        assert bench.chassis.exchange(old, bench.now_ns).mode is ChassisMode.ARMED
    bench.now_ns += 20 * MS
    seen = bench.chassis.exchange(old, bench.now_ns)
    assert (seen.mode, seen.reason) == (ChassisMode.ESTOP, "the command is 120 ms old")


def test_two_lives_alike_to_the_bit() -> None:
    """Same steps, same states: what lock-step simulation rests on."""

    def life() -> list[str]:
        with agilex_rig("bus", can_link_config()) as rig:
            rig.run(0.2)
            rig.arm()
            return [repr(rig.step(0.004 * k, 0.002 * k)) for k in range(150)]

    assert life() == life()
