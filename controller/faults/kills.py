"""Faults of whole processes, in real time: emulator, control or perception is killed or frozen."""

from __future__ import annotations

import os
import queue
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from controller.errors import UserError
from sim.plant import PLANT_REST_MPS

_DRIVING_MPS = 0.3  # the fault comes when the base is faster than this
_START_S = 40.0  # longest time until it drives
_STOP_S = 15.0  # longest time until it stands, and until the drive ends

_STATE_LINE = re.compile(r"v (-?[\d.]+) m/s, w (-?[\d.]+) rad/s, x (-?[\d.]+) m, y (-?[\d.]+) m")
_ENDED = re.compile(r"^mission +[^:]*: (.*); [\d.]+ m in", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class KillResult:
    """The result of one fault.

    stood_after_s: time until the emulated base stood still; None if the base was killed.
    ended: how the mission says that it ended; None if its process was killed.
    exit_code: of the mission; None if its process was killed.
    """

    fault: str
    stood_after_s: float | None
    ended: str | None
    exit_code: int | None


class DriveProcesses:
    """The processes of emulator and drive; perception is a child of the drive."""

    def __init__(self, kind: str, config_path: Path) -> None:
        python = [sys.executable, "-m", "controller"]
        emulate = [*python, "emulate", kind, "--config", str(config_path), "--tell"]
        drive = [*python, "run", "--config", str(config_path), "--quiet"]
        pipe = subprocess.PIPE
        self.base = subprocess.Popen(emulate, stdin=pipe, stdout=pipe, stderr=pipe, text=True, bufsize=1)
        try:
            assert self.base.stderr is not None
            ready = self.base.stderr.readline()
            if not ready.startswith("emulating"):
                raise UserError(f"the emulator did not start: {ready.strip()}")
            self.drive = subprocess.Popen(drive, stdout=pipe, stderr=pipe, text=True)
        except BaseException:
            _end(self.base)
            raise
        self._lines: queue.Queue[str | None] = queue.Queue()
        threading.Thread(target=self._read_lines, name="emulator", daemon=True).start()

    def _read_lines(self) -> None:
        """The lines of the base; None when there will be no more."""
        assert self.base.stdout is not None
        for line in self.base.stdout:
            self._lines.put(line)
        self._lines.put(None)

    def close(self) -> None:
        """Kill the processes that still run."""
        for process in (self.drive, self.base):
            _end(process)

    @property
    def perception(self) -> int:
        """Process id of perception. Raises UserError if there is no such process."""
        children = Path(f"/proc/{self.drive.pid}/task/{self.drive.pid}/children").read_text().split()
        for child in children:
            if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes():
                return int(child)
        raise UserError("the drive has no perception process")

    def wait_for_drive(self, timeout_s: float) -> None:
        """Wait until the drive has ended by itself, at most this long."""
        with suppress(subprocess.TimeoutExpired):
            self.drive.wait(timeout_s)

    def wait_for_speed(self, condition: Callable[[float], bool], timeout_s: float) -> float:
        """Read the base's output until condition holds for its speed; gives the time that this took.

        Raises UserError if it takes longer than timeout_s.
        """
        start_s = time.monotonic()
        with suppress(queue.Empty):  # it may tell nothing at all
            while (remaining_s := start_s + timeout_s - time.monotonic()) > 0.0:
                line = self._lines.get(timeout=remaining_s)
                if line is None:
                    break
                match = _STATE_LINE.match(line)
                if match is not None and condition(abs(float(match[1]))):
                    return time.monotonic() - start_s
        raise UserError(f"the emulated base was not so within {timeout_s:g} s")


def _end(process: subprocess.Popen[str]) -> None:
    process.kill()
    process.wait()
    for pipe in (process.stdin, process.stdout, process.stderr):
        # The reader of the emulator's lines may hold its pipe for a moment longer.
        if pipe is not None:
            with suppress(OSError, ValueError):
                pipe.close()


@contextmanager
def _processes(kind: str, config_path: Path) -> Iterator[DriveProcesses]:
    processes = DriveProcesses(kind, config_path)
    try:
        yield processes
    finally:
        processes.close()


def _kill_control(processes: DriveProcesses) -> None:
    processes.drive.kill()


def _kill_perception(processes: DriveProcesses) -> None:
    os.kill(processes.perception, signal.SIGKILL)


def _freeze_perception(processes: DriveProcesses) -> None:
    os.kill(processes.perception, signal.SIGSTOP)


def _kill_base(processes: DriveProcesses) -> None:
    processes.base.kill()


def _freeze_base(processes: DriveProcesses) -> None:
    processes.base.send_signal(signal.SIGSTOP)
    processes.wait_for_drive(_STOP_S)
    processes.base.send_signal(signal.SIGCONT)


def _press_estop(processes: DriveProcesses) -> None:
    assert processes.base.stdin is not None
    processes.base.stdin.write("estop\n")


def _terminate_control(processes: DriveProcesses) -> None:
    processes.drive.terminate()


KILLS: dict[str, Callable[[DriveProcesses], None]] = {
    "SIGTERM to control": _terminate_control,
    "kill -9 of control": _kill_control,
    "kill -9 of perception": _kill_perception,
    "perception frozen (SIGSTOP)": _freeze_perception,
    "kill -9 of the emulator (base gone)": _kill_base,
    "emulator frozen (SIGSTOP) until the drive has ended": _freeze_base,
    "e-stop": _press_estop,
}


def run_kill(kind: str, config_path: Path, fault: str) -> KillResult:
    """Drive until the base is faster than 0.3 m/s, inject the fault, and measure.

    Raises UserError if the base does not drive or does not stop.
    """
    with _processes(kind, config_path) as processes:
        processes.wait_for_speed(lambda v_mps: v_mps > _DRIVING_MPS, _START_S)
        start_s = time.monotonic()
        inject = KILLS[fault]
        frozen = processes.perception if inject is _freeze_perception else None
        inject(processes)
        stood_s = None
        if processes.base.poll() is None and inject is not _kill_base:
            processes.wait_for_speed(lambda v_mps: v_mps < PLANT_REST_MPS, _STOP_S)
            stood_s = time.monotonic() - start_s
        if inject is _kill_control:
            return KillResult(fault, stood_s, None, None)
        if frozen is not None:
            # A mission with stale scenes stops and waits for new ones. That is measured, so end it.
            processes.drive.terminate()
            # Perception is still frozen. The drive must end all the same, and kill perception.
            processes.wait_for_drive(_STOP_S)
            with suppress(ProcessLookupError):
                os.kill(frozen, signal.SIGKILL)
        out, _ = processes.drive.communicate(timeout=_STOP_S)
        ended = _ENDED.search(out)
        return KillResult(fault, stood_s, ended[1] if ended else out.strip(), processes.drive.returncode)
