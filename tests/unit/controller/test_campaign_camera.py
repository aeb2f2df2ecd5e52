"""What is kept of a mission before the camera."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.scenario import load_scenario
from controller.campaign.camera_mission import recording_in
from controller.errors import UserError
from tests.support.campaign import crate, stage


def test_a_recording_has_the_world_beside_it_as_a_scenario_that_can_be_run(tmp_path: Path) -> None:
    made = stage(crate(4.0))
    options = recording_in(tmp_path / "new" / "mission", made)
    assert options.video == tmp_path / "new" / "mission" / "video.mp4"
    assert load_scenario(tmp_path / "new" / "mission" / "scenario.yaml") == made.case.scenario


def test_a_folder_for_recordings_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match=r"file/mission: cannot be written \(Not a directory\); choose"):
        recording_in(tmp_path / "file" / "mission", stage())
