"""Arcs in radians are told before the drive."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from pydantic import ValidationError

from config.app import load_app
from config.loader import CONFIG_DIR
from config.path import ArcSpec
from config.scenario import scenario_names
from controller.mission.short_arcs import short_arc_warning

SIM = CONFIG_DIR / "sim.yaml"


def warning(scenario: str) -> str | None:
    app = load_app(SIM)
    assert app.simulation is not None
    changed = app.simulation.model_copy(update={"scenario": scenario})
    return short_arc_warning(app.model_copy(update={"simulation": changed}))


def scenario(folder: Path, radius_m: float, angle_deg: float) -> str:
    file = folder / "bend.yaml"
    arc = f"{{kind: arc, radius_m: {radius_m}, angle_deg: {angle_deg}}}"
    file.write_text(f"name: bend\npath: {{segments: [{{kind: line, length_m: 4.0}}, {arc}]}}\n")
    return str(file)


@pytest.mark.parametrize(("radius_m", "degrees"), [(3.0, 90.0), (5.0, -45.0), (12.0, 90.0), (0.5, 180.0)])
def test_an_angle_in_radians_is_told_with_what_to_write(
    radius_m: float, degrees: float, tmp_path: Path
) -> None:
    told = warning(scenario(tmp_path, radius_m, round(math.radians(degrees), 4)))
    assert told is not None
    assert "path.segments.1: the arc is only 0." in told
    assert f"if radians were meant, write {degrees:g}" in told
    assert warning(scenario(tmp_path, radius_m, degrees)) is None


def test_a_slight_bend_of_a_large_radius_is_left_alone(tmp_path: Path) -> None:
    assert warning(scenario(tmp_path, 30.0, 2.0)) is None
    assert [name for name in scenario_names() if warning(name)] == []


def test_a_blend_that_finds_no_room_in_radians_says_so() -> None:
    with pytest.raises(ValidationError, match=r"if radians were meant, write 25 "):
        ArcSpec(kind="arc", radius_m=8.0, angle_deg=0.436332, blend_m=0.8)
