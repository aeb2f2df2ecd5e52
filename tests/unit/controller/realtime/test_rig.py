"""What a drive in real time has around its loop, where the drive ends with an error."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from config.app import RealtimeRunner, load_app
from config.loader import CONFIG_DIR
from controller.base.drive_lifecycle import Outcome
from controller.build import build_control
from controller.control import ControlLoop
from controller.realtime import rig as realtime_rig
from controller.realtime.channel import Channel, PeerGone, channel_sockets
from controller.realtime.messages import CutOff
from controller.realtime.perception_link import PerceptionLink
from controller.realtime.punctual import PunctualChassis
from controller.realtime.rig import RealtimeRig, perception_beside
from controller.realtime.runner import Punctuality
from controller.record.recorder import RecordingOptions
from controller.terminal.console import Console
from hal.clocks import MonotonicClock
from hal.types import ChassisMode
from tests.support.obedient_chassis import ObedientChassis


def rig_of(chassis: ObedientChassis) -> tuple[RealtimeRig, ControlLoop]:
    """Around the simulated warehouse's path, on this machine's clock."""
    path = CONFIG_DIR / "sim-realtime.yaml"
    config, clock = load_app(path), MonotonicClock()
    assert isinstance(config.runner, RealtimeRunner)
    punctual = PunctualChassis(chassis, clock, 20_000_000)
    rig = RealtimeRig(config, config.runner, RecordingOptions(), clock, 0, punctual, None, Punctuality())
    return rig, build_control(config, punctual)


def test_an_error_of_the_drive_stops_the_base_before_perception_is_waited_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    chassis = ObedientChassis()
    stopped_before_the_end_of_perception: list[bool] = []

    @contextmanager
    def perception(*_: object) -> Iterator[PerceptionLink]:
        here, there = channel_sockets()
        with here, there:
            try:
                yield PerceptionLink(Channel(here))
            finally:
                stopped_before_the_end_of_perception.append(bool(chassis.stopped_at_ns))

    monkeypatch.setattr(realtime_rig, "perception_beside", perception)
    monkeypatch.setattr(realtime_rig, "become_realtime", lambda _priority: [])
    rig, loop = rig_of(chassis)

    def drive() -> None:
        with rig.under_way(loop, Console(quiet=True), lambda _service: None) as moments:
            next(moments)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        drive()
    assert stopped_before_the_end_of_perception == [True]


@pytest.mark.parametrize(
    ("end", "why"),
    [
        ("reached", b"target reached"),
        ("wish", b"asked to"),
        ("fault", b"e-stop pressed"),
        ("error", b"ended by an error"),
    ],
)
def test_the_service_manager_is_told_of_every_end_before_perception_is_waited_for(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, end: str, why: bytes
) -> None:
    """Its watchdog would not wait as long as that takes."""
    said: list[bytes] = []

    @contextmanager
    def perception(*_: object) -> Iterator[PerceptionLink]:
        here, there = channel_sockets()
        with here, there:
            try:
                yield PerceptionLink(Channel(here))
            finally:
                with suppress(BlockingIOError):
                    while True:
                        said.append(manager.recv(1000))

    def drive() -> None:
        with rig.under_way(loop, Console(quiet=True), lambda _service: None) as moments:
            next(moments)
            if end == "error":
                raise ZeroDivisionError
            if end == "fault":
                chassis.fault = ChassisMode.ESTOP
            elif end == "wish":
                loop.request_stop("asked to")
            else:
                loop.lifecycle.outcome = Outcome.REACHED
            for _ in moments:
                pass

    monkeypatch.setattr(realtime_rig, "perception_beside", perception)
    monkeypatch.setattr(realtime_rig, "become_realtime", lambda _priority: [])
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
    chassis = ObedientChassis()
    rig, loop = rig_of(chassis)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as manager:
        manager.bind(str(tmp_path / "notify"))
        with suppress(ZeroDivisionError):
            drive()
    told = [message for message in said if message.startswith(b"STOPPING=1")]
    assert told == [b"STOPPING=1\nSTATUS=" + why]


def test_process_that_ends_during_or_after_the_drive_is_reported_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    link: list[PerceptionLink] = []

    @contextmanager
    def perception(*_: object) -> Iterator[PerceptionLink]:
        here, there = channel_sockets()
        with here, there:
            link.append(PerceptionLink(Channel(here)))
            yield link[0]
            link[0].cut_off.append("drive.mp4: its end is missing")

    monkeypatch.setattr(realtime_rig, "perception_beside", perception)
    monkeypatch.setattr(realtime_rig, "become_realtime", lambda _priority: [])
    rig, loop = rig_of(ObedientChassis())
    with rig.under_way(loop, Console(quiet=True), lambda _service: None) as moments:
        link[0].cut_off.append("seen.jsonl: full")
        for _ in range(3):
            next(moments)
    assert rig.cut_off == ["seen.jsonl: full", "drive.mp4: its end is missing"]
    assert capsys.readouterr().err.splitlines() == [
        "treadwatch: warning: seen.jsonl: full; the drive goes on without it",
        "treadwatch: warning: drive.mp4: its end is missing",
    ]


def sleeps_for_ever(*_: object) -> None:
    """In place of a perception process whose disk hangs."""
    time.sleep(600.0)


def tells_late(_config: object, end: socket.socket, *_: object) -> None:
    """In place of a perception process that cannot finish a file after the drive."""
    channel = Channel(end)
    channel.send(CutOff("it runs"))
    with suppress(PeerGone):
        while True:
            channel.receive()
            time.sleep(0.01)
    channel.send(CutOff("drive.mp4: full"))


@pytest.mark.parametrize("recorded", [True, False])
def test_files_that_a_killed_perception_may_not_have_closed_are_named(
    monkeypatch: pytest.MonkeyPatch, recorded: bool
) -> None:
    monkeypatch.setattr(realtime_rig, "perceive_forever", sleeps_for_ever)
    monkeypatch.setattr(realtime_rig, "GOODBYE_S", 0.1)
    path = CONFIG_DIR / "sim-realtime.yaml"
    recording = RecordingOptions(video=Path("drive.mp4") if recorded else None)
    with perception_beside(load_app(path), 0, recording) as link:
        pass
    why = ["drive.mp4: may not be whole: they were not closed within 0.1 s; is the disk too slow?"]
    assert link.cut_off == (why if recorded else [])


def test_message_of_perception_after_the_drive_is_received(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(realtime_rig, "perceive_forever", tells_late)
    path = CONFIG_DIR / "sim-realtime.yaml"
    with perception_beside(load_app(path), 0, RecordingOptions()) as link:
        began_s = time.monotonic()
        while not link.cut_off and time.monotonic() - began_s < 60.0:
            link.receive()
            time.sleep(0.01)
    assert link.cut_off == ["it runs", "drive.mp4: full"]
