"""The contract suite as for a real base (docs/add-a-chassis.md, step 9), with an emulator at the port."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from config.app import load_app
from config.chassis import CanLinkConfig
from config.loader import CONFIG_DIR
from tests.support.hil_missions import emulator, short_mission

SUITE = "tests/contract/test_chassis_contract.py"


@pytest.mark.parametrize("kind", ["agilex", "roboteq"])
def test_the_suite_for_a_real_base_passes(kind: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    if not request.config.getoption("--hil"):
        pytest.skip("most of a minute each; with --hil")
    config = short_mission(kind, tmp_path)
    link = load_app(config).chassis.link
    channel = link.channel if isinstance(link, CanLinkConfig) else link.url
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--hil", SUITE]
    command += ["--channel", channel, "--base", str(config)]
    with emulator(kind, config):
        done = subprocess.run(
            command, cwd=CONFIG_DIR.parent, capture_output=True, text=True, timeout=180, check=False
        )
    assert done.returncode == 0, done.stdout + done.stderr
    assert " passed" in done.stdout
