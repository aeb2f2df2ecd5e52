"""What a drive in real time has around its loop, where the drive ends with an error."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from config.app import RealtimeRunner, load_app
from config.loader import CONFIG_DIR
from controller.build import build_control
from controller.console import Console
from controller.control import ControlLoop
from controller.ending import Outcome
from controller.realtime import rig as realtime_rig
from controller.realtime.channel import Channel, channel_sockets
from controller.realtime.punctual import PunctualChassis
from controller.realtime.rig import RealtimeRig
from controller.realtime.runner import PerceptionLink, Punctuality
from controller.result import MissionOptions
from hal.clocks import MonotonicClock
from hal.types import ChassisMode
from tests.support.obedient_chassis import ObedientChassis


def rig_of(chassis: ObedientChassis) -> tuple[RealtimeRig, ControlLoop]:
    """Around the simulated warehouse's path, on this machine's clock."""
    path = CONFIG_DIR / "sim-realtime.yaml"
    config, clock = load_app(path), MonotonicClock()
    assert isinstance(config.runner, RealtimeRunner)
    punctual = PunctualChassis(chassis, clock, 20_000_000)
    rig = RealtimeRig(
        config, config.runner, MissionOptions(Path(path)), clock, 0, punctual, None, Punctuality()
    )
    return rig, build_control(config, path, punctual)


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
                loop.ending.outcome = Outcome.REACHED
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
