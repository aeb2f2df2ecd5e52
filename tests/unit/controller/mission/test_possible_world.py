"""Worlds that nobody could drive in are refused in one line; those that ship are none of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.app import load_app
from config.loader import CONFIG_DIR, ConfigError
from config.scenario import scenario_names
from controller.mission.command import run_mission
from controller.mission.options import MissionOptions
from controller.mission.possible_world import require_possible_world

SIM = CONFIG_DIR / "sim.yaml"
OURS = sorted((Path(__file__).resolve().parents[3] / "scenarios").glob("*.yaml"))
WORLD = """
name: mine
path: {{start: {{x_m: {x}, y_m: 0.0}}, segments: [{{kind: line, length_m: {length}}}]}}
room: {{x_min_m: -4.0, x_max_m: 10.0, y_min_m: -3.0, y_max_m: 3.0}}
bodies:
  - {{kind: crate, name: box, x_m: 3.0, y_m: 0.0}}
  - {{kind: beam, name: lintel, x_m: 6.0, y_m: 0.0, z_m: 2.0}}
"""


def require(scenario: str, config: str = "sim.yaml") -> None:
    app = load_app(CONFIG_DIR / config)
    assert app.simulation is not None
    simulation = app.simulation.model_copy(update={"scenario": scenario})
    require_possible_world(app.model_copy(update={"simulation": simulation}))


def written(folder: Path, x: float = 0.0, length: float = 6.0) -> str:
    file = folder / "world.yaml"
    file.write_text(WORLD.format(x=x, length=length))
    return str(file)


@pytest.mark.parametrize("scenario", [*scenario_names(), *map(str, OURS)])
def test_every_scenario_that_ships_can_be_driven_in(scenario: str) -> None:
    require(scenario)


@pytest.mark.parametrize(("x", "length"), [(0.0, 9.9), (6.0, 2.0)])
def test_a_crate_on_the_way_and_a_beam_overhead_are_possible(tmp_path: Path, x: float, length: float) -> None:
    require(written(tmp_path, x, length))


@pytest.mark.parametrize(
    ("x", "length", "told"),
    [
        (0.0, 10.5, "path: leaves the room 10.0 m from its start, at x 10.0, y 0.0; the room is x -4 to 10"),
        (-5.0, 4.0, "path.start: at x -5, y 0 the robot stands outside of the room, x -4 to 10, y -3 to 3"),
        (-3.9, 4.0, "path.start: at x -3.9, y 0 the robot already touches a wall of the room; move either"),
        (3.1, 4.0, "path.start: at x 3.1, y 0 the robot already touches the body 'box'; move either"),
    ],
)
def test_undrivable_world_is_refused_with_its_place(
    tmp_path: Path, x: float, length: float, told: str
) -> None:
    with pytest.raises(ConfigError) as refused:
        require(written(tmp_path, x, length))
    assert f"world.yaml: {told}" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_governed_robot_drives_no_path(tmp_path: Path) -> None:
    require(written(tmp_path, length=100.0), "governor.yaml")
    with pytest.raises(ConfigError, match="outside of the room"):
        require(written(tmp_path, x=-5.0), "governor.yaml")


def test_a_drive_is_refused_before_it_begins(tmp_path: Path) -> None:
    seen = tmp_path / "seen.jsonl"
    with pytest.raises(ConfigError, match="leaves the room"):
        run_mission(MissionOptions(SIM, written(tmp_path, length=50.0), observations=seen))
    assert not seen.exists()
