"""What stands too near to the path is told before a simulated drive."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.app import load_app
from config.loader import CONFIG_DIR
from config.scenario import load_scenario, scenario_names
from controller.mission.close_by import close_by_warning

SIM = CONFIG_DIR / "sim.yaml"
HALF_WIDTH_M = 0.39


def warning(scenario: str) -> str | None:
    app = load_app(SIM)
    assert app.simulation is not None
    changed = app.simulation.model_copy(update={"scenario": scenario})
    return close_by_warning(app.model_copy(update={"simulation": changed}))


def scenario(folder: Path, *bodies: str, outcome: str = "target") -> str:
    file = folder / "close.yaml"
    path = "path: {segments: [{kind: line, length_m: 8.0}]}"
    text = "".join(f"  - {{{body}}}\n" for body in bodies)
    file.write_text(f"name: close\noutcome: {outcome}\n{path}\nbodies:\n{text}")
    return str(file)


def crate(gap_m: float, more: str = "") -> str:
    """A crate of 0.6 m to the left of the path."""
    return f"kind: crate, name: crate X, x_m: 5.0, y_m: {HALF_WIDTH_M + gap_m + 0.3}{more}"


@pytest.mark.parametrize(
    ("gap_m", "told"),
    [
        (
            0.20,
            "passes 0.20 m from 'crate X', 4.2 m along the path; it needs 0.25 m, the robot may wait",
        ),
        (
            0.10,
            "passes 0.10 m from 'crate X', 4.2 m along the path; it needs 0.25 m, the robot will wait",
        ),
        (-0.5, "the robot would touch 'crate X' 4.2 m along the path, and will wait before it"),
    ],
)
def test_a_crate_too_near_is_told_with_place_and_need(gap_m: float, told: str, tmp_path: Path) -> None:
    said = warning(scenario(tmp_path, crate(gap_m)))
    assert said is not None
    assert f"close.yaml: path: {told}" in said


@pytest.mark.parametrize(
    ("x_m", "told"),
    [
        (
            4.0,
            "the robot would touch 'crate X' where it ends 3.2 m along the path, and will wait before it, "
            "if it is there first",
        ),
        (9.0, "'crate X' where it ends stands less than margins.stop_m (0.45 m) behind the target"),
    ],
)
def test_a_mover_that_ends_on_the_path_or_behind_the_target_is_told(
    x_m: float, told: str, tmp_path: Path
) -> None:
    ends = f", motion: {{steps: [{{kind: go, x_m: {x_m}, y_m: 0.0, speed_mps: 1.0}}]}}"
    said = warning(scenario(tmp_path, crate(2.0, ends)))
    assert said is not None
    assert told in said


def test_no_warning_for_enough_room_for_who_moves_on_or_for_intended_blocks(tmp_path: Path) -> None:
    assert warning(scenario(tmp_path, crate(0.25))) is None
    moving = ", motion: {steps: [{kind: go, x_m: 5.0, y_m: 4.0, speed_mps: 1.0}]}"
    assert warning(scenario(tmp_path, crate(0.1, moving))) is None
    assert warning(scenario(tmp_path, crate(0.1, ", z_m: 1.5"))) is None
    assert warning(scenario(tmp_path, crate(0.1), outcome="blocked")) is None


def test_a_target_too_near_to_a_wall_is_told(tmp_path: Path) -> None:
    said = warning(scenario(tmp_path, "kind: wall, name: end, x_m: 9.0, y_m: 0.0, heading_deg: 90.0"))
    assert said is not None
    assert "'end' stands less than margins.stop_m (0.45 m) behind the target" in said


def test_warning_names_at_most_three_bodies(tmp_path: Path) -> None:
    crates = [
        f"kind: crate, name: crate {k}, x_m: {2.0 + 1.5 * k}, y_m: 0.85, length_m: 0.3" for k in range(4)
    ]
    said = warning(scenario(tmp_path, *crates))
    assert said is not None
    assert said.count("passes") == 3
    assert said.endswith("; and 1 more")


def test_the_scenarios_that_ship_have_room() -> None:
    told = {name: warning(name) for name in scenario_names()}
    assert {name for name, said in told.items() if said} == set()
    assert any(load_scenario(name).outcome == "blocked" for name in told)
