from pathlib import Path

import pytest
import yaml

from config.app import load_app, load_replay
from config.loader import CONFIG_DIR, ConfigError
from config.scenario import load_scenario


def refusal(tmp_path: Path, *keys: str, base: str = "sim.yaml") -> str:
    """What is said of a shipped file with one more key, at the end of these."""
    content = yaml.safe_load((CONFIG_DIR / base).read_text())
    section = content
    for key in keys[:-1]:
        section = section.setdefault(key, {})
    section[keys[-1]] = 1
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(ConfigError) as caught:
        load_app(path)
    return str(caught.value).removeprefix(f"{path}: ")


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        (("robt",), "robt: unknown key; did you mean robot?"),
        (
            ("robot", "limits", "max_sped_mps"),
            "robot.limits.max_sped_mps: unknown key; did you mean max_speed_mps?",
        ),
        # A union that `kind` decides: the keys of that kind alone.
        (("camera", "fsp"), "camera.fsp: unknown key; did you mean fps?"),
        (
            ("chassis", "comand_timeout_ms"),
            "chassis.comand_timeout_ms: unknown key; did you mean command_timeout_ms?",
        ),
        (("chassis", "link", "chanel"), "chassis.link.chanel: unknown key; did you mean channel?"),
        (
            ("simulation", "xyz"),
            "simulation.xyz: unknown key; known here: base, own_parts, plant, scenario, seed",
        ),
    ],
)
def test_the_key_that_was_meant_is_named(tmp_path: Path, keys: tuple[str, ...], said: str) -> None:
    assert refusal(tmp_path, *keys) == said


def test_another_kind_has_other_keys(tmp_path: Path) -> None:
    said = refusal(tmp_path, "chassis", "watchdog", base="hil-roboteq.yaml")
    assert said == "chassis.watchdog: unknown key; did you mean watchdog_ms?"


def test_known_keys_are_listed_once(tmp_path: Path) -> None:
    path = tmp_path / "other.yaml"
    path.write_text("abc: 1\nxyz: 2\n")
    with pytest.raises(ConfigError) as caught:
        load_replay(path)
    assert str(caught.value) == (
        f"{path}: abc: unknown key; known here: assume_mount, camera, decision, perception, robot; "
        "xyz: unknown key"
    )


def test_the_right_key_is_proposed_within_a_list_too(tmp_path: Path) -> None:
    path = tmp_path / "hall.yaml"
    path.write_text("name: hall\npath: {segments: [{kind: arc, radius_m: 3.0, angle_deg: 9.0, radios: 1}]}\n")
    with pytest.raises(ConfigError, match=r"radios: unknown key; did you mean radius_m\?"):
        load_scenario(path)
