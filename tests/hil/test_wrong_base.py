"""The whole program in front of a wrong base, or of none: one line, exit code 2, and nothing has moved."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from config.chassis import SerialLinkConfig
from hal.links.pseudo_terminal import PseudoTerminal
from tests.support.hil_missions import emulator, short_mission
from tests.support.wires import open_serial_link


def refusal(config: Path) -> str:
    """What `treadwatch run` says before it gives up."""
    command = [sys.executable, "-m", "controller", "run", "--config", str(config), "--quiet"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=90, check=False)
    assert done.returncode == 2, done.stdout + done.stderr
    assert done.stdout == "", "no summary of a drive that was none"
    lines = done.stderr.splitlines()
    assert len(lines) == 1, done.stderr
    return lines[0]


def with_port(config: Path, port: str) -> Path:
    line = port_line(config)
    config.write_text(config.read_text().replace(line, f"{line.split('url:')[0]}url: {port}"))
    return config


def port_line(config: Path) -> str:
    return next(line for line in config.read_text().splitlines() if line.strip().startswith("url:"))


def test_a_port_that_is_not_there(tmp_path: Path) -> None:
    said = refusal(with_port(short_mission("roboclaw", tmp_path), "/dev/ttyNotThere"))
    assert said.startswith("treadwatch: serial port /dev/ttyNotThere: cannot be opened (")
    assert "check the url and that the adapter is plugged in (" in said


def test_a_file_that_is_no_port(tmp_path: Path) -> None:
    (tmp_path / "plain").touch()
    said = refusal(with_port(short_mission("kobuki", tmp_path), str(tmp_path / "plain")))
    assert "is not a serial port that takes 115200 baud" in said


def test_a_port_in_use(tmp_path: Path) -> None:
    with PseudoTerminal() as terminal, open_serial_link(SerialLinkConfig(url=terminal.path)):
        said = refusal(with_port(short_mission("roboteq", tmp_path), terminal.path))
    assert f"serial port {terminal.path}: in use by another program; stop that one first" in said


def test_a_wrong_model_and_a_model_without_that_port(tmp_path: Path) -> None:
    config = short_mission("agilex-serial", tmp_path)
    right = config.read_text()
    config.write_text(right.replace("model: bunker", "model: hunter"))
    said = refusal(config)
    assert "chassis.model: Input should be 'bunker', 'bunker_mini'" in said
    assert said.endswith("found 'hunter'")
    config.write_text(right.replace("model: bunker", "model: tracer"))
    assert "tracer cannot be driven over a serial port" in refusal(config)


def test_a_port_where_nobody_answers_is_refused_in_one_line(tmp_path: Path) -> None:
    with PseudoTerminal() as terminal:
        said = refusal(with_port(short_mission("roboteq", tmp_path), terminal.path))
    assert said.startswith(
        f"treadwatch: roboteq on serial port {terminal.path} at 115200 baud: arming gave up"
    )
    assert "not one byte came; check port, power, baud and the crossed lines" in said
    assert said.endswith("nothing has moved")


def test_a_base_that_speaks_another_protocol_is_refused_in_one_line(
    tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    if not request.config.getoption("--hil"):
        pytest.skip("a quarter of a minute; with --hil")
    config = short_mission("kobuki", tmp_path)
    with emulator("kobuki", config):
        port = port_line(config).split("url:")[1].strip()
        (tmp_path / "other").mkdir()
        said = refusal(with_port(short_mission("agilex-serial", tmp_path / "other"), port))
    assert said.startswith(f"treadwatch: agilex bunker on serial port {port}")
    assert "not one frame with a right checksum; check baud (115200) and that it is an AgileX base" in said
