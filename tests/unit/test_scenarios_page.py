"""docs/scenarios.md: its example is a scenario, and it names every fault."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from config.app import load_app
from config.faults import Faults
from config.loader import CONFIG_DIR
from config.scenario import load_scenario
from controller.mission.close_by import close_by_warning
from controller.mission.possible_world import require_possible_world

PAGE = (Path(__file__).parents[2] / "docs" / "scenarios.md").read_text()


def test_the_example_can_be_driven(tmp_path: Path) -> None:
    example = re.search(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    assert example is not None
    file = tmp_path / "example.yaml"
    file.write_text(example[1])
    scenario = load_scenario(file)
    assert scenario.faults.no_frames
    app = load_app(CONFIG_DIR / "sim.yaml")
    assert app.simulation is not None
    simulation = app.simulation.model_copy(update={"scenario": str(file)})
    app = app.model_copy(update={"simulation": simulation})
    require_possible_world(app)
    assert close_by_warning(app) is None


@pytest.mark.parametrize("key", Faults.model_fields)
def test_every_fault_is_on_the_page(key: str) -> None:
    assert f"| `{key}` |" in PAGE
