"""SIGTERM and Ctrl-C while the program closes: the drive has ended, and its result is told and written."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import pytest
import yaml

from config.loader import CONFIG_DIR
from tests.support.drive_process import next_notice, perception_of

SCENARIO = Path(__file__).resolve().parents[1] / "scenarios" / "short_crossing.yaml"


@contextmanager
def closing(folder: Path, arguments: list[str]) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """A drive at the moment at which it has ended, and the process of perception."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
        receiver.bind(str(folder / "notify"))
        receiver.settimeout(120.0)
        environment = dict(os.environ, NOTIFY_SOCKET=str(folder / "notify"))
        command = [sys.executable, "-m", "controller", "run", *arguments]
        with subprocess.Popen(
            command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as process:
            next_notice(receiver, b"STOPPING=1")
            yield process, perception_of(process)


def result_of(process: subprocess.Popen[str], number: signal.Signals, perception: int) -> tuple[str, str]:
    """What it says, signalled twice. Perception has ended with it."""
    for _ in range(2):
        process.send_signal(number)
        time.sleep(0.05)
    said = process.communicate(timeout=60)
    assert not Path(f"/proc/{perception}").exists()
    return said


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_two_signals_lose_neither_summary_nor_files(tmp_path: Path, number: signal.Signals) -> None:
    seen, video = tmp_path / "seen.jsonl", tmp_path / "drive.mp4"
    arguments = ["--config", str(CONFIG_DIR / "sim-realtime.yaml"), "--scenario", str(SCENARIO)]
    arguments += ["--observations", str(seen), "--video", str(video)]
    with closing(tmp_path, arguments) as (process, perception):
        out, err = result_of(process, number, perception)
    assert process.returncode == 0, out + err
    assert ": target reached;" in out
    assert "limits      kept in" in out
    assert err == ""
    lines = seen.read_text().splitlines()
    assert len(lines) > 20
    assert json.loads(lines[-1])["obstacles"] is not None
    pictures = cv2.VideoCapture(str(video))
    shown_s = pictures.get(cv2.CAP_PROP_FRAME_COUNT) / pictures.get(cv2.CAP_PROP_FPS)
    pictures.release()
    # The end may be shorter: what is closing does not wait for repeated pictures.
    assert shown_s == pytest.approx(json.loads(lines[-1])["stamp"] - json.loads(lines[0])["stamp"], abs=2.0)


def test_a_base_that_does_not_arm_is_still_told(tmp_path: Path) -> None:
    robot = yaml.safe_load((CONFIG_DIR / "hil-agilex.yaml").read_text())
    robot["chassis"]["link"]["port"] = 20_000 + os.getpid() % 40_000  # where nobody answers
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump(robot))
    with closing(tmp_path, ["--config", str(tmp_path / "robot.yaml")]) as (process, perception):
        out, err = result_of(process, signal.SIGTERM, perception)
    assert process.returncode == 2, out + err
    assert "nothing has moved" in err
