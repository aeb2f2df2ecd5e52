"""`treadwatch govern` as its own process, in real time, driven by the client of docs/governor.md."""

from __future__ import annotations

import re
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from config.loader import CONFIG_DIR

CLIENT = re.findall(
    r"```python\n(.*?)```", (CONFIG_DIR.parent / "docs" / "governor.md").read_text(), re.DOTALL
)[0]


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.mark.parametrize("kind", ["udp", "unix"])
def test_the_client_of_the_documentation_drives_and_its_silence_stops(kind: str, tmp_path: Path) -> None:
    config = yaml.safe_load((CONFIG_DIR / "governor.yaml").read_text())
    port, path = free_port(), str(tmp_path / "governor.sock")
    config["governor"]["input"] = (
        {"kind": "udp", "port": port} if kind == "udp" else {"kind": "unix", "path": path}
    )
    config["camera"] |= {"fps": 15.0}
    config["simulation"]["scenario"] = "empty"
    config["chassis"]["link"]["channel"] = f"treadwatch-governor-{kind}"
    (tmp_path / "governor.yaml").write_text(yaml.safe_dump(config))
    (tmp_path / "client.py").write_text(CLIENT)
    where = f"127.0.0.1:{port}" if kind == "udp" else path
    command = [
        sys.executable,
        "-u",
        "-m",
        "controller",
        "govern",
        "--config",
        str(tmp_path / "governor.yaml"),
    ]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        ready = next(line for line in process.stdout if line.startswith("ready"))
        assert ready == f"ready: commands are heard on {'udp ' if kind == 'udp' else ''}{where}\n"
        client = subprocess.run(
            [sys.executable, str(tmp_path / "client.py"), where, "6.0"],
            capture_output=True, text=True, timeout=30, check=True,
        )  # fmt: skip
        silence = next(line for line in process.stdout if "no command for" in line)
        process.send_signal(signal.SIGTERM)
        out, err = process.communicate(timeout=60)
    assert "as asked: 0.50 m/s, 0.02 rad/s" in client.stdout, client.stdout + client.stderr
    # It was driving when the client ended.
    assert "decrease" in silence
    summary = {line.split(None, 1)[0]: line.split(None, 1)[1] for line in out.splitlines() if " " in line}
    assert process.returncode == 0, out + err
    assert "stopped on request (SIGTERM received)" in summary["governor"]
    assert re.match(r"\d\d+ accepted$", summary["commands"]), summary["commands"]
    assert summary["limits"].startswith("kept in")
    assert ", 0 reversals" in summary["limits"]
    assert summary["contacts"].startswith("0;")
    assert "Traceback" not in err
    assert not Path(path).exists()
