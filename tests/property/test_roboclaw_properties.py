"""Hostile input to RoboClaw: no exception, nothing wrong accepted, nothing moves by it."""

from __future__ import annotations

from binascii import crc_hqx

from hypothesis import given, settings
from hypothesis import strategies as st

from hal.chassis import roboclaw_packets as packets
from hal.chassis.roboclaw import RoboclawChassis
from hal.chassis.roboclaw_port import RoboclawPort
from hal.links.scripted import ScriptedSerialLink
from sim.emulators.roboclaw import RoboclawEmulator
from sim.plant import TrackedPlant
from tests.support.chassis_rig import (
    COUNTS_PER_M,
    MS,
    PLANT,
    exchange_amid,
    roboclaw_config,
)

QUERIES = (
    packets.GET_TIMEOUT_REQUEST,
    packets.MAIN_BATTERY_REQUEST,
    packets.CURRENTS_REQUEST,
    packets.ENCODERS_REQUEST,
    packets.STATUS_REQUEST,
)


@settings(max_examples=500)
@given(st.sampled_from(QUERIES), st.binary(max_size=16))
def test_roboclaw_accepts_nothing_but_a_right_checksum(request: packets.Request, received: bytes) -> None:
    data = request.accept(0x80, received)
    if data is not None:
        assert len(data) in request.reply_lengths
        assert crc_hqx(bytes((0x80, request.command)) + data, 0) == int.from_bytes(received[-2:], "big")


@given(st.sampled_from(QUERIES), st.data())
def test_roboclaw_accepts_every_right_answer(request: packets.Request, data: st.DataObject) -> None:
    length = data.draw(st.sampled_from(request.reply_lengths))
    content = data.draw(st.binary(min_size=length, max_size=length))
    checksum = crc_hqx(bytes((0x80, request.command)) + content, 0).to_bytes(2, "big")
    assert request.accept(0x80, content + checksum) == content


@given(st.binary(min_size=2, max_size=2) | st.binary(min_size=4, max_size=4))
def test_every_set_bit_of_a_roboclaw_status_is_told(data: bytes) -> None:
    status = packets.status(data)
    told = len(status.errors) + len(status.warnings) + status.estop
    assert told == int.from_bytes(data, "big").bit_count()


@settings(max_examples=50)
@given(st.lists(st.binary(max_size=12), max_size=60), st.lists(st.integers(1, 40), min_size=60, max_size=60))
def test_roboclaw_port_survives_any_bytes_and_always_comes_to_rest(
    chunks: list[bytes], steps_ms: list[int]
) -> None:
    link = ScriptedSerialLink()
    port = RoboclawPort(link, 0x80)
    now_ns = 0
    for k, (chunk, step_ms) in enumerate(zip(chunks, steps_ms, strict=False)):
        if port.idle(now_ns):
            port.start(QUERIES[k % len(QUERIES)], now_ns)
        link.deliver(chunk)
        now_ns += step_ms * MS
        port.poll(now_ns)
    for _ in range(5):
        now_ns += 20 * MS
        port.poll(now_ns)
    assert port.idle(now_ns)


@settings(max_examples=50)
@given(st.lists(st.binary(max_size=20), max_size=60))
def test_roboclaw_driver_survives_any_bytes(chunks: list[bytes]) -> None:
    link = ScriptedSerialLink()
    chassis = RoboclawChassis(link, roboclaw_config())
    exchange_amid(chassis, link, chunks)


@settings(max_examples=50)
@given(st.lists(st.binary(max_size=20), max_size=40))
def test_roboclaw_emulator_moves_only_by_right_checksums(chunks: list[bytes]) -> None:
    link = ScriptedSerialLink()
    claw = RoboclawEmulator(link, TrackedPlant(PLANT), counts_per_m=COUNTS_PER_M)
    for k, chunk in enumerate(chunks, start=1):
        link.deliver(chunk)
        claw.advance_to(k * 5 * MS)
    if not claw.commands_obeyed:
        assert claw.plant.track_travel_m == (0.0, 0.0)
