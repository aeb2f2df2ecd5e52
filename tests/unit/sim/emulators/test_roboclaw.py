"""The emulated RoboClaw by its bytes."""

from __future__ import annotations

import struct
from typing import Any

import pytest

from config.plant import PlantConfig
from hal.links.scripted import serial_pair
from sim.emulators.roboclaw import RoboclawEmulator
from sim.plant import TrackedPlant

MS = 1_000_000
STOPPED = pytest.approx((0.0, 0.0), abs=1e-3)


def crc(data: bytes) -> bytes:
    """CRC-16/XMODEM by the manual's loop (p. 59), not by the library that the emulator uses."""
    value = 0
    for byte in data:
        value ^= byte << 8
        for _ in range(8):
            value = (value << 1 ^ 0x1021 if value & 0x8000 else value << 1) & 0xFFFF
    return value.to_bytes(2, "big")


def write(command: int, data: bytes, address: int = 0x80) -> bytes:
    body = bytes((address, command)) + data
    return body + crc(body)


class Bench:
    """A host's hand on the line of one emulated controller, 1000 counts a metre."""

    def __init__(self, **options: Any) -> None:
        self.host, self.far = serial_pair()
        self.plant = TrackedPlant(PlantConfig(max_accel_mps2=50.0, lag_s=0.02))
        self.claw = RoboclawEmulator(self.far, self.plant, counts_per_m=1000.0, **options)
        self.now_ns = 0

    def ask(self, data: bytes) -> bytes:
        """Write, let 2 ms pass, read."""
        self.host.write(data)
        return self.after(2)

    def after(self, ms: int) -> bytes:
        self.now_ns += ms * MS
        self.claw.advance_to(self.now_ns)
        return self.host.read()

    def read(self, command: int) -> bytes:
        """The data of a reply whose CRC is right."""
        reply = self.ask(bytes((0x80, command)))
        assert reply[-2:] == crc(bytes((0x80, command)) + reply[:-2])
        return reply[:-2]


def test_vectors_of_the_manual_are_acknowledged() -> None:
    bench = Bench()
    for data in (
        "80 25 00 00 03 E8 00 00 03 E8 EA B0",
        "80 25 00 00 00 00 00 00 00 00 34 04",
        "80 25 FF FF FC 18 00 00 03 E8 B0 67",
        "80 28 00 00 07 D0 00 00 03 E8 00 00 03 E8 00 97",
        "80 22 40 00 E0 00 E6 39",
        "80 0E 03 28 36",
    ):
        assert bench.ask(bytes.fromhex(data)) == b"\xff", data
    assert bench.claw.timeout_ms == 300
    bench.claw.press_estop()
    assert bench.ask(b"\x80\x5a") == bytes.fromhex("00 00 00 01 97 9D")


@pytest.mark.parametrize(
    ("packet", "speeds"),
    [
        (write(37, struct.pack(">ii", 500, -250)), (0.5, -0.25)),
        (write(35, struct.pack(">i", 500)), (0.5, 0.0)),
        (write(36, struct.pack(">i", 500)), (0.0, 0.5)),
        (write(38, struct.pack(">Ii", 100_000, 500)), (0.5, 0.0)),
        (write(39, struct.pack(">Ii", 100_000, 500)), (0.0, 0.5)),
        (write(40, struct.pack(">Iii", 100_000, 500, 250)), (0.5, 0.25)),
        (write(34, struct.pack(">hh", 32767, 0)), (1.5, 0.0)),
        (write(32, struct.pack(">h", 16384)), (0.75, 0.0)),
        (write(33, struct.pack(">h", -32767)), (0.0, -1.5)),
    ],
)
def test_a_motion_command_drives_each_track(packet: bytes, speeds: tuple[float, float]) -> None:
    bench = Bench()
    assert bench.ask(packet) == b"\xff"
    bench.after(1000)
    assert bench.plant.track_speeds_mps == pytest.approx(speeds, abs=1e-4)


def test_ramps_are_followed() -> None:
    bench = Bench()
    bench.ask(write(40, struct.pack(">Iii", 1000, 500, 500)))
    bench.after(248)
    assert bench.plant.track_speeds_mps[0] == pytest.approx(0.25, abs=0.03)


def test_queries_tell_counters_and_speeds() -> None:
    bench = Bench()
    bench.ask(write(37, struct.pack(">ii", 500, -500)))
    bench.after(1000)
    left, right = struct.unpack(">II", bench.read(78))
    assert 450 < left < 500
    assert right == 2**32 - left
    assert struct.unpack(">ii", bench.read(79)) == (500, -500)
    assert struct.unpack(">ii", bench.read(108)) == (500, -500)
    assert struct.unpack(">IB", bench.read(16))[1] == 0
    assert struct.unpack(">IB", bench.read(17))[1] == 1
    for command in (18, 30):
        assert struct.unpack(">iB", bench.read(command)) == (500, 0)
    for command in (19, 31):
        assert struct.unpack(">iB", bench.read(command)) == (-500, 1)
    assert struct.unpack(">H", bench.read(24)) == (252,)
    assert struct.unpack(">H", bench.read(25)) == (50,)
    assert struct.unpack(">H", bench.read(82)) == (315,)
    assert len(bench.read(83)) == 2
    assert len(bench.read(49)) == 4
    assert bench.read(15) == b"\x00"


