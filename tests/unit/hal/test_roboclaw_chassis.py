"""The RoboClaw driver by the bytes it writes and reads, with a line that misbehaves."""

from __future__ import annotations

import math
import struct

import pytest

from hal.chassis import roboclaw_packets as packets
from hal.chassis.roboclaw import RoboclawChassis
from hal.types import ChassisMode
from tests.support.chassis_rig import roboclaw_config
from tests.support.roboclaw_bench import Bench
from tests.support.serial_bench import arming_failure_reason, every, first_with_speed


def test_the_time_out_is_set_and_read_back_before_arming() -> None:
    bench = Bench()
    bench.run(10)
    assert bench.emulator.timeout_ms == 0
    bench.chassis.arm(bench.now_ns)
    written = []
    while bench.step().mode is not ChassisMode.ARMED:
        written += bench.near.written
    assert bytes.fromhex("80 0E 03 28 36") in written
    assert b"\x80\x0f" in written
    assert bench.emulator.timeout_ms == 300


def test_a_time_out_that_does_not_hold_is_told() -> None:
    bench = Bench()
    bench.emulator.settable_timeout = False
    bench.chassis.arm(0)
    reasons = [bench.step().reason for _ in range(160)]
    waiting = "the base does not take commands: its time-out reads 0 ms, not 300 ms"
    assert f"arming: {waiting}" in reasons
    assert reasons[-1] == f"arming gave up after 3.0 s: {waiting}"


def test_a_lost_setting_is_repeated() -> None:
    bench = Bench()
    bench.run(10)
    lost: list[bytes] = []

    def lose_first_setting(data: bytes) -> bytes:
        if data[1] == packets.SET_TIMEOUT and not lost:
            lost.append(data)
            return b""
        return data

    bench.far.set_filter(lose_first_setting)
    bench.arm()
    assert lost
    assert bench.emulator.timeout_ms == 300


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (packets.SET_TIMEOUT, "it does not acknowledge its time-out (command 14)"),
        (packets.GET_TIMEOUT, "it does not tell its time-out (command 15)"),
    ],
)
def test_a_setting_that_is_never_answered_is_named_and_starves_nothing(command: int, words: str) -> None:
    bench = Bench()
    bench.run(10)
    bench.far.set_filter(lambda data: b"" if data[1] == command else data)
    bench.chassis.arm(bench.now_ns)
    said: list[int] = []
    for _ in range(150):
        state = bench.step()
        assert state.mode is ChassisMode.ARMING
        said += [packet[1] for packet in bench.near.written]
    assert state.reason.startswith(f"arming: the base does not take commands: {words}")
    assert said.count(command) >= 10
    assert said.count(packets.RAMPED_SPEEDS) >= 20, "zeros"
    assert said.count(packets.ENCODERS) >= 10
    assert said.count(packets.STATUS) >= 5
    assert bench.run(5).reason.startswith(
        f"arming gave up after 3.0 s: the base does not take commands: {words}"
    )


def test_a_consent_that_a_lost_link_ended_sets_nothing_later() -> None:
    bench = Bench()
    bench.run(10)
    bench.chassis.arm(bench.now_ns)
    bench.near.unplug()
    assert bench.step().mode is ChassisMode.LOST
    bench.near.plug()
    bench.near.sent.clear()
    bench.run(100)
    assert b"\x80\x28" in bench.near.sent, "it speaks again"
    assert b"\x80\x0e" not in bench.near.sent
    assert bench.emulator.timeout_ms == 0


def test_a_motion_command_whose_answer_is_lost_is_not_repeated() -> None:
    bench = Bench()
    bench.arm()
    bench.near.cut_wire()
    bench.near.sent.clear()
    for k in range(8):
        bench.step(0.1 + 0.01 * k)
    packets_sent = [bytes(bench.near.sent[i : i + 16]) for i in range(0, len(bench.near.sent), 16)]
    motions = [packet for packet in packets_sent if packet[1:2] == bytes((packets.RAMPED_SPEEDS,))]
    assert len(motions) == len(set(motions)), "each is newer than the one before"


def test_motion_packet_byte_for_byte() -> None:
    """0.5 m/s and 0.4 rad/s: tracks of 0.555 m * 1.1 at 20 000 counts a metre."""
    bench = Bench()
    bench.arm()
    while bench.step(0.5, 0.4).sent is None:
        """A query has its turn."""
    half_mps = 0.5 * 0.4 * 0.555 * 1.1
    left, right = round((0.5 - half_mps) * 20_000), round((0.5 + half_mps) * 20_000)
    body = b"\x80\x28" + struct.pack(">Iii", 30_000, left, right)
    assert bench.near.written == [body + packets.crc16(body).to_bytes(2, "big")]
    assert (left, right) == (7558, 12_442)


def test_mirrored_motors_drive_and_count_the_other_way() -> None:
    bench = Bench(invert_right=True)
    bench.arm()
    bench.run(30, 0.5)
    v_mps, w_radps = bench.plant.track_twist
    assert abs(v_mps) < 0.01, "in the emulator motor 2 is not mirrored: it turns on the spot"
    assert abs(w_radps) > 0.3
    assert bench.step(0.5).v_mps > 0.1, "but the driver believes in its mirror"


