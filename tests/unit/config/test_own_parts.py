"""Parts of the robot in its camera's view, as written in YAML."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
import yaml

from config.app import load_app, load_replay
from config.loader import CONFIG_DIR, ConfigError

SIM = yaml.safe_load((CONFIG_DIR / "sim.yaml").read_text())
BUMPER = {"name": "bumper", "from_m": [0.40, -0.35, 0.25], "to_m": [0.51, 0.35, 0.45]}


def app(folder: Path, **changes: object) -> Path:
    """The simulation's YAML with this part."""
    content: dict[str, Any] = {**SIM, "camera": {**SIM["camera"], "own_parts": [{**BUMPER, **changes}]}}
    content["robot"] = {**SIM["robot"], "camera_mount": {"forward_m": 0.0, "height_m": 0.6, "pitch_deg": 4.0}}
    path = folder / "robot.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def replay(folder: Path, **changes: object) -> Path:
    """The same part for a replay, with the default robot."""
    path = folder / "replay.yaml"
    path.write_text(yaml.safe_dump({"camera": {"own_parts": [{**BUMPER, **changes}]}, "assume_mount": True}))
    return path


def test_a_part_is_read_as_it_is_written(tmp_path: Path) -> None:
    config = load_app(app(tmp_path))
    (part,) = config.camera.own_parts
    assert (part.name, part.from_m, part.to_m) == ("bumper", (0.40, -0.35, 0.25), (0.51, 0.35, 0.45))


def test_there_are_none_unless_they_are_given() -> None:
    assert load_app(CONFIG_DIR / "sim.yaml").camera.own_parts == ()
    assert load_replay(CONFIG_DIR / "replay.yaml").camera.own_parts == ()


def test_a_replay_with_the_yaml_of_a_robot_has_its_parts(tmp_path: Path) -> None:
    assert load_replay(app(tmp_path)).camera.own_parts == load_app(app(tmp_path)).camera.own_parts


@pytest.mark.parametrize("written", [app, replay])
@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"from_m": [0.52, -0.35, 0.25]}, "from_m must be smaller than to_m in x, y and z; x goes from 0.52"),
        ({"to_m": [0.51, 0.35, 0.25]}, "z goes from 0.25 to 0.25 m"),
        ({"to_m": [0.51, 0.35]}, r"to_m \('bumper'\): must be \[x, y, z\] in metres, found 2 numbers"),
        ({"from_m": [0.4, math.nan, 0.25]}, "from_m.1 .*finite number, found nan"),
        ({"from_m": [0.4, "left", 0.25]}, "from_m.1 .*valid number, found 'left'"),
        ({"from_m": 0.4}, "from_m .*Input should be a list"),
        ({"to_m": [510, 350, 450]}, "to_m.0 .*less than or equal to 10"),
        ({"size_m": [1, 1, 1]}, "size_m .*unknown key"),
        ({"name": ""}, "name.* at least 1 character"),
        ({"to_m": [0.62, 0.35, 0.45]}, r"\('bumper'\): reaches 0.11 m beyond the robot's front, where it"),
        ({"from_m": [-0.60, -0.35, 0.25]}, "reaches 0.09 m beyond the robot's tail"),
        ({"to_m": [0.51, 0.50, 0.45]}, "reaches 0.11 m beyond the robot's left side"),
        ({"from_m": [0.40, -0.50, 0.25]}, "reaches 0.11 m beyond the robot's right side"),
    ],
)
def test_impossible_parts_are_refused_in_one_line(
    tmp_path: Path, written: Any, changes: dict[str, object], says: str
) -> None:
    load = load_app if written is app else load_replay
    with pytest.raises(ConfigError, match=says) as refused:
        load(written(tmp_path, **changes))
    assert "\n" not in str(refused.value)
    assert str(refused.value).startswith(f"{tmp_path}/{written.__name__.replace('app', 'robot')}.yaml: ")


def test_a_box_around_the_camera_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"\('bumper'\): the camera itself is inside this box"):
        load_app(app(tmp_path, from_m=[-0.1, -0.35, 0.25], to_m=[0.51, 0.35, 0.65]))


def test_a_bumper_may_be_measured_a_few_centimetres_too_long(tmp_path: Path) -> None:
    assert load_app(app(tmp_path, to_m=[0.555, 0.35, 0.45])).camera.own_parts[0].to_m[0] == 0.555


def test_two_parts_with_one_name_are_refused(tmp_path: Path) -> None:
    path = app(tmp_path)
    content = yaml.safe_load(path.read_text())
    content["camera"]["own_parts"] *= 2
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(ConfigError, match="names must be unique; bumper is given twice"):
        load_app(path)
