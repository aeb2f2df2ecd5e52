"""A mission in real time, with the base emulated by another process: the whole program, over real links."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from config.app import HIL_BASES
from controller.faults.kills import KILLS, run_kill
from tests.support.hil_missions import emulator, short_mission

QUICK = "agilex"


@pytest.mark.parametrize("kind", HIL_BASES)
def test_the_mission_is_reached(kind: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    if kind != QUICK and not request.config.getoption("--hil"):
        pytest.skip("one kind is enough for every day; all of them with --hil")
    config = short_mission(kind, tmp_path)
    with emulator(kind, config) as process:
        drive = [sys.executable, "-m", "controller", "run", "--config", str(config), "--quiet"]
        done = subprocess.run(drive, capture_output=True, text=True, timeout=90, check=False)
        assert "target reached; 1.50 m" in done.stdout, done.stdout + done.stderr
        assert done.returncode == 0, done.stdout + done.stderr
        process.send_signal(signal.SIGTERM)
        told, complaints = process.communicate(timeout=10)
        assert (process.returncode, complaints) == (0, ""), complaints
        assert told.endswith("SIGTERM: ended\n")
    assert not list(tmp_path.glob(f"{kind}-*")), "the link to the port is gone"


@pytest.mark.parametrize("fault", KILLS)
def test_a_process_that_dies_or_hangs_leaves_a_base_that_stands(
    fault: str, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    if not request.config.getoption("--hil"):
        pytest.skip("a quarter of a minute each; with --hil")
    result = run_kill("agilex", short_mission("agilex", tmp_path, 12.0), fault)
    if fault.startswith("kill -9 of the emulator"):
        assert result.stood_after_s is None
    else:
        assert result.stood_after_s is not None
        assert result.stood_after_s < 6.0
    asked = fault in ("SIGTERM to control", "perception frozen (SIGSTOP)")
    assert result.exit_code == (None if fault == "kill -9 of control" else 0 if asked else 1)