@pytest.mark.parametrize(("status_bytes", "reply"), [(2, "00 04"), (4, "00 00 00 01")])
def test_both_lengths_of_the_status(status_bytes: int, reply: str) -> None:
    bench = Bench(status_bytes=status_bytes)
    bench.claw.press_estop()
    assert bench.read(90) == bytes.fromhex(reply)


def test_wrong_packets_are_not_answered() -> None:
    bench = Bench()
    good = write(37, struct.pack(">ii", 500, 500))
    assert bench.ask(good[:-1] + bytes((good[-1] ^ 1,))) == b""
    assert bench.ask(write(37, bytes(8), address=0x81)) == b"", "another controller's packet"
    bench.after(20)
    assert bench.ask(b"\x80\xc8\x00\x00") == b"", "a command that it does not know"
    bench.after(100)
    assert bench.plant.track_speeds_mps == STOPPED
    assert bench.claw.rejected == 2


def test_a_gap_of_ten_milliseconds_drops_the_packet() -> None:
    bench = Bench()
    good = write(37, struct.pack(">ii", 500, 500))
    assert bench.ask(good[:5]) == b""
    bench.after(4)
    assert bench.ask(good[5:]) == b"\xff", "a short gap does not"
    assert bench.ask(good[:5]) == b""
    bench.after(12)
    assert bench.ask(good[5:]) == b"", "the rest alone is noise"
    bench.after(12)
    assert bench.ask(good) == b"\xff", "and then both agree again"


def test_packets_may_come_merged() -> None:
    bench = Bench()
    both = write(37, struct.pack(">ii", 500, 500)) + b"\x80\x18"
    reply = bench.ask(both)
    assert reply[:1] == b"\xff"
    assert reply[1:3] == struct.pack(">H", 252)


def test_its_own_time_out_stops_the_motors_only_when_set() -> None:
    bench = Bench()
    bench.ask(write(37, struct.pack(">ii", 500, 500)))
    bench.after(5000)
    assert bench.plant.track_speeds_mps[0] == pytest.approx(0.5), "off at power-up: a runaway"
    bench.ask(write(14, b"\x03"))
    bench.after(280)
    assert bench.plant.track_speeds_mps[0] == pytest.approx(0.5)
    bench.after(300)
    assert bench.plant.track_speeds_mps == STOPPED


def test_emergency_stop_holds_until_released() -> None:
    bench = Bench()
    bench.ask(write(37, struct.pack(">ii", 500, 500)))
    bench.after(500)
    bench.claw.press_estop()
    assert bench.ask(write(37, struct.pack(">ii", 500, 500))) == b"\xff"
    bench.after(500)
    assert bench.plant.track_speeds_mps == STOPPED
    bench.claw.release_estop()
    bench.after(500)
    assert bench.plant.track_speeds_mps == STOPPED, "nothing is remembered"
    bench.ask(write(37, struct.pack(">ii", 500, 500)))
    bench.after(500)
    assert bench.plant.track_speeds_mps[0] == pytest.approx(0.5)


def test_restart_forgets_encoders_and_time_out() -> None:
    bench = Bench(boot_ms=100)
    bench.ask(write(14, b"\x03"))
    bench.ask(write(37, struct.pack(">ii", 500, 500)))
    bench.after(250)
    bench.claw.restart()
    assert bench.ask(b"\x80\x0f") == b"", "booting"
    bench.after(400)
    assert bench.read(15) == b"\x00"
    assert struct.unpack(">II", bench.read(78))[0] < 100


def test_frozen_it_says_nothing_and_its_time_out_still_runs() -> None:
    bench = Bench()
    bench.ask(write(14, b"\x03"))
    bench.ask(write(37, struct.pack(">ii", 500, 500)))
    bench.claw.freeze()
    assert bench.ask(b"\x80\x18") == b""
    bench.after(1000)
    assert bench.plant.track_speeds_mps == STOPPED
    bench.claw.thaw()
    assert bench.read(24)


def test_an_unplugged_controller_does_not_mind() -> None:
    bench = Bench()
    bench.host.write(b"\x80\x18")
    bench.far.unplug()
    assert bench.after(20) == b""
    bench.far.plug()
    bench.after(20)
    assert bench.read(24)
