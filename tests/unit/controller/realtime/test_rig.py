"""What a drive in real time has around its loop, where the drive ends with an error."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from config.app import RealtimeRunner, load_app
from config.loader import CONFIG_DIR
from controller.build import build_control
from controller.console import Console
from controller.realtime import rig as realtime_rig
from controller.realtime.channel import Channel, channel_sockets
from controller.realtime.punctual import PunctualChassis
from controller.realtime.rig import RealtimeRig
from controller.realtime.runner import PerceptionLink, Punctuality
from controller.result import MissionOptions
from hal.clocks import MonotonicClock
from tests.support.obedient_chassis import ObedientChassis


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
    path = CONFIG_DIR / "sim-realtime.yaml"
    config, clock = load_app(path), MonotonicClock()
    assert isinstance(config.runner, RealtimeRunner)
    punctual = PunctualChassis(chassis, clock, 20_000_000)
    rig = RealtimeRig(
        config, config.runner, MissionOptions(Path(path)), clock, 0, punctual, None, Punctuality()
    )
    loop = build_control(config, path, punctual)

    def drive() -> None:
        with rig.under_way(loop, Console(quiet=True), lambda _service: None) as moments:
            next(moments)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        drive()
    assert stopped_before_the_end_of_perception == [True]
