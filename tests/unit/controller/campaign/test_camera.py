"""What is kept of a mission before the camera."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from config.loader import CONFIG_DIR
from config.scenario import load_scenario
from controller.campaign.camera_mission import drive_camera, prepare_recording
from controller.errors import UserError
from controller.replay.command import ReplayOptions, run_replay
from tests.support.campaign import CONFIG, crate, mover, silent, stage


def test_a_recording_has_the_world_beside_it_as_a_scenario_that_can_be_run(tmp_path: Path) -> None:
    made = stage(crate(4.0))
    options = prepare_recording(tmp_path / "new" / "mission", made)
    assert options.video == tmp_path / "new" / "mission" / "video.mp4"
    assert load_scenario(tmp_path / "new" / "mission" / "scenario.yaml") == made.case.scenario


def test_a_folder_for_recordings_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match=r"file/mission: cannot be written \(Not a directory\); choose"):
        prepare_recording(tmp_path / "file" / "mission", stage())


def movers(observations: Path) -> dict[float, list[list[float]]]:
    """By the time of the frame, where in the image something moves."""
    rows: list[dict[str, Any]] = [json.loads(line) for line in observations.read_text().splitlines()]
    return {row["stamp"]: [one["bbox"] for one in row["obstacles"] if one["moving"]] for row in rows}


def test_replay_of_a_recorded_mission_sees_the_same(tmp_path: Path) -> None:
    """Two seconds of it, of which the camera was silent for a third of one."""
    faults = silent(0.6, 0.9)
    made = stage(mover(5.0, 1.5, 5.0, -3.0, 1.0), crate(7.0, 2.0), duration_s=2.0, faults=faults)
    drive_camera(made, CONFIG, "ours", tmp_path)
    again = tmp_path / "again.jsonl"
    run_replay(ReplayOptions(tmp_path / "recording", "file", CONFIG_DIR / "replay.yaml", again, quiet=True))
    then, now = movers(tmp_path / "observations.jsonl"), movers(again)
    assert then.keys() == now.keys()
    assert sum(len(boxes) for boxes in then.values()) > 10
    for stamp, boxes in then.items():
        assert now[stamp] == [pytest.approx(box, abs=1.0) for box in boxes]
