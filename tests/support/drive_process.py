"""What a test asks of a drive in real time that runs as a process of its own."""

from __future__ import annotations

import socket
import subprocess
from pathlib import Path


def perception_of(process: subprocess.Popen[str]) -> int:
    """The child that runs the camera; the other child only tracks resources."""
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    found = [int(pid) for pid in children if "spawn_main" in Path(f"/proc/{pid}/cmdline").read_text()]
    assert len(found) == 1
    return found[0]


def next_notice(receiver: socket.socket, wanted: bytes) -> bytes:
    """The first notice that begins with wanted; others are passed over. Times out with the socket."""
    while True:
        notice = receiver.recv(500)
        if notice.startswith(wanted):
            return notice
