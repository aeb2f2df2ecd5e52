"""AgileX over RS-232 byte for byte. The first vector is from the SCOUT manual v1.3.0, 3.4.2."""

from __future__ import annotations

import pytest

from config.chassis import SerialLinkConfig
from hal.chassis.agilex import AgilexChassis
from hal.chassis.agilex_messages import (
    ActuatorFast,
    ActuatorSlow,
    AgilexMessage,
    ClearError,
    ControlModeCommand,
    MotionCommand,
    MotionFeedback,
    Odometer,
    SystemState,
    decode,
    encode,
)
from hal.chassis.agilex_serial import AgilexSerialBus, FrameReader, wrap
from hal.links.scripted import ScriptedSerialLink
from hal.types import CanFrame, ChassisMode, ChassisState, Setpoint
from tests.support.chassis_rig import MS, agilex_config

VECTORS: list[tuple[AgilexMessage, int, str]] = [
    (MotionCommand(0.15, 0.0), 0, "5A A5 0A 55 01 00 96 00 00 00 00 00 F5"),
    (MotionCommand(-0.5, 0.25), 255, "5A A5 0A 55 01 FE 0C 00 FA 00 00 FF 62"),
    (ControlModeCommand(2), 1, "5A A5 05 55 02 02 01 5E"),
    (ControlModeCommand(0), 0, "5A A5 05 55 02 00 00 5B"),
    (ClearError(0), 0, "5A A5 05 55 03 00 00 5C"),
    (SystemState(1, 2, 24.5, 0x0300, 0), 7, "5A A5 0C AA 01 01 02 00 F5 03 00 00 00 07 B8"),
    (MotionFeedback(-0.5, 0.25), 0, "5A A5 0C AA 02 FE 0C 00 FA 00 00 00 00 00 BB"),
    (ActuatorFast(0, 120, 1.5, 65536), 0, "5A A5 0C AA 03 00 78 00 0F 00 01 00 00 00 40"),
    (ActuatorSlow(3, 24.5, -3, -4, 1), 0, "5A A5 0C AA 0A 00 F5 FF FD FC 01 00 00 00 AD"),
    (Odometer(1234, -1), 0, "5A A5 0C AA A2 00 00 04 D2 FF FF FF FF 00 29"),
]


@pytest.mark.parametrize(("message", "count", "data"), VECTORS)
def test_every_message_is_written_byte_for_byte(message: AgilexMessage, count: int, data: str) -> None:
    assert wrap(encode(message), count) == bytes.fromhex(data)


@pytest.mark.parametrize(("message", "count", "data"), VECTORS)
def test_understands_what_was_said(message: AgilexMessage, count: int, data: str) -> None:
    reader = FrameReader()
    (frame,) = reader.feed(bytes.fromhex(data))
    decoded = decode(frame)
    assert type(decoded) is type(message)
    for name in type(message).__slots__:
        assert getattr(decoded, name) == pytest.approx(getattr(message, name), abs=1e-9)
    assert (reader.rejected, reader.foreign_frames) == (0, 0)


def test_frame_without_a_serial_form_is_not_sent() -> None:
    assert wrap(CanFrame(0x361, bytes(8)), 0) is None
    link = ScriptedSerialLink()
    AgilexSerialBus(link).send(CanFrame(0x255, bytes(8)))
    assert bytes(link.sent) == b""


def test_frames_are_counted() -> None:
    link = ScriptedSerialLink()
    bus = AgilexSerialBus(link)
    for _ in range(258):
        bus.send(encode(ControlModeCommand(2)))
    assert [data[-2] for data in link.written] == [*range(256), 0, 1]


GOOD = bytes.fromhex(VECTORS[6][2])
FRAME = encode(MotionFeedback(-0.5, 0.25))


def test_merged_partial_and_noisy_reads_lose_nothing_that_was_whole() -> None:
    stream = b"\x5a" + GOOD + b"\xff\x5a\xa5" + GOOD[2:3] + GOOD + b"\x5a\xa5\xff" + GOOD + GOOD[:7]
    whole = FrameReader().feed(stream)
    assert whole == [FRAME] * 3
    for size in (1, 2, 3, 7):
        reader = FrameReader()
        assert [f for k in range(0, len(stream), size) for f in reader.feed(stream[k : k + size])] == whole
        assert reader.feed(GOOD[7:]) == [FRAME], "the beginning of the next one was kept"


