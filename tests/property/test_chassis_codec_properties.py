"""Hostile input: whatever arrives, no exception, no wrong checksum accepted, nothing moves by it."""

from __future__ import annotations

import math
from binascii import crc_hqx

from hypothesis import given, settings
from hypothesis import strategies as st

from config.chassis import SerialLinkConfig
from hal.chassis import agilex_serial, kobuki_packets
from hal.chassis import roboclaw_packets as packets
from hal.chassis import roboteq_lines as lines
from hal.chassis.agilex import AgilexChassis
from hal.chassis.agilex_messages import MotionCommand, Odometer, decode, encode
from hal.chassis.kobuki import KobukiChassis
from hal.chassis.roboclaw import RoboclawChassis
from hal.chassis.roboclaw_port import RoboclawPort
from hal.chassis.roboteq import RoboteqChassis
from hal.links.scripted import ScriptedCanLink, ScriptedSerialLink
from hal.types import CanFrame, ChassisMode, ChassisState, Setpoint
from sim.kobuki_emulator import KobukiEmulator
from sim.plant import TrackedPlant
from sim.roboclaw_emulator import RoboclawEmulator
from sim.roboteq_emulator import RoboteqEmulator
from tests.support.chassis_rig import (
    COUNTS_PER_M,
    KOBUKI_PLANT,
    MS,
    PLANT,
    agilex_config,
    kobuki_config,
    roboclaw_config,
    roboteq_config,
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
QUERIES = (
    packets.GET_TIMEOUT_REQUEST,
    packets.MAIN_BATTERY_REQUEST,
    packets.CURRENTS_REQUEST,
    packets.ENCODERS_REQUEST,
    packets.STATUS_REQUEST,
)

# Bytes that come close to the grammar find more than bytes drawn by chance.
roboteq_noise = st.one_of(
    st.binary(max_size=20),
    st.text(alphabet="+-=:0123456789CFMRWDVAB!?\r", max_size=40).map(str.encode),
    st.sampled_from([b"C=1:2\r", b"FF=0\r", b"FM=0:0\r", b"RWD=300\r", b"+\r", b"V=1:250:3\r"]),
)


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


def check_state(state: ChassisState) -> None:
    assert state.mode is not ChassisMode.ARMED, "nobody consented"
    assert state.sent is None or (state.sent.v_mps, state.sent.w_radps) == (0.0, 0.0)
    assert all(math.isfinite(value) for value in (state.pose.x_m, state.pose.y_m, state.pose.heading_rad))


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
    chassis = AgilexChassis(bus, agilex_config(SerialLinkConfig(url="loop://")), bus.silence)
    for k, chunk in enumerate(chunks, start=1):
        link.deliver(chunk)
        check_state(chassis.exchange(Setpoint(k * 20 * MS, 1.0, 0.0, 0.5), k * 20 * MS))
    motions = {data[5:-2] for data in link.written if data[3:5] == b"\x55\x01"}
    assert motions == ({bytes(6)} if chunks else set())


@settings(max_examples=50)
@given(st.lists(st.binary(max_size=20), max_size=60))
def test_roboclaw_driver_survives_any_bytes(chunks: list[bytes]) -> None:
    link = ScriptedSerialLink()
    chassis = RoboclawChassis(link, roboclaw_config())
    for k, chunk in enumerate(chunks, start=1):
        link.deliver(chunk)
        check_state(chassis.exchange(Setpoint(k * 20 * MS, 1.0, 0.0, 0.5), k * 20 * MS))


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


@settings(max_examples=500)
@given(roboteq_noise)
def test_roboteq_takes_a_line_wholly_or_not_at_all(line: bytes) -> None:
    told = lines.parse(line)
    if isinstance(told, lines.Value):
        digits = [part.lstrip(b"-").lstrip(b"0") or b"0" for part in line.split(b"=")[1].split(b":")]
        assert digits == [str(abs(value)).encode() for value in told.values]
        assert len(told.values) in lines.QUERIES[told.name].values
        assert line.startswith(told.name.encode() + b"=")


@given(st.lists(roboteq_noise, max_size=30), st.integers(1, 7))
def test_roboteq_lines_do_not_depend_on_how_bytes_arrive(chunks: list[bytes], size: int) -> None:
    stream = b"".join(chunks)
    reader = lines.LineReader()
    pieces = [line for k in range(0, len(stream), size) for line in reader.feed(stream[k : k + size])]
    assert pieces == lines.LineReader().feed(stream)


@given(st.floats(allow_nan=False), st.floats(allow_nan=False))
def test_roboteq_motion_is_never_further_off_than_half_a_step_or_the_range(left: float, right: float) -> None:
    values = lines.motors(left, right).removeprefix(b"!M ").removesuffix(b"\r").split()
    for asked, went in zip((left, right), map(int, values), strict=True):
        assert abs(went - min(max(asked, -1000.0), 1000.0)) <= 0.5


@settings(max_examples=100)
@given(st.lists(roboteq_noise, max_size=60))
def test_roboteq_driver_survives_any_bytes(chunks: list[bytes]) -> None:
    link = ScriptedSerialLink()
    chassis = RoboteqChassis(link, roboteq_config())
    for k, chunk in enumerate(chunks, start=1):
        link.deliver(chunk)
        check_state(chassis.exchange(Setpoint(k * 20 * MS, 1.0, 0.0, 0.5), k * 20 * MS))
    motions = {line for line in bytes(link.sent).split(b"\r") if line.startswith(b"!")}
    assert motions <= {b"!M 0 0"}, "nobody consented, whatever the line says"


@settings(max_examples=50)
@given(st.lists(st.binary(max_size=20), max_size=40))
def test_roboteq_emulator_survives_any_bytes_and_moves_only_by_whole_commands(chunks: list[bytes]) -> None:
    link = ScriptedSerialLink()
    teq = RoboteqEmulator(link, TrackedPlant(PLANT), counts_per_m=COUNTS_PER_M)
    for k, chunk in enumerate(chunks, start=1):
        link.deliver(chunk)
        teq.advance_to(k * 5 * MS)
    if not teq.commands_obeyed:
        assert teq.plant.track_travel_m == (0.0, 0.0)


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
    for k, chunk in enumerate(chunks, start=1):
        link.deliver(chunk)
        check_state(chassis.exchange(Setpoint(k * 20 * MS, 1.0, 0.0, 0.5), k * 20 * MS))
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
