"""Frames byte for byte. Vectors marked S are from the SCOUT manual v1.3.0, B from the BUNKER MINI manual."""

from __future__ import annotations

import math

import pytest

from hal.chassis.agilex_messages import (
    ActuatorFast,
    ActuatorSlow,
    AgilexMessage,
    Battery,
    ClearError,
    ControlModeCommand,
    MotionCommand,
    MotionFeedback,
    Odometer,
    SystemState,
    decode,
    encode,
)
from hal.types import CanFrame

VECTORS: list[tuple[AgilexMessage, int, str]] = [
    (MotionCommand(0.15, 0.0), 0x111, "00 96 00 00 00 00 00 00"),  # S
    (MotionCommand(0.0, 0.05), 0x111, "00 00 00 32 00 00 00 00"),  # S
    (MotionCommand(0.0, 0.2), 0x111, "00 00 00 C8 00 00 00 00"),  # B
    (MotionCommand(-0.5, 0.25), 0x111, "FE 0C 00 FA 00 00 00 00"),
    (MotionCommand(0.25, -0.1), 0x111, "00 FA FF 9C 00 00 00 00"),
    (ControlModeCommand(0), 0x421, "00"),
    (ControlModeCommand(1), 0x421, "01"),
    (ClearError(0), 0x441, "00"),
    (SystemState(1, 3, 48.6, 0x0104, 255), 0x211, "01 03 01 E6 01 04 00 FF"),
    (MotionFeedback(-0.5, 0.25), 0x221, "FE 0C 00 FA 00 00 00 00"),
    (ActuatorFast(0, -120, -1.5, -2), 0x251, "FF 88 FF F1 FF FF FF FE"),
    (ActuatorFast(7, 120, 1.5, 65536), 0x258, "00 78 00 0F 00 01 00 00"),
    (ActuatorSlow(1, 24.5, -3, -4, 0x41), 0x262, "00 F5 FF FD FC 41 00 00"),
    (Odometer(1234, -1), 0x311, "00 00 04 D2 FF FF FF FF"),
    (Odometer(2**31 - 1, -(2**31)), 0x311, "7F FF FF FF 80 00 00 00"),
    (Battery(80, 99, 50.1, -2.5, -10.0), 0x361, "50 63 01 F5 FF E7 FF 9C"),
]


@pytest.mark.parametrize(("message", "arbitration_id", "data"), VECTORS)
def test_encodes_byte_for_byte(message: AgilexMessage, arbitration_id: int, data: str) -> None:
    assert encode(message) == CanFrame(arbitration_id, bytes.fromhex(data))


@pytest.mark.parametrize(("message", "arbitration_id", "data"), VECTORS)
def test_decodes_what_was_encoded(message: AgilexMessage, arbitration_id: int, data: str) -> None:
    decoded = decode(CanFrame(arbitration_id, bytes.fromhex(data)))
    assert type(decoded) is type(message)
    for field in type(message).__slots__:
        assert getattr(decoded, field) == pytest.approx(getattr(message, field), abs=1e-9)


@pytest.mark.parametrize(
    ("v_mps", "data"),
    [
        (0.0004, "00 00"),
        (0.0006, "00 01"),  # int(v * 1000) would say 0
        (-0.0006, "FF FF"),
        (0.2999999, "01 2C"),
        (32.7674, "7F FF"),
        (40.0, "7F FF"),  # int16 would wrap to -25.536 m/s
        (-40.0, "80 00"),
        (1.7e308, "7F FF"),
    ],
)
def test_rounds_to_the_nearest_step_and_holds_at_the_range(v_mps: float, data: str) -> None:
    assert encode(MotionCommand(v_mps, 0.0)).data[:2] == bytes.fromhex(data)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_refuses_to_encode_what_no_frame_can_say(value: float) -> None:
    with pytest.raises(ValueError, match=r"w_radps is (nan|-?inf)"):
        encode(MotionCommand(0.0, value))


def test_an_actuator_that_does_not_exist_is_a_programming_error() -> None:
    with pytest.raises(KeyError):
        encode(ActuatorFast(8, 0, 0.0, 0))


def test_mode_command_padded_to_eight_bytes_is_understood() -> None:
    assert decode(CanFrame(0x421, bytes.fromhex("01 00 00 00 00 00 00 00"))) == ControlModeCommand(1)


@pytest.mark.parametrize(
    "frame",
    [
        CanFrame(0x123, bytes(8)),
        CanFrame(0x221, b""),
        CanFrame(0x221, bytes(7)),
        CanFrame(0x211, bytes(6)),
        CanFrame(0x421, b""),
        CanFrame(0x151, bytes(8)),  # the state frame of protocol V1
    ],
)
def test_unknown_or_short_frames_say_nothing(frame: CanFrame) -> None:
    assert decode(frame) is None
