"""Hostile input to AgileX: no exception, nothing wrong accepted, nothing moves by it."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from config.chassis import SerialLinkConfig
from hal.chassis import agilex_serial
from hal.chassis.agilex import AgilexChassis
from hal.chassis.agilex_messages import MotionCommand, Odometer, decode, encode
from hal.links.scripted import ScriptedCanLink, ScriptedSerialLink
from hal.types import CanFrame, Setpoint
from tests.support.chassis_rig import (
    MS,
    agilex_config,
    check_state,
    exchange_amid,
)

AGILEX_IDS = (
    0x111,
    0x421,
    0x441,
    0x211,
    0x221,
    0x311,
    0x361,
    *range(0x251, 0x259),
    *range(0x261, 0x269),
)
frames = st.builds(
    CanFrame, st.one_of(st.sampled_from(AGILEX_IDS), st.integers(0, 0x7FF)), st.binary(max_size=8)
)
finite = st.floats(allow_nan=False, allow_infinity=False)


@settings(max_examples=500)
@given(frames)
def test_agilex_decodes_anything_without_an_exception(frame: CanFrame) -> None:
    message = decode(frame)
    if message is not None:
        again = encode(message)
        assert again.arbitration_id == frame.arbitration_id
        assert decode(again) == message, "what was understood can be said"


@given(finite, finite)
def test_agilex_motion_is_never_further_off_than_half_a_step_or_the_range(v: float, w: float) -> None:
    sent = decode(encode(MotionCommand(v, w)))
    assert isinstance(sent, MotionCommand)
    for asked, went in ((v, sent.v_mps), (w, sent.w_radps)):
        held = min(max(asked, -32.768), 32.767)
        assert abs(went - held) <= 0.0005 + 1e-9
        assert went * asked >= 0.0, "never the other way"


@given(st.integers(-(2**31), 2**31 - 1), st.integers(-(2**31), 2**31 - 1))
def test_agilex_odometer_round_trip(left_mm: int, right_mm: int) -> None:
    assert decode(encode(Odometer(left_mm, right_mm))) == Odometer(left_mm, right_mm)


@settings(max_examples=50)
@given(st.lists(st.lists(frames, max_size=6), max_size=20))
def test_agilex_driver_survives_any_frames(bursts: list[list[CanFrame]]) -> None:
    link = ScriptedCanLink()
    chassis = AgilexChassis(link, agilex_config())
    for k, burst in enumerate(bursts, start=1):
        link.deliver(*burst)
        check_state(chassis.exchange(Setpoint(k * 20 * MS, 1.0, 0.0, 0.5), k * 20 * MS))
    allowed = {0x111, 0x421}
    assert {frame.arbitration_id for frame in link.sent} <= allowed
    assert all(frame.data == bytes(8) for frame in link.sent if frame.arbitration_id == 0x111)


serial_noise = st.one_of(
    st.binary(max_size=30), frames.map(lambda frame: agilex_serial.wrap(frame, 7) or b"\x5a\xa5\x0c")
)


@settings(max_examples=300)
@given(st.lists(serial_noise, max_size=12), st.integers(1, 40))
def test_agilex_serial_accepts_nothing_but_a_right_checksum(chunks: list[bytes], size: int) -> None:
    stream = b"".join(chunks)
    reader = agilex_serial.FrameReader()
    found = [frame for k in range(0, len(stream), size) for frame in reader.feed(stream[k : k + size])]
    assert found == agilex_serial.FrameReader().feed(stream), "however the bytes arrive"
    for frame in found:
        said = [agilex_serial.wrap(frame, count) for count in range(256)]
        assert any(data is not None and data in stream for data in said)


@settings(max_examples=50)
@given(st.lists(serial_noise, max_size=60))
def test_agilex_serial_driver_survives_any_bytes(chunks: list[bytes]) -> None:
    link = ScriptedSerialLink()
    bus = agilex_serial.AgilexSerialBus(link)
    chassis = AgilexChassis(bus, agilex_config(SerialLinkConfig(url="loop://")), bus.silence_hint)
    exchange_amid(chassis, link, chunks)
    motions = {data[5:-2] for data in link.written if data[3:5] == b"\x55\x01"}
    assert motions == ({bytes(6)} if chunks else set())
