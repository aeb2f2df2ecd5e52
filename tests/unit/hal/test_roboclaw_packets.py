"""Packets byte for byte; the vectors were computed from the manual's CRC (p. 59) and checked."""

from __future__ import annotations

import math

import pytest

from hal.chassis import roboclaw_packets as packets
from hal.chassis.roboclaw_packets import Request

ADDRESS = 0x80


def test_crc_of_the_standard_check_string() -> None:
    assert packets.crc16(b"123456789") == 0x31C3


@pytest.mark.parametrize(
    ("request_", "data"),
    [
        (packets.speeds(1000, 1000), "80 25 00 00 03 E8 00 00 03 E8 EA B0"),
        (packets.speeds(0, 0), "80 25 00 00 00 00 00 00 00 00 34 04"),
        (packets.speeds(-1000, 1000), "80 25 FF FF FC 18 00 00 03 E8 B0 67"),
        (packets.ramped_speeds(2000, 1000, 1000), "80 28 00 00 07 D0 00 00 03 E8 00 00 03 E8 00 97"),
        (Request(34, bytes.fromhex("40 00 E0 00")), "80 22 40 00 E0 00 E6 39"),
        (packets.set_timeout(300), "80 0E 03 28 36"),
        (packets.STATUS_REQUEST, "80 5A"),  # reads carry no CRC
        (packets.ENCODERS_REQUEST, "80 4E"),
        (packets.GET_TIMEOUT_REQUEST, "80 0F"),
        (packets.MAIN_BATTERY_REQUEST, "80 18"),
        (packets.CURRENTS_REQUEST, "80 31"),
    ],
)
def test_requests_byte_for_byte(request_: Request, data: str) -> None:
    assert request_.packet(ADDRESS) == bytes.fromhex(data)


def test_speeds_are_rounded_and_held_at_int32() -> None:
    assert packets.speeds(1.6, -1.6).payload == bytes.fromhex("00 00 00 02 FF FF FF FE")
    assert packets.speeds(1e12, -1e12).payload == bytes.fromhex("7F FF FF FF 80 00 00 00")
    assert packets.ramped_speeds(1e12, 0, 0).payload[:4] == bytes.fromhex("FF FF FF FF")
    assert packets.speeds(math.inf, -math.inf).payload == bytes.fromhex("7F FF FF FF 80 00 00 00")
    with pytest.raises(ValueError, match="NaN"):
        packets.speeds(math.nan, 0)


@pytest.mark.parametrize(("timeout_ms", "value"), [(0, 1), (100, 1), (260, 3), (25_500, 255), (99_999, 255)])
def test_timeout_is_never_switched_off(timeout_ms: int, value: int) -> None:
    assert packets.set_timeout(timeout_ms).payload == bytes((value,))


def test_reply_e_stop_byte_for_byte() -> None:
    data = packets.STATUS_REQUEST.accept(ADDRESS, bytes.fromhex("00 00 00 01 97 9D"))
    assert data is not None
    assert packets.status(data) == packets.Status(estop=True, errors=(), warnings=())


def reply(request: Request, data: bytes) -> bytes:
    """As the controller answers it."""
    return data + packets.crc16(bytes((ADDRESS, request.command)) + data).to_bytes(2, "big")


def test_every_value_of_the_replies_is_decoded() -> None:
    assert packets.timeout_ms(b"\x03") == 300
    assert packets.main_battery_v(bytes.fromhex("00 FC")) == 25.2
    assert packets.currents_a(bytes.fromhex("00 64 FF 9C")) == (1.0, -1.0)
    assert packets.encoders(bytes.fromhex("FF FF FF FF 00 00 00 10")) == (0xFFFFFFFF, 16)


def test_a_reply_is_accepted_only_whole_and_with_its_checksum() -> None:
    request = packets.ENCODERS_REQUEST
    good = reply(request, bytes(range(8)))
    assert request.accept(ADDRESS, good) == bytes(range(8))
    assert request.accept(ADDRESS, good[:-1]) is None
    assert request.accept(ADDRESS, good + b"\x00") is None
    assert request.accept(ADDRESS, b"") is None
    assert request.accept(ADDRESS + 1, good) is None, "another controller's answer"
    assert packets.STATUS_REQUEST.accept(ADDRESS, good) is None, "the answer to another request"
    for bit in range(8 * len(good)):
        wrong = bytearray(good)
        wrong[bit // 8] ^= 1 << bit % 8
        assert request.accept(ADDRESS, bytes(wrong)) is None


@pytest.mark.parametrize("received", [b"", b"\x00", b"\xfe", b"\xff\xff", b"\xff\x00"])
def test_only_ff_acknowledges(received: bytes) -> None:
    assert packets.speeds(0, 0).accept(ADDRESS, received) is None
    assert packets.speeds(0, 0).accept(ADDRESS, b"\xff") == b""


def test_the_two_status_layouts_are_told_apart_by_length() -> None:
    """0x4 is the emergency stop in two bytes, a hot sensor in four; 0x1 is over-current and e-stop."""
    old = packets.status(bytes.fromhex("00 04"))
    new = packets.status(bytes.fromhex("00 00 00 04"))
    assert (old.estop, old.errors) == (True, ())
    assert (new.estop, new.errors) == (False, ("error: second board sensor too hot",))
    assert packets.status(bytes.fromhex("00 01")).warnings == ("warning: motor 1 over-current",)
    assert packets.status(bytes.fromhex("00 00 00 01")).estop


def test_every_set_bit_of_a_status_is_named() -> None:
    status = packets.status(bytes.fromhex("80 0C 40 00"))
    assert status.errors == (
        "error: main voltage low: motors roll free",
        "error: unknown bit 0x80000000",
    )
    assert status.warnings == ("warning: main voltage high", "warning: main voltage low")
    for length in (2, 4):
        everything = packets.status(b"\xff" * length)
        assert len(everything.errors) + len(everything.warnings) + 1 == 8 * length
