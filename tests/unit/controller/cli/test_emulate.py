"""`treadwatch emulate`: its loop under a fake clock, its link, and what it refuses."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from itertools import islice
from pathlib import Path

import pytest
import yaml

from config.app import HIL_BASES, hil_file, load_app
from config.chassis import CanLinkConfig, SerialLinkConfig
from controller.cli.emulate import EmulateOptions, _linked, can_link, run_in_real_time, with_wire
from controller.errors import UserError
from controller.realtime.service import StopRequest
from hal.chassis.agilex_messages import ControlModeCommand, MotionCommand, encode
from hal.clocks import SimulatedClock
from hal.links.scripted import can_pair
from sim.emulators.agilex import AgilexEmulator
from sim.plant import TrackedPlant
from tests.support.chassis_rig import MS, PLANT

LINK = CanLinkConfig(interface="udp_multicast", channel="239.74.163.2", port=43113)


class LateClock(SimulatedClock):
    """Sleeps once for as long as it is told, whatever was asked."""

    def __init__(self) -> None:
        super().__init__()
        self.late_ns = 0

    def sleep_until_ns(self, deadline_ns: int) -> None:
        super().sleep_until_ns(deadline_ns + self.late_ns)
        self.late_ns = 0


def test_the_base_lives_in_real_time_and_ends_when_asked() -> None:
    host, base = can_pair()
    clock, stop = SimulatedClock(), StopRequest()
    emulator = AgilexEmulator(base, TrackedPlant(PLANT))
    lines = run_in_real_time(emulator, clock, stop, list)
    host.send(encode(ControlModeCommand(1)))
    host.send(encode(MotionCommand(0.5, 0.0)))
    first = next(lines)
    assert first.startswith("v 0.2"), "it obeyed from the start, at 2 m/s2"
    assert clock.now_ns() == 100 * MS
    more = list(islice(lines, 4))
    assert more[-1].startswith("v 0.4")
    assert clock.now_ns() == 500 * MS
    stop.handle(signal.SIGTERM, None)
    assert list(lines) == ["SIGTERM: ended"]
    # From 0 to 500 ms: 26 times motion, odometer and two motors; state and two drivers every 100 ms, battery.
    assert len(base.sent) == 26 * 4 + 6 * 3 + 2


def test_a_process_that_was_frozen_does_not_send_what_it_missed() -> None:
    host, base = can_pair()
    clock, stop = LateClock(), StopRequest()
    emulator = AgilexEmulator(base, TrackedPlant(PLANT))
    lines = run_in_real_time(emulator, clock, stop, list)
    host.send(encode(ControlModeCommand(1)))
    host.send(encode(MotionCommand(0.5, 0.0)))
    list(islice(lines, 10))
    before = len(base.sent)
    clock.late_ns = 5_000 * MS
    assert next(lines) == "was frozen for 5.0 s"
    next(lines)
    assert len(base.sent) - before < 30
    assert emulator.plant.twist[0] == pytest.approx(0.0, abs=1e-3), "its own time-out ran meanwhile"


def test_a_word_makes_a_fault_and_an_unknown_word_is_answered() -> None:
    _, base = can_pair()
    emulator = AgilexEmulator(base, TrackedPlant(PLANT))
    words = iter([["estop"], [], ["release", "boom"], *[[]] * 1000])
    lines = run_in_real_time(emulator, SimulatedClock(), StopRequest(), lambda: next(words))
    assert list(islice(lines, 3)) == [
        "did estop",
        "did release",
        "'boom'? one of estop, release, restart, freeze, thaw",
    ]


@pytest.mark.parametrize(
    ("options", "link"),
    [
        (EmulateOptions("agilex"), LINK),
        (EmulateOptions("agilex", port=5000), LINK.model_copy(update={"port": 5000})),
        (EmulateOptions("agilex", channel="can0"), CanLinkConfig(interface="socketcan", channel="can0")),
        (
            EmulateOptions("agilex", channel="239.1.2.3"),
            CanLinkConfig(interface="udp_multicast", channel="239.1.2.3", port=43113),
        ),
        (
            EmulateOptions("agilex", channel="bus", interface="virtual"),
            CanLinkConfig(interface="virtual", channel="bus"),
        ),
    ],
)
def test_the_channel_suggests_the_interface(options: EmulateOptions, link: CanLinkConfig) -> None:
    assert can_link(LINK, options) == link


def test_a_link_that_cannot_be_is_refused() -> None:
    with pytest.raises(UserError, match="only udp_multicast has this, not socketcan"):
        can_link(LINK, EmulateOptions("agilex", channel="can0", port=5000))


def test_a_path_is_a_serial_port_for_a_base_that_has_both() -> None:
    agilex = load_app(hil_file("agilex")).chassis
    moved = with_wire(agilex, EmulateOptions("agilex", channel="/tmp/port"))
    assert moved == agilex.model_copy(update={"link": SerialLinkConfig(url="/tmp/port")})
    assert with_wire(agilex, EmulateOptions("agilex", channel="can0")) is agilex
    adapter = EmulateOptions("agilex", channel="/dev/ttyACM0", interface="slcan")
    assert with_wire(agilex, adapter) is agilex, "a CAN adapter on a serial port"
    kobuki = load_app(hil_file("kobuki")).chassis
    assert with_wire(kobuki, EmulateOptions("kobuki", channel="/tmp/port")) is kobuki
    tracer = agilex.model_copy(update={"model": "tracer"})
    with pytest.raises(UserError, match="tracer cannot be driven over a serial port"):
        with_wire(tracer, EmulateOptions("agilex", channel="/tmp/port"))


def test_the_path_is_a_link_while_it_runs(tmp_path: Path) -> None:
    path = tmp_path / "port"
    path.symlink_to("/dev/pts/999999")  # of an emulator that was killed
    with _linked(str(path), "/dev/pts/7"):
        assert os.readlink(path) == "/dev/pts/7"
    assert not path.is_symlink()
    path.write_text("mine")
    with pytest.raises(UserError, match="File exists"), _linked(str(path), "/dev/pts/7"):
        pass
    assert path.read_text() == "mine"


def test_the_link_of_a_killed_emulator_whose_terminal_number_is_used_again(tmp_path: Path) -> None:
    path, (master, slave) = tmp_path / "port", os.openpty()
    try:
        path.symlink_to(os.ttyname(slave))
        with _linked(str(path), os.ttyname(slave)):
            assert os.readlink(path) == os.ttyname(slave)
        assert not path.is_symlink()
    finally:
        os.close(master)
        os.close(slave)


def test_the_path_of_another_emulator_is_left_to_it(tmp_path: Path) -> None:
    path, (master, slave) = tmp_path / "port", os.openpty()
    try:
        path.symlink_to(os.ttyname(slave))
        with pytest.raises(UserError, match="another emulator is there"), _linked(str(path), "/dev/pts/7"):
            pass
        assert os.readlink(path) == os.ttyname(slave)
    finally:
        os.close(master)
        os.close(slave)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["roboteq", "--channel", "/nowhere/at/all"], "no link can be made there"),
        (["kobuki", "--port", "5000"], "this kobuki is on a serial port"),
        (["roboclaw", "--config", str(hil_file("agilex"))], "its chassis is 'agilex'"),
        (["agilex", "--channel", "can7"], "can7"),
    ],
)
def test_mistakes_are_one_line(arguments: list[str], words: str) -> None:
    command = [sys.executable, "-m", "controller", "emulate", *arguments]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=60, check=False, stdin=subprocess.DEVNULL
    )
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
    assert words in done.stderr


@pytest.mark.parametrize("kind", HIL_BASES)
def test_the_files_that_ship_fit_their_emulator(kind: str) -> None:
    """The emulated base is driven with its own geometry: what the driver believes is what the plant is."""
    config = load_app(hil_file(kind))
    assert config.simulation is not None
    assert config.simulation.base == "external"
    assert config.chassis.kind == kind.removesuffix("-serial")
    content = yaml.safe_load((hil_file(kind)).read_text())
    plant, chassis = content["simulation"]["plant"], content["chassis"]
    assert plant["slip_factor"] == chassis.get("slip_factor", 1.0)
    assert plant["track_width_m"] == chassis.get("track_width_m", 0.23)