@pytest.mark.parametrize("bit", range(8))
@pytest.mark.parametrize("position", range(2, len(GOOD)))
def test_no_frame_with_one_wrong_bit_is_taken(position: int, bit: int) -> None:
    wrong = bytearray(GOOD)
    wrong[position] ^= 1 << bit
    assert FrameReader().feed(bytes(wrong)) == []


def test_another_layout_with_a_right_checksum_is_a_stranger() -> None:
    """TRACER: the same envelope around six bytes of system state."""
    body = bytes.fromhex("5A A5 0A AA 01 00 02 00 F5 00 00 00")
    reader = FrameReader()
    assert reader.feed(body + bytes((sum(body) % 256,))) == []
    assert reader.foreign_frames == 1


def test_short_reads_leave_no_frame_behind() -> None:
    link = ScriptedSerialLink()
    link.limit_reads(3)
    bus = AgilexSerialBus(link)
    frames = [encode(MotionFeedback(0.1 * k, 0.0)) for k in range(3)]
    for frame in frames:
        link.deliver(wrap(frame, 0) or b"")
    assert [bus.receive() for _ in range(4)] == [*frames, None]


class Bench:
    """The driver on a serial line, and a hand that says what the base says."""

    def __init__(self) -> None:
        self.link = ScriptedSerialLink()
        self.bus = AgilexSerialBus(self.link)
        config = agilex_config(
            SerialLinkConfig(url="loop://"), model="scout", track_width_m=None, slip_factor=1.0
        )
        self.chassis = AgilexChassis(self.bus, config, self.bus.silence_hint)
        self.now_ns = 0

    def exchange(self, v_mps: float | None = None, *said: AgilexMessage) -> ChassisState:
        for message in said:
            data = wrap(encode(message), 0)
            assert data is not None
            self.link.deliver(data)
        self.now_ns += 20 * MS
        self.link.written.clear()
        command = None if v_mps is None else Setpoint(self.now_ns, v_mps, 0.0, 0.0)
        return self.chassis.exchange(command, self.now_ns)


def state(mode: int) -> SystemState:
    return SystemState(0, mode, 25.0, 0, 0)


def test_arms_in_serial_mode_and_drives() -> None:
    bench = Bench()
    bench.chassis.arm(0)
    assert bench.exchange(None, state(0), MotionFeedback(0.0, 0.0)).mode is ChassisMode.ARMING
    assert [data[:6] for data in bench.link.written] == [
        bytes.fromhex("5A A5 0A 55 01 00"),
        bytes.fromhex("5A A5 05 55 02 02"),
    ]
    assert bench.exchange(None, state(2), MotionFeedback(0.0, 0.0)).mode is ChassisMode.ARMED
    bench.exchange(0.15, state(2), MotionFeedback(0.0, 0.0))
    (said,) = bench.link.written
    assert said[:-2] == bytes.fromhex("5A A5 0A 55 01 00 96 00 00 00 00")
    seen = bench.exchange(0.15, state(1), MotionFeedback(0.0, 0.0))
    assert (seen.mode, seen.reason) == (ChassisMode.ESTOP, "CAN has taken over")


@pytest.mark.parametrize(
    ("heard", "hint"),
    [
        (b"", "not one byte came; check port, power and that RX and TX are crossed"),
        (b"\x00\xff" * 10, "bytes came, not one frame with a right checksum; check baud (115200)"),
        (
            bytes.fromhex("5A A5 0A AA 01 00 02 00 F5 00 00 00 AB"),
            "but of another protocol; check chassis.model",
        ),
        (GOOD, "0x221 came, but no 0x211"),
    ],
)
def test_failed_arming_reports_what_was_received_instead(heard: bytes, hint: str) -> None:
    bench = Bench()
    bench.chassis.arm(0)
    for _ in range(160):
        bench.link.deliver(heard)
        seen = bench.exchange()
    assert seen.mode is ChassisMode.STANDBY
    assert seen.reason.startswith("arming gave up after 3.0 s: no status heard from the base: ")
    assert hint in seen.reason
