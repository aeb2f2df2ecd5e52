"""A robot whose bumper is in its camera's view, in the whole line: rendered, perceived, decided, driven."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml

from config.loader import CONFIG_DIR
from tests.support.command_line import treadwatch

CROSSING = Path(__file__).resolve().parents[3] / "scenarios" / "short_crossing.yaml"
SIM = yaml.safe_load((CONFIG_DIR / "sim.yaml").read_text())
BUMPER = {"name": "bumper", "from_m": [0.40, -0.35, 0.25], "to_m": [0.51, 0.35, 0.45]}


def drive(folder: Path, given: bool, **runner: float) -> tuple[int, str, list[dict[str, Any]]]:
    """Exit code, summary and observations. The camera is at the turning centre, the bumper 0.4 m ahead.

    given: the bumper is in camera.own_parts.
    """
    own = [BUMPER] if given else []
    mount = {"forward_m": 0.0, "height_m": 0.6, "pitch_deg": 4.0}
    content = {
        **SIM,
        "robot": {**SIM["robot"], "camera_mount": mount},
        "camera": {**SIM["camera"], "own_parts": own},
        "simulation": {**SIM["simulation"], "scenario": str(CROSSING), "own_parts": [BUMPER]},
        "runner": {**SIM["runner"], **runner},
    }
    path, observations = folder / "robot.yaml", folder / "o.jsonl"
    path.write_text(yaml.safe_dump(content))
    done = treadwatch("run", "--config", path, "--observations", observations, "--quiet")
    return done.returncode, done.stdout, [json.loads(line) for line in observations.read_text().splitlines()]


def test_unless_it_is_given_the_robot_stands(tmp_path: Path) -> None:
    code, summary, frames = drive(tmp_path, given=False, max_standing_s=2.0)
    assert code == 1
    assert "0.00 m in 2" in summary
    assert {frame["decision"]["target_speed_mps"] for frame in frames if frame["decision"]} == {0.0}


def test_if_it_is_given_the_target_is_reached_and_who_crosses_behind_it_is_detected(tmp_path: Path) -> None:
    code, summary, frames = drive(tmp_path, given=True)
    assert code == 0, summary
    assert "target reached" in summary
    crossing = [one for frame in frames for one in frame["obstacles"] if one["moving"]]
    # The walker: 1.2 m/s from left to right, in more than three seconds of the drive.
    assert len(crossing) > 100
    speeds = sorted(one["velocity"][0] for one in crossing)
    assert speeds[len(speeds) // 2] == pytest.approx(1.2, abs=0.15)
    assert all(one["position"][2] > 1.0 for frame in frames for one in frame["obstacles"])
    # Of its own bumper nothing is told as the camera's fault.
    assert {frame["camera"]["reason"] for frame in frames} == {""}
