"""kill -9 of the perception process while the robot drives: a jerk-limited stop, and never on again."""

import os
import signal
import subprocess
import sys
from pathlib import Path

from config.loader import CONFIG_DIR
from tests.support.drive_process import perception_of

SCENARIO = Path(__file__).resolve().parents[1] / "scenarios" / "long_aisle.yaml"


def test_the_robot_stops_within_its_limits_and_says_why() -> None:
    command = [sys.executable, "-u", "-m", "controller", "run"]
    command += ["--config", str(CONFIG_DIR / "sim-realtime.yaml"), "--scenario", str(SCENARIO)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        driving = next(line for line in process.stdout if " increase " in line)
        assert driving
        os.kill(perception_of(process), signal.SIGKILL)
        out, err = process.communicate(timeout=60)
    assert process.returncode == 1, out + err
    assert "broken off (perception is lost" in out
    assert "limits      kept in" in out
    assert "contacts    0;" in out
    assert "Traceback" not in err
