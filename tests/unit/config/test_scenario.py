from __future__ import annotations

from pathlib import Path

import pytest

from config.loader import ConfigError
from config.scenario import load_scenario, scenario_names

GOOD = """
name: test
path: {segments: [{kind: line, length_m: 5.0}]}
bodies:
  - {kind: crate, name: crate, x_m: 3.0, y_m: 1.0}
"""


def write(folder: Path, text: str) -> Path:
    file = folder / "world.yaml"
    file.write_text(text, encoding="utf-8")
    return file


def test_a_scenario_is_read_with_its_defaults(tmp_path: Path) -> None:
    scenario = load_scenario(write(tmp_path, GOOD))
    assert scenario.bodies[0].name == "crate"
    assert scenario.bodies[0].texture == "fine"
    assert scenario.outcome == "target"


@pytest.mark.parametrize("name", scenario_names())
def test_every_shipped_scenario_loads_by_its_name(name: str) -> None:
    assert load_scenario(name).name == name


def test_the_default_mission_ships() -> None:
    kinds = [body.kind for body in load_scenario("warehouse").bodies]
    assert kinds.count("person") >= 2
    assert kinds.count("robot") >= 1
    assert 20.0 <= load_scenario("warehouse").path.length_m <= 25.0


@pytest.mark.parametrize(
    ("wrong", "key", "reason"),
    [
        (GOOD.replace("x_m: 3.0", "x_mm: 3.0"), "bodies.0.x_mm", "unknown key"),
        (GOOD.replace("kind: crate", "kind: tree"), "bodies.0", "tree"),
        (GOOD.replace("kind: crate, ", ""), "bodies.0", "kind"),
        (GOOD.replace("x_m: 3.0, ", ""), "bodies.0.x_m", "missing key"),
        (GOOD.replace("x_m: 3.0", "x_m: three"), "bodies.0.x_m", "'three'"),
        (GOOD.replace("x_m: 3.0", "x_m: .nan"), "bodies.0.x_m", "finite"),
        (GOOD.replace("y_m: 1.0", "y_m: 1.0, width_m: -1"), "bodies.0.width_m", "greater than 0"),
        (GOOD.replace("y_m: 1.0", "y_m: 1.0, texture: fancy"), "bodies.0.texture", "'fancy'"),
        (GOOD + "  - {kind: pole, name: crate, x_m: 1.0, y_m: 1.0}\n", "crate", "given twice"),
        (GOOD + "room: {x_min_m: 9.0, x_max_m: 1.0}\n", "room", "smaller"),
        (GOOD + "outcome: lost\n", "outcome", "'lost'"),
        (
            GOOD.replace("name: test", "name: 2024-01-02"),
            "name",
            "found 2024-01-02, which is no text: put it in quotes, '2024-01-02'",
        ),
        (GOOD.replace("x_m: 3.0", "x_m: 2024-01-02"), "bodies.0.x_m", "a valid number, found 2024-01-02"),
        (
            GOOD.replace("y_m: 1.0", "y_m: 1.0, motion: {steps: []}"),
            "bodies.0.motion.steps",
            "the list must hold at least 1, found 0",
        ),
        (
            GOOD.replace("y_m: 1.0", "y_m: 1.0, motion: {steps: [{kind: go, x_m: 1.0, y_m: 1.0}]}"),
            "bodies.0.motion.steps.0.speed_mps",
            "missing key",
        ),
        (
            GOOD.replace(
                "y_m: 1.0", "y_m: 1.0, motion: {start_jitter_s: 1.0, steps: [{kind: wait, duration_s: 1.0}]}"
            ),
            "motion",
            "must not exceed",
        ),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(tmp_path: Path, wrong: str, key: str, reason: str) -> None:
    with pytest.raises(ConfigError) as refused:
        load_scenario(write(tmp_path, wrong))
    message = str(refused.value)
    assert "world.yaml" in message
    assert key in message
    assert reason in message
    assert "\n" not in message


def test_a_list_whose_items_are_wrong_is_not_called_empty_as_well(tmp_path: Path) -> None:
    wrong = GOOD.replace("y_m: 1.0", "y_m: 1.0, motion: {steps: [{kind: wait}]}")
    with pytest.raises(ConfigError) as caught:
        load_scenario(write(tmp_path, wrong))
    assert str(caught.value).endswith("yaml: bodies.0.motion.steps.0.duration_s (crate 'crate'): missing key")


def test_an_unknown_name_is_answered_with_the_known_ones() -> None:
    with pytest.raises(ConfigError, match=r"moon.*warehouse"):
        load_scenario("moon")


@pytest.mark.parametrize("name", ["a" * 5000, "a" * 5000 + ".yaml", "a\0b", "a\0b.yaml", ""])
def test_a_name_that_no_file_can_have_is_told(name: str) -> None:
    with pytest.raises(ConfigError, match=r"no such scenario|cannot be read"):
        load_scenario(name)


def test_a_missing_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.yaml"):
        load_scenario(tmp_path / "none.yaml")


def test_a_mistake_in_a_body_names_the_body(tmp_path: Path) -> None:
    file = tmp_path / "named.yaml"
    file.write_text(
        "name: named\npath: {segments: [{kind: line, length_m: 4.0}, {kind: arc, radius_m: 3.0}]}\nbodies:\n"
        "  - {kind: crate, name: by the door, x_m: 1.0, y_m: 0.0, height_m: -1.0}\n"
        "  - {kind: crate, x_m: 1.0, y_m: 0.0}\n"
        "  - {kind: person, name: walker, x_m: 0.0, y_m: 0.0, motion: {steps: [{kind: go}]}}\n"
        "  - {kind: crat, name: odd, x_m: 1.0, y_m: 0.0}\n"
        "  - just text\n"
    )
    with pytest.raises(ConfigError) as caught:
        load_scenario(file)
    told = str(caught.value)
    assert "path.segments.1.angle_deg: missing key" in told
    assert "bodies.0.height_m (crate 'by the door'): Input should be greater than 0, found -1.0" in told
    assert "bodies.1.name (crate): missing key" in told
    assert "bodies.2.motion.steps.0.speed_mps (person 'walker'): missing key" in told
    assert "bodies.3 (crat 'odd'): its 'kind' is " in told
    assert "bodies.4: " in told
    assert "\n" not in told
