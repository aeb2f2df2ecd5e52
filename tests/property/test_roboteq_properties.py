"""Hostile input to Roboteq: no exception, nothing wrong accepted, nothing moves by it."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from hal.chassis import roboteq_lines as lines
from hal.chassis.roboteq import RoboteqChassis
from hal.links.scripted import ScriptedSerialLink
from sim.emulators.roboteq import RoboteqEmulator
from sim.plant import TrackedPlant
from tests.support.chassis_rig import (
    COUNTS_PER_M,
    MS,
    PLANT,
    exchange_amid,
    roboteq_config,
)

# Bytes that come close to the grammar find more than bytes drawn by chance.
roboteq_noise = st.one_of(
    st.binary(max_size=20),
    st.text(alphabet="+-=:0123456789CFMRWDVAB!?\r", max_size=40).map(str.encode),
    st.sampled_from([b"C=1:2\r", b"FF=0\r", b"FM=0:0\r", b"RWD=300\r", b"+\r", b"V=1:250:3\r"]),
)


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
    exchange_amid(chassis, link, chunks)
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
