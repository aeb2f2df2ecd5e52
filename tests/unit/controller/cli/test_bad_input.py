"""A mistake in a configuration or on the command line is one line: what, where and why; exit code 2."""

from pathlib import Path

import pytest
import yaml

from config.loader import CONFIG_DIR
from tests.support.command_line import refusal, treadwatch


def changed_config(tmp_path: Path, **changes: object) -> Path:
    """sim.yaml with sections replaced; None takes one out."""
    content = yaml.safe_load((CONFIG_DIR / "sim.yaml").read_text())
    for key, value in changes.items():
        if value is None:
            del content[key]
        else:
            content[key] = value
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def test_a_config_that_is_not_there() -> None:
    assert "nowhere.yaml: cannot be read (No such file" in refusal("run", "--config", "nowhere.yaml")


def test_an_unknown_key_is_told_with_its_place(tmp_path: Path) -> None:
    config = changed_config(tmp_path, robot={"limits": {"max_sped_mps": 1.0}})
    message = refusal("run", "--config", config)
    assert "mine.yaml: robot.limits.max_sped_mps: unknown key" in message


def test_a_wrong_value_and_a_missing_section_are_told_together(tmp_path: Path) -> None:
    config = changed_config(tmp_path, robot={"limits": {"max_accel_mps2": -0.3}}, chassis=None)
    message = refusal("run", "--config", config)
    assert "robot.limits.max_accel_mps2: Input should be greater than or equal to 0.01, found -0.3" in message
    assert "chassis: missing key" in message


def test_parts_that_do_not_fit_together(tmp_path: Path) -> None:
    assert "needs a 'simulation' section" in refusal(
        "run", "--config", changed_config(tmp_path, simulation=None)
    )


def test_a_camera_that_is_not_there(tmp_path: Path) -> None:
    content = yaml.safe_load((CONFIG_DIR / "governor.yaml").read_text())
    camera = {"kind": "realsense", "serial": "000000000000"}
    message = refusal(
        "govern", "--config", changed_config(tmp_path, **content | {"camera": camera}), "--quiet"
    )
    assert message.startswith("treadwatch: camera: RealSense")
    assert message.endswith("; nothing has moved")


def test_consequences_of_a_wrong_value_are_not_reported(tmp_path: Path) -> None:
    config = changed_config(tmp_path, camera={"kind": "simulated", "width": 7})
    assert refusal("run", "--config", config) == (
        f"treadwatch: {config}: camera.width: Input should be greater than or equal to 32, found 7"
    )


def test_a_body_too_narrow_to_be_one(tmp_path: Path) -> None:
    config = changed_config(tmp_path, robot={"body": {"width_m": 1e-9}})
    assert "robot.body.width_m: Input should be greater than or equal to 0.05" in refusal(
        "run", "--config", config
    )


def test_a_path_that_the_robot_cannot_drive(tmp_path: Path) -> None:
    scenario = yaml.safe_load((CONFIG_DIR / "scenarios" / "empty.yaml").read_text())
    scenario["path"]["segments"] = [{"kind": "arc", "radius_m": 0.05, "angle_deg": 90.0}]
    (tmp_path / "tight.yaml").write_text(yaml.safe_dump(scenario))
    message = refusal("run", "--scenario", tmp_path / "tight.yaml")
    assert "radius" in message


def test_for_an_unknown_scenario_the_nearest_name_is_proposed() -> None:
    message = refusal("run", "--scenario", "warehous")
    assert "warehous: there is no such scenario; did you mean warehouse?" in message


def test_a_can_interface_that_is_not_there(tmp_path: Path) -> None:
    link = {"interface": "socketcan", "channel": "can7"}
    config = changed_config(tmp_path, chassis={"kind": "agilex", "model": "bunker", "link": link})
    message = refusal("run", "--config", config)
    assert "can7" in message


def test_a_scenario_where_nothing_is_simulated() -> None:
    message = refusal("run", "--config", CONFIG_DIR / "robot-bunker.yaml", "--seed", "3")
    assert "--seed" in message
    assert "simulates nothing" in message


def test_a_scenario_file_is_looked_for_where_the_shell_stands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert f"{tmp_path}/mine.yaml: cannot be read" in refusal("run", "--scenario", "mine.yaml")
    (tmp_path / "mine.yaml").write_text("paths: []\n")
    assert "mine.yaml: name: missing key; path: missing key" in refusal("run", "--scenario", "mine.yaml")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("run", "--sed", "3"), "No such option '--sed'"),
        (("run", "--seed", "two"), "Invalid value for '--seed': 'two' is not a valid whole number"),
        (("run", "--seed", "-2"), "Invalid value for '--seed': -2 is not in the range x>=0"),
        (("campaign", "--missions", "x", "--report", "r"), "'x' is not a valid whole number"),
        (("run", "--config", "/"), "Invalid value for '--config': File '/' is a directory"),
        (("fly",), "No such command 'fly'"),
        (("replay",), "Missing argument 'RECORDING'"),
    ],
)
def test_a_wrong_command_line(arguments: tuple[str, ...], words: str) -> None:
    message = refusal(*arguments)
    assert words in message
    assert "--help`" in message


def test_no_command_at_all_is_answered_with_the_help() -> None:
    done = treadwatch()
    assert done.returncode == 2
    assert "Usage: treadwatch [OPTIONS] COMMAND" in done.stderr


def test_an_empty_config_is_refused() -> None:
    assert refusal("run", "--config", "/dev/null") == (
        "treadwatch: /dev/null: is empty; it must hold keys and values"
    )
