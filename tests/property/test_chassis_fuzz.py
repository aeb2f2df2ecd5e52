"""Ten million bytes or frames at each decoder: no exception, and no accepted wrong checksum.

Daily the slower ones get a part of it; `pytest --fuzz` gives each the whole.
"""

from __future__ import annotations

import random
from binascii import crc_hqx
from functools import reduce
from operator import xor

import pytest

from hal.chassis import agilex_serial, kobuki_packets, roboclaw_packets
from hal.chassis.agilex_messages import decode, encode
from hal.chassis.roboteq_lines import QUERIES, LineReader, Value
from hal.types import CanFrame

WHOLE = 10_000_000
CHUNK = 4096


@pytest.fixture
def share(request: pytest.FixtureRequest) -> int:
    """How many frames a slow decoder gets."""
    return WHOLE if request.config.getoption("--fuzz") else 50_000


def spiced(rng: random.Random, spices: list[bytes]) -> bytes:
    """A chunk of noise in which about every fiftieth byte begins something well-formed."""
    chunk = bytearray(rng.randbytes(CHUNK))
    for _ in range(80):
        at, spice = rng.randrange(CHUNK - 64), rng.choice(spices)
        chunk[at : at + len(spice)] = spice
    return bytes(chunk)


def test_only_whole_frames_are_taken_from_damaged_kobuki_bytes() -> None:
    rng = random.Random(1)
    core = kobuki_packets.frame(b"\x01\x0f" + bytes(15) + b"\x04\x07" + bytes(7))
    wrong = core[:-1] + bytes((core[-1] ^ 1,))
    reader, right, fed, before = kobuki_packets.FrameReader(), 0, 0, b""
    while fed < WHOLE:
        chunk = spiced(rng, [core, wrong, b"\xaa\x55", core[:9]])
        fed += len(chunk)
        for payload in reader.feed(chunk):
            body = bytes((len(payload),)) + payload
            assert b"\xaa\x55" + body + bytes((reduce(xor, body),)) in before + chunk
            right += kobuki_packets.parse(payload) is not None
        before = chunk
    assert right > 1000
    assert reader.rejected > 1000


def test_kobuki_takes_nothing_that_was_not_sent_whole() -> None:
    """Frames whose checksums are all wrong by one bit, and nothing else: not one gets through."""
    rng = random.Random(2)
    reader = kobuki_packets.FrameReader()
    for _ in range(20_000):
        frame = bytearray(kobuki_packets.frame(b"\x04\x07" + bytes(rng.choices(range(0x50), k=7))))
        frame[-1] ^= 1 << rng.randrange(8)
        assert reader.feed(bytes(frame)) == []


def test_only_whole_values_are_taken_from_damaged_roboteq_bytes() -> None:
    rng = random.Random(3)
    spices = [b"\rC=1:-2\r", b"\rFF=0\r", b"\r+\r", b"\r-\r", b"=", b":", b"C=", b"\r" + b"9" * 50, b"\r?C\r"]
    reader, right, fed = LineReader(), 0, 0
    while fed < WHOLE:
        chunk = spiced(rng, spices)
        fed += len(chunk)
        for line in reader.feed(chunk):
            if isinstance(line, Value):
                assert len(line.values) in QUERIES[line.name].values
                right += 1
    assert right > 1000
    assert reader.foreign_lines > 1000


def test_a_roboclaw_answer_is_accepted_by_its_checksum_alone(share: int) -> None:
    rng = random.Random(4)
    request = roboclaw_packets.STATUS_REQUEST
    right = 0
    for _ in range(share):
        data = rng.randbytes(rng.choice((2, 4)))
        crc = crc_hqx(bytes((0x80, request.command)) + data, 0).to_bytes(2, "big")
        received = data + (crc if rng.random() < 0.5 else rng.randbytes(2))
        accepted = request.accept(0x80, received)
        assert (accepted == data) == (received[-2:] == crc)
        if accepted is not None:
            roboclaw_packets.status(accepted)
            right += 1
    assert right > 0.4 * share


def test_only_whole_frames_are_taken_from_damaged_agilex_bytes() -> None:
    rng = random.Random(6)
    state = agilex_serial.wrap(CanFrame(0x211, bytes(8)), 0) or b""
    wrong = state[:-1] + bytes((state[-1] ^ 1,))
    reader, right, fed, before = agilex_serial.FrameReader(), 0, 0, b""
    while fed < WHOLE:
        chunk = spiced(rng, [state, wrong, b"\x5a\xa5", state[:9]])
        fed += len(chunk)
        for frame in reader.feed(chunk):
            data = (
                frame.data
                if len(frame.data) == 1
                else frame.data[: 6 if frame.arbitration_id == 0x111 else 8]
            )
            assert data in before + chunk
            decode(frame)
            right += 1
        before = chunk
    assert right > 1000
    assert reader.rejected > 1000


def test_no_can_frame_of_noise_is_misread(share: int) -> None:
    rng = random.Random(5)
    ids = (0x211, 0x221, 0x311, 0x361, 0x251, 0x261, 0x111, 0x421)
    right = 0
    for _ in range(share):
        identifier = rng.choice(ids) if rng.random() < 0.9 else rng.randrange(0x800)
        message = decode(CanFrame(identifier, rng.randbytes(rng.choice((8, 8, 8, rng.randrange(9))))))
        if message is not None:
            right += 1
            if right % 64 == 0:
                assert encode(message).arbitration_id == identifier
    assert right > 0.4 * share
