"""The command `treadwatch` as a user's shell runs it, and how it refuses a user's mistake."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path


def treadwatch(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """What the command answers to these arguments."""
    command = [sys.executable, "-m", "controller", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


def refusal(*arguments: str | Path) -> str:
    """The one line on standard error; exit code 2 and no traceback."""
    done = treadwatch(*arguments)
    assert done.returncode == 2, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    lines = done.stderr.strip().splitlines()
    assert len(lines) == 1, done.stderr
    return lines[0]
