"""The emulated Roboteq by its bytes."""

from __future__ import annotations

import pytest

from config.plant import PlantConfig
from hal.links.scripted import serial_pair
from sim.emulators.roboteq import RoboteqEmulator
from sim.plant import TrackedPlant

MS = 1_000_000
STOPPED = pytest.approx((0.0, 0.0), abs=1e-3)


class Bench:
    """A host's hand on the line of one emulated controller, 1000 counts a metre, full speed 1 m/s."""

    def __init__(self, echo: bool = False) -> None:
        self.host, self.far = serial_pair()
        self.plant = TrackedPlant(PlantConfig(max_accel_mps2=50.0, lag_s=0.02))
        self.teq = RoboteqEmulator(self.far, self.plant, full_speed_mps=1.0, counts_per_m=1000.0)
        self.now_ns = 0
        if not echo:
            self.ask(b"^ECHOF 1\r")

    def ask(self, data: bytes) -> bytes:
        """Write, let 2 ms pass, read."""
        self.host.write(data)
        return self.after(2)

    def after(self, ms: int) -> bytes:
        self.now_ns += ms * MS
        self.teq.advance_to(self.now_ns)
        return self.host.read()

    def drive(self, data: bytes, ms: int = 800) -> bytes:
        """Write, and keep the watchdog fed meanwhile."""
        reply = self.ask(data)
        self.after(ms)
        return reply


def test_controller_echoes_until_echo_is_switched_off() -> None:
    bench = Bench(echo=True)
    assert bench.ask(b"!M 0") == b"!M 0"
    assert bench.ask(b" 0\r") == b" 0\r+\r"
    assert bench.ask(b"^ECHOF 1\r") == b"^ECHOF 1\r+\r"
    assert bench.ask(b"?FF\r") == b"FF=0\r"
    assert bench.ask(b"~ECHOF\r") == b"ECHOF=1\r"


@pytest.mark.parametrize(
    ("command", "speeds"),
    [
        (b"!M 500 -250\r", (0.5, -0.25)),
        (b"!m 500 -250_", (0.5, -0.25)),
        (b"!G 1 500\r", (0.5, 0.0)),
        (b"!G 2 -500\r", (0.0, -0.5)),
        (b"!S 2 1500\r", (0.0, 0.5)),
        (b"!M 9999 0\r", (1.0, 0.0)),
    ],
)
def test_a_motion_command_drives_each_track(command: bytes, speeds: tuple[float, float]) -> None:
    bench = Bench()
    assert bench.drive(command) == b"+\r"
    assert bench.plant.track_speeds_mps == pytest.approx(speeds, abs=1e-3)


@pytest.mark.parametrize(
    "wrong",
    [
        b"!M 1\r",
        b"!M a b\r",
        b"!Q 1\r",
        b"!G 3 100\r",
        b"?XX\r",
        b"?C 3\r",
        b"^RWD -1\r",
        b"~XX\r",
        b"hello\r",
    ],
)
def test_wrong_commands_are_refused(wrong: bytes) -> None:
    bench = Bench()
    assert bench.drive(wrong) == b"-\r"
    assert bench.plant.track_speeds_mps == STOPPED


def test_an_empty_line_is_nothing() -> None:
    assert Bench().ask(b"\r\r") == b""


def test_queries_tell_speeds_counters_and_voltages() -> None:
    bench = Bench()
    bench.drive(b"!M 500 -500\r", 900)
    assert bench.ask(b"?S\r") == b"S=1500:-1500\r"
    assert bench.ask(b"?BS 2\r") == b"BS=-1500\r"
    counts = bench.ask(b"?C\r")
    left, right = map(int, counts.removeprefix(b"C=").split(b":"))
    assert 300 < left < 450
    assert right == -left
    assert bench.ask(b"?C 1\r").startswith(b"C=")
    assert bench.ask(b"?V\r") == b"V=135:246:4998\r"
    assert bench.ask(b"?FM\r") == b"FM=0:0\r"
    assert bench.ask(b"?T\r").count(b":") == 2
    assert bench.ask(b"?A\r") == b"A=20:20\r"
    assert bench.ask(b"?FID\r").startswith(b"FID=Roboteq")
    assert bench.ask(b"~RWD\r") == b"RWD=1000\r"


def test_the_watchdog_stops_and_only_commands_feed_it() -> None:
    bench = Bench()
    bench.ask(b"^RWD 300\r")
    bench.ask(b"!M 500 500\r")
    for _ in range(30):
        bench.ask(b"?C\r")
        bench.after(20)
    assert bench.plant.track_speeds_mps == STOPPED


