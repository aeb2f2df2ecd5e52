import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from config.loader import CONFIG_DIR
from config.robot import Limits
from controller.realtime.rig import GOODBYE_S

UNIT = CONFIG_DIR / "systemd" / "treadwatch.service"
PAGE = (CONFIG_DIR.parent / "docs" / "service.md").read_text()
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


def test_it_cannot_be_enabled_because_the_robot_would_drive_off_at_power_on() -> None:
    lines = UNIT.read_text().splitlines()
    assert "[Install]" not in lines
    assert not any(line.startswith("WantedBy") for line in lines)
    assert "no `systemctl enable`" in PAGE


def test_the_longest_stop_fits_before_it_is_killed() -> None:
    """3 m/s at 0.2 m/s2 and the default jerk; then the perception process is waited for."""
    seconds = next(line for line in UNIT.read_text().splitlines() if line.startswith("TimeoutStopSec="))
    slowest = Limits(max_speed_mps=3.0, max_accel_mps2=0.2)
    stop_s = 3.0 / slowest.max_accel_mps2 + slowest.max_accel_mps2 / slowest.max_jerk_mps3
    assert int(seconds.partition("=")[2]) > stop_s + GOODBYE_S + 5.0


def test_the_governor_s_socket_has_a_folder() -> None:
    assert "RuntimeDirectory=treadwatch" in UNIT.read_text().splitlines()
    for text in (PAGE, (CONFIG_DIR / "governor.yaml").read_text()):
        assert "path: /run/treadwatch/governor.sock" in text


@pytest.mark.parametrize(
    "group", ["ttyUSB", "ttyACM", "ttyS", "ttyAMA", "ttyTHS", "video4linux", "usb_device"]
)
def test_ports_and_cameras_may_be_opened(group: str) -> None:
    assert f"DeviceAllow=char-{group} rw" in UNIT.read_text().splitlines()


def test_service_can_keep_its_compiled_code_and_waits_for_the_first_start() -> None:
    """The project's folder and the user's home may not be written to by the service."""
    lines = UNIT.read_text().splitlines()
    kept = next(line for line in lines if line.startswith("Environment=NUMBA_CACHE_DIR="))
    folder = next(line for line in lines if line.startswith("CacheDirectory="))
    assert kept.endswith("/var/cache/" + folder.partition("=")[2])
    seconds = next(line for line in lines if line.startswith("TimeoutStartSec="))
    assert int(seconds.partition("=")[2]) >= 600
    assert "/var/cache/treadwatch" in PAGE
