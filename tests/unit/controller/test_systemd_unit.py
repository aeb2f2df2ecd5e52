import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from config.loader import CONFIG_DIR

UNIT = CONFIG_DIR / "systemd" / "treadwatch.service"
ANALYZE = shutil.which("systemd-analyze")


def verify(unit_text: str, folder: Path) -> str:
    """What `systemd-analyze verify` complains about; its exit code is 0 even for unknown keys."""
    assert ANALYZE is not None
    unit = folder / "treadwatch.service"
    # verify insists that the program exists; the installed path does not on a build machine.
    unit.write_text(unit_text.replace("/opt/treadwatch/.venv/bin/treadwatch", sys.executable))
    done = subprocess.run([ANALYZE, "verify", str(unit)], capture_output=True, text=True, check=False)
    return done.stderr


@pytest.mark.skipif(ANALYZE is None, reason="systemd-analyze is not installed")
def test_the_unit_is_valid(tmp_path: Path) -> None:
    assert verify(UNIT.read_text(), tmp_path) == ""


@pytest.mark.skipif(ANALYZE is None, reason="systemd-analyze is not installed")
def test_the_check_would_notice_an_unknown_key(tmp_path: Path) -> None:
    assert "WatchdogSecs" in verify(UNIT.read_text().replace("WatchdogSec=", "WatchdogSecs="), tmp_path)


def test_the_unit_is_the_service_that_the_program_is() -> None:
    lines = UNIT.read_text().splitlines()
    assert "Type=notify" in lines
    assert "User=treadwatch" in lines
    assert "KillSignal=SIGTERM" in lines
    assert any(line.startswith("WatchdogSec=") for line in lines)
    # A robot that stopped for a fault must not drive off again by itself.
    assert "Restart=no" in lines