def test_the_fastest_speed_holds_for_each_track() -> None:
    bench = Bench(max_qpps=10_000)
    bench.arm()
    twists = [(s.sent.v_mps, s.sent.w_radps) for s in (bench.step(0.5, 1.0) for _ in range(4)) if s.sent]
    assert twists
    for v_mps, w_radps in twists:
        assert v_mps + 0.5 * w_radps * 0.555 * 1.1 == pytest.approx(0.5)
        assert w_radps == pytest.approx(2.0 * v_mps)


def test_stop_writes_the_explicit_zero_even_while_an_answer_is_awaited() -> None:
    bench = Bench()
    bench.arm()
    bench.run(20, 0.5)
    bench.near.written.clear()
    bench.chassis.stop(bench.now_ns)
    assert bench.near.written == [bytes.fromhex("80 25 00 00 00 00 00 00 00 00 34 04")]


@pytest.mark.parametrize("steps", range(40, 46))
def test_a_zero_that_replaces_motion_takes_the_next_turn(steps: int) -> None:
    """Whosever turn it is: the first packet after the zero was asked for says zero."""
    bench = Bench()
    bench.arm()
    bench.run(steps, 0.5)
    for _ in range(4):
        state = bench.step(0.0)
        if bench.near.written:
            break
    assert [packet[1] for packet in bench.near.written] == [packets.RAMPED_SPEEDS]
    assert state.sent is not None
    assert (state.sent.v_mps, state.sent.w_radps) == (0.0, 0.0)


def test_wrong_checksums_on_the_line_are_survived() -> None:
    """Every seventh answer is spoilt: the drive goes on, and nothing wrong is believed."""
    bench = Bench()
    bench.arm()
    bench.near.set_filter(every(7, lambda data: bytes((data[0] ^ 0x40,)) + data[1:]))
    states = [bench.step(0.5) for _ in range(400)]
    assert {state.mode for state in states} == {ChassisMode.ARMED}
    assert states[-1].v_mps == pytest.approx(0.5, abs=0.005)
    assert states[-1].pose.x_m == pytest.approx(bench.plant.pose.x_m, abs=0.02)
    assert all(math.isnan(s.v_mps) or abs(s.v_mps) < 0.6 for s in states)


def test_a_restart_between_two_answers_shows_in_the_encoders() -> None:
    bench = Bench()
    bench.arm()
    bench.run(100, 0.5)
    bench.emulator.restart()
    state = bench.run(20, 0.5)
    assert state.mode is ChassisMode.ESTOP
    assert state.reason.startswith("the base no longer obeys: its encoders jumped: restarted")


def test_a_restart_at_rest_shows_in_the_time_out() -> None:
    bench = Bench()
    bench.arm()
    bench.emulator.restart()
    state = bench.run(60)
    assert state.mode is ChassisMode.ESTOP
    assert state.reason.startswith("the base no longer obeys: its time-out reads 0 ms, not 300 ms")


@pytest.mark.parametrize(
    ("bits", "mode", "faults"),
    [
        (0x40, ChassisMode.ESTOP, ("error: motor 1 driver fault",)),
        (0x80000, ChassisMode.ARMED, ("warning: main voltage low",)),
        (0x80000000, ChassisMode.ESTOP, ("error: unknown bit 0x80000000",)),
    ],
)
def test_errors_latch_and_warnings_are_told(bits: int, mode: ChassisMode, faults: tuple[str, ...]) -> None:
    bench = Bench()
    bench.arm()
    bench.emulator.status_bits = bits
    state = bench.run(20, 0.3)
    assert (state.mode, state.faults) == (mode, faults)


def test_nothing_is_known_before_the_second_encoder_answer() -> None:
    """One reading of an encoder is no speed."""
    bench = Bench()
    assert first_with_speed([bench.step() for _ in range(20)]) > 3


@pytest.mark.parametrize(
    ("babble", "hint"),
    [
        (
            b"",
            "not one byte came; check port, power, baud, address 0x80 and that packet serial is on",
        ),
        (b"+\r", "bytes came, none a status with a right checksum; check baud, address 0x80"),
    ],
)
def test_a_device_that_is_no_roboclaw_is_told_when_arming_gives_up(babble: bytes, hint: str) -> None:
    assert hint in arming_failure_reason(lambda link: RoboclawChassis(link, roboclaw_config()), babble)


def test_a_controller_that_takes_questions_but_no_commands_is_left_to_its_time_out() -> None:
    """Questions carry no checksum and feed its time-out: asked on, it would keep the last speed for ever."""
    bench = Bench()
    bench.arm()
    bench.run(100, 0.5)
    bench.far.set_filter(lambda data: data if len(data) < 16 else data[:-1] + bytes((data[-1] ^ 1,)))
    state = bench.run(60, 0.5)
    assert state.mode is ChassisMode.LOST
    assert state.reason.startswith("no motion feedback")
    assert bench.plant.twist[0] == pytest.approx(0.0, abs=0.001)
