"""Where `treadwatch govern` listens for commands."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.governor import UnixInputConfig
from controller.build import open_commands


def test_socket_path_is_relative_to_the_yaml(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "robot").mkdir()
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    config = UnixInputConfig(kind="unix", path="governor.sock")
    with open_commands(config, tmp_path / "robot" / "governor.yaml"):
        assert (tmp_path / "robot" / "governor.sock").is_socket()
    assert not (tmp_path / "robot" / "governor.sock").exists()
