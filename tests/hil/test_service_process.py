"""The program as a service: a real process, its notices on a real socket, SIGTERM as systemd sends it."""

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

from config.loader import CONFIG_DIR
from tests.support.drive_process import next_notice

SCENARIO = Path(__file__).resolve().parents[1] / "scenarios" / "long_aisle.yaml"


def test_ready_watchdog_stopping_and_a_clean_end(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
        receiver.bind(str(tmp_path / "notify"))
        receiver.settimeout(60.0)
        environment = dict(os.environ, NOTIFY_SOCKET=str(tmp_path / "notify"), WATCHDOG_USEC="400000")
        environment.pop("WATCHDOG_PID", None)
        command = [sys.executable, "-m", "controller", "run"]
        command += ["--config", str(CONFIG_DIR / "sim-realtime.yaml"), "--scenario", str(SCENARIO)]
        with subprocess.Popen(
            command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as process:
            assert next_notice(receiver, b"READY=1") == b"READY=1\nSTATUS=driving"
            # Fed by the control loop: it goes on while the robot drives.
            for _ in range(10):
                next_notice(receiver, b"WATCHDOG=1")
            process.send_signal(signal.SIGTERM)
            assert next_notice(receiver, b"STOPPING=1") == b"STOPPING=1\nSTATUS=SIGTERM received"
            out, err = process.communicate(timeout=60)
    assert process.returncode == 0, out + err
    assert "Traceback" not in err
    summary = {line.split(None, 1)[0]: line.split(None, 1)[1] for line in out.splitlines() if " " in line}
    assert "stopped on request (SIGTERM received)" in summary["mission"]
    # It was driving, came to rest by its profile, and broke no limit on the way.
    assert summary["limits"].startswith("kept")
    assert summary["contacts"].startswith("0;")
