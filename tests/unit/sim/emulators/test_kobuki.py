"""The emulated Kobuki by its bytes."""

from __future__ import annotations

import math
import struct

import pytest

from config.plant import PlantConfig
from hal.links.scripted import serial_pair
from sim.emulators.kobuki import KobukiEmulator
from sim.plant import TrackedPlant

MS = 1_000_000
STOPPED = pytest.approx((0.0, 0.0), abs=1e-3)
TICKS_PER_M = 11_724.4


def xor(data: bytes) -> int:
    value = 0
    for byte in data:
        value ^= byte
    return value


def drive(speed: int, radius: int) -> bytes:
    body = b"\x06\x01\x04" + struct.pack("<hh", speed, radius)
    return b"\xaa\x55" + body + bytes((xor(body),))


class Bench:
    """A host's hand on the line of one emulated base."""

    def __init__(self) -> None:
        self.host, self.far = serial_pair()
        self.plant = TrackedPlant(
            PlantConfig(track_width_m=0.23, max_accel_mps2=50.0, lag_s=0.02, slip_factor=1.0)
        )
        self.base = KobukiEmulator(self.far, self.plant)
        self.now_ns = 0

    def after(self, ms: int) -> bytes:
        self.now_ns += ms * MS
        self.base.advance_to(self.now_ns)
        return self.host.read()

    def keep(self, command: bytes, ms: int = 500) -> None:
        """Repeat the command as a host does."""
        for _ in range(ms // 100):
            self.host.write(command)
            self.after(100)

    def frame(self) -> dict[int, bytes]:
        """The sub-payloads of the next frame, whose checksum is right."""
        data = self.after(20)
        assert data[:2] == b"\xaa\x55"
        assert xor(data[2:]) == 0
        assert data[2] == len(data) - 4
        parts, payload = {}, data[3:-1]
        while payload:
            parts[payload[0]], payload = payload[2 : 2 + payload[1]], payload[2 + payload[1] :]
        return parts


def test_base_streams_fifty_frames_a_second() -> None:
    bench = Bench()
    assert bench.after(1000).count(b"\xaa\x55") == 51
    core = bench.frame()[1]
    assert struct.unpack_from("<H", core)[0] == 1020
    assert core[13] == 162
    assert len(core) == 15


@pytest.mark.parametrize(
    ("speed", "radius", "wheels"),
    [
        (300, 0, (0.3, 0.3)),
        (-300, 0, (-0.3, -0.3)),
        (115, 1, (-0.115, 0.115)),
        (-115, 1, (0.115, -0.115)),
        (357, 600, (0.357 * 485 / 715, 0.357)),
        (357, -600, (0.357, 0.357 * 485 / 715)),
    ],
)
def test_base_control_turns_the_wheels_as_the_radius_says(
    speed: int, radius: int, wheels: tuple[float, float]
) -> None:
    bench = Bench()
    bench.keep(drive(speed, radius))
    assert bench.plant.track_speeds_mps == pytest.approx(wheels, abs=1e-3)


def test_ticks_and_gyro() -> None:
    bench = Bench()
    bench.keep(drive(200, 0), 1000)
    left, right = struct.unpack_from("<HH", bench.frame()[1], 5)
    assert left == right == pytest.approx(bench.plant.track_travel_m[0] * TICKS_PER_M, abs=1)
    bench.keep(drive(-115, 1), 1000)
    angle, rate = struct.unpack_from("<hh", bench.frame()[4])
    assert angle / 100.0 == pytest.approx(math.degrees(bench.plant.pose.heading_rad), abs=0.01)
    assert angle < -4000
    assert rate / 100.0 == pytest.approx(-57.3, abs=0.1)
    assert struct.unpack_from("<H", bench.frame()[1], 7)[0] < right, "the right wheel turns back"


def test_switches_report_and_do_nothing_else() -> None:
    bench = Bench()
    bench.base.bumper, bench.base.wheel_drop, bench.base.cliff = 5, 2, 1
    bench.base.charger, bench.base.over_current = 22, 3
    bench.keep(drive(200, 0))
    core = bench.frame()[1]
    assert tuple(core[2:5]) == (5, 2, 1)
    assert (core[12], core[14]) == (22, 3)
    assert bench.plant.track_speeds_mps == pytest.approx((0.2, 0.2), abs=1e-3)
    bench.base.press_estop()
    assert bench.frame()[1][2] == 2
    bench.base.release_estop()
    assert bench.frame()[1][2] == 0


def test_without_commands_the_base_stops_after_its_time_out() -> None:
    bench = Bench()
    bench.keep(drive(300, 0))
    bench.after(300)
    assert bench.plant.track_speeds_mps == pytest.approx((0.3, 0.3), abs=1e-3)
    bench.after(700)
    assert bench.plant.track_speeds_mps == STOPPED


def test_a_wrong_checksum_is_not_obeyed_and_hides_nothing() -> None:
    bench = Bench()
    wrong = bytearray(drive(300, 0))
    wrong[6] ^= 1
    bench.keep(bytes(wrong))
    assert bench.plant.track_speeds_mps == STOPPED
    assert bench.base.rejected == 5
    bench.keep(bytes(wrong) + drive(200, 0))
    assert bench.plant.track_speeds_mps == pytest.approx((0.2, 0.2), abs=1e-3)


def test_commands_may_come_in_pieces_and_merged() -> None:
    bench = Bench()
    for byte in drive(200, 0):
        bench.host.write(bytes((byte,)))
        bench.after(2)
    assert bench.base.commands_obeyed == 1
    bench.host.write(drive(100, 0) + drive(50, 0))
    bench.after(300)
    assert bench.plant.track_speeds_mps == pytest.approx((0.05, 0.05), abs=1e-3)


def test_versions_on_request() -> None:
    bench = Bench()
    bench.after(10)
    bench.host.write(bytes.fromhex("AA 55 04 09 02 0B 00 04"))
    parts = bench.frame()
    assert (len(parts[10]), len(parts[11]), len(parts[19])) == (4, 4, 12)
    assert 10 not in bench.frame()


def test_a_restart_is_silent_and_begins_at_zero() -> None:
    bench = Bench()
    bench.keep(drive(300, 0))
    bench.base.restart()
    assert bench.after(900) == b""
    bench.after(200)
    core = bench.frame()[1]
    clock, ticks = struct.unpack_from("<H", core)[0], struct.unpack_from("<H", core, 5)[0]
    assert clock == pytest.approx(1120, abs=20)
    assert ticks < 500
    assert bench.plant.track_speeds_mps == STOPPED


def test_frozen_it_says_nothing_and_its_time_out_still_runs() -> None:
    bench = Bench()
    bench.keep(drive(300, 0))
    bench.base.freeze()
    assert bench.after(1000) == b""
    assert bench.plant.track_speeds_mps == STOPPED
    bench.base.thaw()
    assert bench.after(20) != b""


def test_an_unplugged_base_does_not_mind() -> None:
    bench = Bench()
    bench.far.unplug()
    bench.after(100)
    bench.far.plug()
    assert bench.after(20) != b""
