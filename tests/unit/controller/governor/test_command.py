"""Where `treadwatch govern` listens for commands."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from config.app import load_app
from config.loader import CONFIG_DIR
from controller.build import open_commands


def test_socket_path_is_relative_to_the_yaml(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "robot").mkdir()
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    content = yaml.safe_load((CONFIG_DIR / "governor.yaml").read_text())
    content["governor"]["input"] = {"kind": "unix", "path": "governor.sock"}
    (tmp_path / "robot" / "governor.yaml").write_text(yaml.safe_dump(content))
    with open_commands(load_app(tmp_path / "robot" / "governor.yaml")):
        assert (tmp_path / "robot" / "governor.sock").is_socket()
    assert not (tmp_path / "robot" / "governor.sock").exists()
