"""Bodies that the drive would never show are told before it."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.app import load_app
from config.loader import CONFIG_DIR
from config.scenario import scenario_names
from controller.mission.unseen_bodies import unseen_bodies_warning


def warning(scenario: str) -> str | None:
    app = load_app(CONFIG_DIR / "sim.yaml")
    assert app.simulation is not None
    changed = app.simulation.model_copy(update={"scenario": scenario})
    return unseen_bodies_warning(app.model_copy(update={"simulation": changed}))


def scenario(folder: Path, *bodies: str) -> str:
    file = folder / "mine.yaml"
    text = "".join(f"  - {{kind: person, {body}}}\n" for body in bodies)
    file.write_text(
        "name: mine\nduration_s: 30.0\npath: {segments: [{kind: line, length_m: 8.0}]}\n"
        "room: {x_min_m: -4.0, x_max_m: 20.0, y_min_m: -5.0, y_max_m: 5.0}\n"
        f"bodies:\n{text}"
    )
    return str(file)


def go(x_m: float, y_m: float, start_s: float = 2.0) -> str:
    step = f"{{kind: go, x_m: {x_m}, y_m: {y_m}, speed_mps: 1.0}}"
    return f", motion: {{start_s: {start_s}, steps: [{step}]}}"


def test_a_body_outside_of_the_room_is_told_with_place_and_walls(tmp_path: Path) -> None:
    said = warning(scenario(tmp_path, "name: walker, x_m: 7.0, y_m: 6.5"))
    assert said == (
        f"{tmp_path / 'mine.yaml'}: bodies: 'walker' stands outside of the room (x -4 to 20, y -5 to 5), "
        "at x 7, y 6.5: the walls hide it"
    )


def test_a_goal_outside_of_the_room_is_told_once(tmp_path: Path) -> None:
    said = warning(scenario(tmp_path, "name: walker, x_m: 7.0, y_m: 3.0" + go(7.0, -9.0)))
    assert said is not None
    assert "'walker' goes outside of the room (x -4 to 20, y -5 to 5), at x 7, y -9" in said
    assert said.count("walker") == 1


def test_who_sets_off_after_the_end_is_told(tmp_path: Path) -> None:
    said = warning(scenario(tmp_path, "name: late one, x_m: 7.0, y_m: 3.0" + go(7.0, -3.0, start_s=30.0)))
    assert said is not None
    assert "'late one' sets off at 30 s, but a campaign ends after duration_s (30 s)" in said


def test_what_is_more_than_fits_a_line_is_counted(tmp_path: Path) -> None:
    bodies = [f"name: p{k}, x_m: {30 + k}, y_m: 0.0" for k in range(5)]
    said = warning(scenario(tmp_path, *bodies))
    assert said is not None
    assert "'p2'" in said
    assert "'p3'" not in said
    assert said.endswith("; and 2 more")


def test_a_body_that_is_seen_is_not_told(tmp_path: Path) -> None:
    assert warning(scenario(tmp_path, "name: walker, x_m: 7.0, y_m: 3.0" + go(7.0, -3.0, 29.0))) is None


@pytest.mark.parametrize("name", scenario_names())
def test_no_scenario_that_ships_has_one(name: str) -> None:
    assert warning(name) is None
