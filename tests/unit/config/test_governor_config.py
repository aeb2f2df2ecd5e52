from pathlib import Path

import pytest
import yaml

from config.app import AppConfig, load_app
from config.loader import CONFIG_DIR, ConfigError

SHIPPED = yaml.safe_load((CONFIG_DIR / "governor.yaml").read_text())


def loaded(folder: Path, **changes: object) -> AppConfig:
    path = folder / "governor.yaml"
    path.write_text(yaml.safe_dump(SHIPPED | changes))
    return load_app(path)


def test_the_file_that_ships_loads_and_says_every_default() -> None:
    config = load_app(CONFIG_DIR / "governor.yaml").governor
    assert config is not None
    assert set(SHIPPED["governor"]) == set(type(config).model_fields)
    assert config == type(config)()


@pytest.mark.parametrize(
    ("governor", "complaint"),
    [
        ({"timeout": 0.3}, "governor.timeout: unknown key"),
        ({"timeout_s": 0.0}, "governor.timeout_s"),
        ({"timeout_s": float("nan")}, "governor.timeout_s"),
        ({"input": {"kind": "tcp"}}, "governor.input"),
        ({"input": {"kind": "udp", "port": 80}}, "governor.input.port"),
        ({"input": {"kind": "unix"}}, "governor.input.path: missing key"),
        ({"input": {"kind": "unix", "path": "x" * 101}}, "governor.input.path"),
        ({"input": {"kind": "unix", "path": "a\0b"}}, "cannot hold a NUL"),
    ],
)
def test_config_error_names_the_wrong_setting(tmp_path: Path, governor: object, complaint: str) -> None:
    with pytest.raises(ConfigError) as error:
        loaded(tmp_path, governor=governor)
    assert complaint in str(error.value)


def test_a_governor_needs_real_time(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"needs runner\.kind 'realtime'"):
        loaded(tmp_path, runner={"kind": "lockstep"})


def test_a_path_and_a_governor_do_not_go_together(tmp_path: Path) -> None:
    path = {"segments": [{"kind": "line", "length_m": 3.0}]}
    with pytest.raises(ConfigError, match="not both"):
        loaded(tmp_path, path=path, camera={"kind": "realsense"}, simulation=None)


def test_a_robot_with_a_governor_needs_no_path(tmp_path: Path) -> None:
    config = loaded(tmp_path, camera={"kind": "realsense"}, simulation=None)
    assert config.governor is not None
    assert config.path is None
