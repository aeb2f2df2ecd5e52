"""Scenario files of one's own in a campaign: `treadwatch campaign --scenario FILE`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from config.loader import ConfigError
from config.scenario import load_scenario
from controller.campaign.store import MISSIONS
from controller.cli.commands import cli
from controller.errors import UserError

WORLD = """
name: my hall
description: a crate beside the way
duration_s: 30.0
path: {segments: [{kind: line, length_m: 5.0}]}
room: {x_min_m: -4.0, x_max_m: 12.0, y_min_m: -4.0, y_max_m: 4.0}
bodies:
  - {kind: crate, name: crate, x_m: 3.0, y_m: 1.5}
faults:
  no_frames: [{start_s: 1.0, end_s: 1.4}]
"""


def campaign(*arguments: str | Path) -> str:
    """The output. What would be refused is raised."""
    result = CliRunner().invoke(
        cli, ["campaign", *map(str, arguments), "--workers", "1", "--quiet"], standalone_mode=False
    )
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.output


def rows(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / MISSIONS).read_text().splitlines()]


@pytest.fixture
def world(tmp_path: Path) -> Path:
    file = tmp_path / "hall.yaml"
    file.write_text(WORLD)
    return file


def test_own_scenarios_are_driven_with_several_seeds_and_policies(world: Path, tmp_path: Path) -> None:
    report = tmp_path / "report"
    twice = ("--missions", "4", "--policies", "ours,field", "--report", report)
    campaign("--scenario", world, "--scenario", "empty", *twice)
    found = {(row["family"], row["seed"], row["policy"]) for row in rows(report)}
    assert found == {
        (family, seed, policy)
        for family in ("hall.yaml", "empty.yaml")
        for seed in (1, 2)
        for policy in ("ours", "field")
    }
    ours = [row for row in rows(report) if (row["family"], row["policy"]) == ("hall.yaml", "ours")]
    assert all(row["reached"] for row in ours)
    assert ours[0]["min_clearance_m"] != ours[1]["min_clearance_m"], "the seeds change the noise"
    text = (report / "report.md").read_text()
    assert (
        "| hall.yaml | scenarios/hall.yaml; a crate beside the way; faults: no_frames | 1 to 2 | 2 |" in text
    )
    assert f"--scenario {world} --scenario empty" in text
    assert load_scenario(report / "scenarios" / "hall.yaml") == load_scenario(world)
    driven = json.loads((report / "summary.json").read_text())["driven"]
    assert [one["name"] for one in driven] == ["empty.yaml", "hall.yaml"]


def test_a_campaign_of_own_scenarios_is_resumed(world: Path, tmp_path: Path) -> None:
    report = tmp_path / "report"
    given = ("--scenario", world, "--policies", "field", "--report", report)
    campaign(*given, "--missions", "1")
    campaign(*given, "--missions", "2", "--resume")
    assert [row["seed"] for row in rows(report)] == [1, 2]
    campaign("--families", "empty_aisle", *given, "--missions", "2", "--resume")
    assert {row["family"] for row in rows(report)} == {"hall.yaml", "empty_aisle"}
    assert "| empty_aisle | family |" in (report / "report.md").read_text()


def test_a_changed_scenario_is_not_gone_on_with(world: Path, tmp_path: Path) -> None:
    report = tmp_path / "report"
    given = ("--scenario", world, "--policies", "field", "--report", report, "--missions", "1")
    campaign(*given)
    world.write_text(WORLD.replace("y_m: 1.5", "y_m: 1.4"))
    with pytest.raises(UserError, match="driven with another content of it"):
        campaign(*given, "--resume")
    world.write_text("# a comment\n" + WORLD)
    campaign(*given, "--resume")


def test_a_scenario_is_driven_with_the_camera_too(world: Path, tmp_path: Path) -> None:
    world.write_text(WORLD.replace("duration_s: 30.0", "duration_s: 2.0"))
    report = tmp_path / "report"
    campaign(
        "--scenario", world, "--policies", "ours", "--mode", "camera", "--missions", "1", "--report", report
    )
    assert [(row["family"], row["mode"]) for row in rows(report)] == [("hall.yaml", "camera")]


def test_one_mission_of_a_scenario_alone(world: Path) -> None:
    assert "reached in" in campaign("--only", f"{world}:3", "--policies", "field")
    assert "reached in" in campaign("--only", "hall.yaml:3", "--scenario", world, "--policies", "field")


def test_kept_scenario_without_missions_may_change(world: Path, tmp_path: Path) -> None:
    kept = tmp_path / "report" / "scenarios" / "hall.yaml"
    kept.parent.mkdir(parents=True)
    kept.write_text(WORLD.replace("y_m: 1.5", "y_m: 1.4"))
    campaign("--scenario", world, "--policies", "field", "--report", tmp_path / "report", "--missions", "1")
    assert load_scenario(kept) == load_scenario(world)


def test_a_world_without_bodies_has_no_clearance_to_tell(world: Path, tmp_path: Path) -> None:
    world.write_text(
        "".join(line for line in WORLD.splitlines(True) if "crate" not in line or "desc" in line)
    )
    world.write_text(world.read_text().replace("bodies:", "bodies: []").replace("a crate beside", "a | b"))
    report = tmp_path / "report"
    given = ("--scenario", world, "--policies", "field", "--report", report, "--missions", "1")
    campaign(*given)
    campaign(*given, "--resume")
    assert rows(report)[0]["min_clearance_m"] is None
    assert "; a \\| b the way; " in (report / "report.md").read_text()


def test_doubtful_scenario_is_reported(world: Path) -> None:
    world.write_text(WORLD.replace("y_m: 1.5", "y_m: 0.89"))
    assert "from 'crate'" in campaign("--only", f"{world}:3", "--policies", "field")


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (("--scenario", "no_such"), "no_such: there is no such scenario"),
        (("--scenario", "no_such.yaml"), "no_such.yaml: cannot be read"),
        (("--scenario", "empty", "--scenario", "empty"), "another one is called empty.yaml, too"),
        (("--only", "no_such.yaml:3"), "no_such.yaml: cannot be read"),
    ],
)
def test_mistakes_are_told_before_anything_is_written(
    given: tuple[str, ...], told: str, tmp_path: Path
) -> None:
    with pytest.raises((ConfigError, UserError), match=told):
        campaign(*given, "--report", tmp_path / "report")
    assert not (tmp_path / "report").exists()


def test_a_world_in_which_nothing_can_be_driven_is_refused(world: Path, tmp_path: Path) -> None:
    world.write_text(WORLD.replace("x_m: 3.0, y_m: 1.5", "x_m: 0.0, y_m: 0.0"))
    with pytest.raises(ConfigError, match="already touches the body 'crate'"):
        campaign("--scenario", world, "--report", tmp_path / "report")
