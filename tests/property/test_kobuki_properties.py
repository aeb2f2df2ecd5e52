"""Hostile input to Kobuki: no exception, nothing wrong accepted, nothing moves by it."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from hal.chassis import kobuki_packets
from hal.chassis.kobuki import KobukiChassis
from hal.links.scripted import ScriptedSerialLink
from sim.emulators.kobuki import KobukiEmulator
from sim.plant import TrackedPlant
from tests.support.chassis_rig import (
    KOBUKI_PLANT,
    MS,
    exchange_amid,
    kobuki_config,
)

finite = st.floats(allow_nan=False, allow_infinity=False)
# Frames with right and wrong checksums, sub-payloads of known and unknown kinds, and plain noise.
kobuki_noise = st.one_of(
    st.binary(max_size=40),
    st.binary(min_size=1, max_size=40).map(kobuki_packets.frame),
    st.binary(min_size=15, max_size=15).map(lambda data: kobuki_packets.frame(b"\x01\x0f" + data)),
    st.binary(min_size=7, max_size=7).map(lambda data: kobuki_packets.frame(b"\x04\x07" + data)),
)


@settings(max_examples=300)
@given(st.lists(kobuki_noise, max_size=10), st.integers(1, 50))
def test_kobuki_accepts_nothing_but_a_right_checksum(chunks: list[bytes], size: int) -> None:
    stream = b"".join(chunks)
    reader = kobuki_packets.FrameReader()
    payloads = [found for k in range(0, len(stream), size) for found in reader.feed(stream[k : k + size])]
    assert payloads == kobuki_packets.FrameReader().feed(stream), "however the bytes arrive"
    for payload in payloads:
        assert kobuki_packets.frame(payload) in stream
        kobuki_packets.parse(payload)


@given(finite, finite)
def test_kobuki_motion_keeps_its_direction_whatever_is_asked(v_mps: float, w_radps: float) -> None:
    """The wheels as the base would turn them: ahead stays ahead, left stays left, nothing wraps."""
    link = ScriptedSerialLink()
    base = KobukiEmulator(link, TrackedPlant(KOBUKI_PLANT))
    link.deliver(kobuki_packets.base_control(v_mps, w_radps))
    base.advance_to(200 * MS)
    went_mps, went_radps = base.plant.track_twist
    assert base.commands_obeyed == 1
    assert went_mps * v_mps >= 0.0 or abs(went_mps) < 1e-6
    assert went_radps * w_radps >= 0.0 or abs(went_radps) < 1e-6


@settings(max_examples=100)
@given(st.lists(kobuki_noise, max_size=60))
def test_kobuki_driver_survives_any_bytes(chunks: list[bytes]) -> None:
    link = ScriptedSerialLink()
    chassis = KobukiChassis(link, kobuki_config())
    exchange_amid(chassis, link, chunks)
    assert set(link.written) <= {kobuki_packets.base_control(0.0, 0.0)}


@settings(max_examples=50)
@given(st.lists(st.one_of(st.binary(max_size=20), kobuki_noise), max_size=40))
def test_kobuki_emulator_moves_only_by_right_checksums(chunks: list[bytes]) -> None:
    link = ScriptedSerialLink()
    base = KobukiEmulator(link, TrackedPlant(KOBUKI_PLANT))
    for k, chunk in enumerate(chunks, start=1):
        link.deliver(chunk)
        base.advance_to(k * 5 * MS)
    if not base.commands_obeyed:
        assert base.plant.track_travel_m == (0.0, 0.0)
