"""A recording in place of the robot's camera, as the YAML names it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from config.app import load_app
from config.loader import CONFIG_DIR
from controller.build import open_camera
from hal.clocks import NS_PER_S, SimulatedClock
from tests.support.bags import small_bag
from tests.support.recordings import write_recording


@pytest.mark.parametrize("record", [write_recording, small_bag])
def test_a_recorded_camera_gives_frames_of_now(record: Callable[[Path], Path], tmp_path: Path) -> None:
    (tmp_path / "recorded").mkdir()
    recording = record(tmp_path / "recorded")
    app = yaml.safe_load((CONFIG_DIR / "robot-roboclaw.yaml").read_text())
    app["camera"] = {"kind": "replay", "folder": str(recording.relative_to(tmp_path))}
    file = tmp_path / "robot.yaml"
    file.write_text(yaml.safe_dump(app))
    clock = SimulatedClock(7000 * NS_PER_S)
    with open_camera(load_app(file), file, clock, lambda _: None, 0) as camera:
        frames = [camera.read(1.0) for _ in range(4)]
    assert frames[0].captured_ns == 7000 * NS_PER_S
    assert frames[3].captured_ns == clock.now_ns()
    assert clock.now_ns() == pytest.approx(7000.1 * NS_PER_S, abs=1e6)