@pytest.mark.parametrize("innocent", [b"!MG\r", b"!AC 1 150000\r"])
def test_after_the_watchdog_any_command_lets_the_motors_run_on(innocent: bytes) -> None:
    """Manual V1.8 p. 286: they resume at whichever speed they ran before."""
    bench = Bench()
    bench.drive(b"!M 500 500\r", 2500)
    assert bench.plant.track_speeds_mps == STOPPED
    bench.drive(innocent, 500)
    assert bench.plant.track_speeds_mps == pytest.approx((0.5, 0.5), abs=0.01)


def test_zero_after_the_watchdog_disarms_the_trap() -> None:
    bench = Bench()
    bench.drive(b"!M 500 500\r", 2500)
    bench.ask(b"!M 0 0\r!MG\r")
    bench.after(500)
    assert bench.plant.track_speeds_mps == STOPPED


def test_a_watchdog_of_zero_is_off() -> None:
    bench = Bench()
    bench.ask(b"^RWD 0\r")
    bench.drive(b"!M 500 500\r", 5000)
    assert bench.plant.track_speeds_mps == pytest.approx((0.5, 0.5), abs=1e-3)


def test_ramps_and_stopping_one_channel() -> None:
    bench = Bench()
    bench.ask(b"!AC 1 15000\r!AC 2 15000\r")  # 1500 of 3000 rpm in a second: 0.5 m/s2
    bench.drive(b"!M 400 400\r", 400)
    assert bench.plant.track_speeds_mps[0] == pytest.approx(0.2, abs=0.03)
    bench.drive(b"!MS 1\r")
    assert bench.plant.track_speeds_mps == pytest.approx((0.0, 0.4), abs=1e-3)
    assert bench.ask(b"!AC 1 0\r") == b"-\r"


def test_the_emergency_stop_stays_until_mg_with_the_button_out() -> None:
    bench = Bench()
    bench.drive(b"!M 500 500\r", 500)
    bench.teq.press_estop()
    assert bench.ask(b"?FF\r") == b"FF=16\r"
    bench.drive(b"!MG\r!M 500 500\r", 500)
    assert bench.plant.track_speeds_mps == STOPPED
    bench.teq.release_estop()
    assert bench.ask(b"?FF\r") == b"FF=16\r"
    bench.ask(b"!MG\r")
    assert bench.ask(b"?FF\r") == b"FF=0\r"
    bench.after(500)
    assert bench.plant.track_speeds_mps == STOPPED, "the old speed does not come back"
    bench.drive(b"!M 500 500\r", 500)
    assert bench.plant.track_speeds_mps == pytest.approx((0.5, 0.5), abs=1e-3)


def test_ex_does_the_same_as_the_button() -> None:
    bench = Bench()
    bench.drive(b"!M 500 500\r", 500)
    bench.drive(b"!EX\r", 500)
    assert bench.plant.track_speeds_mps == STOPPED
    assert bench.ask(b"?FF\r") == b"FF=16\r"
    assert bench.ask(b"!MG\r?FF\r") == b"+\rFF=0\r"


def test_a_restart_is_silent_and_forgets() -> None:
    bench = Bench()
    bench.ask(b"^RWD 300\r")
    bench.drive(b"!M 500 500\r", 250)
    bench.teq.restart()
    assert bench.ask(b"?C\r") == b"", "booting"
    bench.after(1000)
    assert bench.plant.track_speeds_mps == STOPPED
    assert bench.ask(b"?C\r").startswith(b"?C\rC="), "echo is on again"
    assert bench.ask(b"~RWD\r") == b"~RWD\rRWD=1000\r"


def test_frozen_it_says_nothing_and_its_watchdog_still_runs() -> None:
    bench = Bench()
    bench.drive(b"!M 500 500\r", 500)
    bench.teq.freeze()
    assert bench.ask(b"?FF\r") == b""
    bench.after(2000)
    assert bench.plant.track_speeds_mps == STOPPED
    bench.teq.thaw()
    assert bench.ask(b"?FF\r") == b"FF=0\r"


def test_an_unplugged_controller_does_not_mind() -> None:
    bench = Bench()
    bench.host.write(b"?FF\r")
    bench.far.unplug()
    assert bench.after(20) == b""
    bench.far.plug()
    bench.after(20)
    assert bench.ask(b"?FF\r").endswith(b"FF=0\r")
