"""Kobuki's frames byte for byte; the vectors follow kobuki_core."""

from __future__ import annotations

import math
import struct

import pytest

from hal.chassis import kobuki_packets as packets
from hal.chassis.kobuki_packets import Core, Feedback, FrameReader, Inertia


@pytest.mark.parametrize(
    ("v_mps", "w_radps", "data"),
    [
        (0.0, 0.0, "AA 55 06 01 04 00 00 00 00 03"),
        (0.1, 0.0, "AA 55 06 01 04 64 00 00 00 67"),
        (0.0, 1.0, "AA 55 06 01 04 73 00 01 00 71"),
        (0.3, 0.5, "AA 55 06 01 04 65 01 58 02 3D"),
    ],
)
def test_base_control_byte_for_byte(v_mps: float, w_radps: float, data: str) -> None:
    assert packets.base_control(v_mps, w_radps) == bytes.fromhex(data)


def test_version_request_byte_for_byte() -> None:
    assert packets.frame(bytes.fromhex("09 02 0B 00")) == bytes.fromhex("AA 55 04 09 02 0B 00 04")


def said(v_mps: float, w_radps: float) -> tuple[int, int]:
    """(speed, radius) on the wire."""
    speed, radius = struct.unpack("<hh", packets.base_control(v_mps, w_radps)[5:9])
    return speed, radius


@pytest.mark.parametrize(
    ("v_mps", "w_radps", "wire"),
    [
        (-0.1, 0.0, (-100, 0)),
        (0.0, -1.0, (-115, 1)),
        (0.3, -0.5, (357, -600)),
        (-0.3, 0.5, (-357, -600)),
        (-0.3, -0.5, (-357, 600)),
        (0.5, 0.001, (500, 0)),  # a radius of 500 m does not fit the wire, and must not wrap
        (40.0, 0.0, (32767, 0)),
        (0.0, -1e9, (-32767, 1)),
    ],
)
def test_twists_become_speed_and_radius_within_int16(
    v_mps: float, w_radps: float, wire: tuple[int, int]
) -> None:
    assert said(v_mps, w_radps) == wire


def test_nan_is_not_encoded() -> None:
    with pytest.raises(ValueError, match="NaN"):
        packets.base_control(math.nan, 0.0)


# Clock 1000 ms, bumper centre, wheel drop left, cliff right, ticks 65535 and 1, 16.2 V, right over-current.
CORE = bytes.fromhex("01 0F E8 03 02 02 01 FF FF 01 00 00 00 00 00 A2 02")
INERTIA = bytes.fromhex("04 07 28 23 18 FC 00 00 00")  # 90 degrees, -10 degrees a second


def test_every_value_of_a_frame_is_decoded() -> None:
    told = packets.parse(CORE + INERTIA + bytes.fromhex("06 02 64 0A"))
    assert told is not None
    assert told.core == Core(1000, 2, 2, 1, 65_535, 1, 0, 16.2, 2)
    assert told.inertia == Inertia(math.radians(90.0), math.radians(-10.0))
    assert told.currents_a == (1.0, 0.1)


def test_a_frame_may_hold_less_or_more() -> None:
    assert packets.parse(b"") == Feedback()
    assert packets.parse(INERTIA) is not None
    assert packets.parse(bytes.fromhex("0B 04 00 02 01 00")) == Feedback(), "what is not needed is skipped"


@pytest.mark.parametrize(
    "payload",
    [CORE[:-1], CORE + b"\x04", CORE + b"\x04\x07\x00", b"\x01\x0e" + CORE[2:-1], b"\x04\x06" + bytes(6)],
)
def test_sub_payloads_that_do_not_fit_are_nothing(payload: bytes) -> None:
    assert packets.parse(payload) is None


def test_frames_are_found_however_the_bytes_arrive() -> None:
    stream = b"\x55\xaa" + packets.frame(CORE) + b"\xaa\xaa\x55noise" + packets.frame(INERTIA) + b"\xaa"
    whole = FrameReader().feed(stream + packets.frame(CORE)[1:])
    assert whole[0] == CORE
    reader = FrameReader()
    pieces = [payload for byte in stream for payload in reader.feed(bytes((byte,)))]
    pieces += reader.feed(packets.frame(CORE)[1:])
    # "noise" claims a length of 110: only when so much has come can what follows be found behind it.
    pieces += reader.feed(bytes(120))
    assert pieces == [CORE, INERTIA, CORE]


def test_a_wrong_checksum_hides_no_frame_behind_it() -> None:
    wrong = bytearray(packets.frame(CORE))
    wrong[-1] ^= 0x20
    reader = FrameReader()
    assert reader.feed(bytes(wrong) + packets.frame(INERTIA)) == [INERTIA]
    assert reader.rejected == 1


def test_every_single_wrong_bit_is_noticed() -> None:
    good = packets.frame(CORE)
    for bit in range(8 * len(good)):
        wrong = bytearray(good)
        wrong[bit // 8] ^= 1 << bit % 8
        assert CORE not in FrameReader().feed(bytes(wrong) + bytes(300))


def test_noise_does_not_grow_for_ever() -> None:
    reader = FrameReader()
    for _ in range(100):
        reader.feed(b"\x00\x01\x02\xaa" * 100)
    assert len(reader._buffer) <= 1
