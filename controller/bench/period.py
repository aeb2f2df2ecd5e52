"""The command period in real time, while perception works without a pause in the other process.

What is measured is the program itself: `treadwatch run` with the base emulated in a third process. Only the
camera is made faster than perception can look, so that its process never waits.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path as FilePath
from typing import Self

import numpy as np

from config.app import AppConfig, RealtimeRunner, load_app
from config.camera import SimulatedCameraConfig
from config.chassis import CanLinkConfig
from config.loader import CONFIG_DIR
from controller.console import Console
from controller.errors import UserError
from controller.outlet import say
from controller.realtime.mission import drive_realtime
from controller.result import MissionOptions
from hal.api import Clock
from hal.clocks import NS_PER_MS, NS_PER_S, MonotonicClock

PERIOD_NS = 20_000_000
# Not in this list: the first commands, before the processes have settled.
_SETTLE_S = 2.0
_BEFORE_DRIVING_S = 8.0
# No camera is so fast that perception would have to wait for it.
_FLOOD_FPS = 300.0
# Slow, so that the path lasts as long as the measurement.
_SPEED_MPS = 0.25
_CONFIG = CONFIG_DIR / "hil-agilex.yaml"
_STAT = FilePath("/proc/stat")


@dataclass(frozen=True, slots=True)
class PeriodFigures:
    """Milliseconds between two commands in a row, and how far from 20 ms. p99, worst: of the distance."""

    commands: int
    median_ms: float
    p99_off_ms: float
    worst_off_ms: float
    within_1_ms: float

    @classmethod
    def of(cls, commanded_ns: Sequence[int]) -> Self:
        """From when each command had gone out. Raises ValueError for fewer than two."""
        if len(commanded_ns) < 2:
            raise ValueError("fewer than two commands went out: there is no period")
        periods_ns = np.diff(np.asarray(commanded_ns, dtype=np.int64))
        off_ms = np.abs(periods_ns - PERIOD_NS) / NS_PER_MS
        return cls(
            commands=len(commanded_ns),
            median_ms=float(np.median(periods_ns)) / NS_PER_MS,
            p99_off_ms=float(np.percentile(off_ms, 99)),
            worst_off_ms=float(off_ms.max()),
            within_1_ms=float(np.mean(off_ms <= 1.0)),
        )


def run_period_bench(seconds: float) -> None:
    """Measure with ordinary scheduling, then with SCHED_FIFO; print a table. Raises UserError, HalError."""
    say(
        f"command period, 20 ms wanted, {seconds:g} s each; perception without a pause in another process\n"
        f"{'scheduling':26}{'commands':>9}{'median':>11}{'p99 off':>11}{'worst off':>11}{'within 1 ms':>13}"
        f"{'load':>6}{'stolen':>9}"
    )
    clock = MonotonicClock()
    for name, priority in (("ordinary", 0), ("SCHED_FIFO", 50)):
        _print_row(name, partial(measure_period, priority, seconds))
    # This process has become what the second drive made of it.
    _print_row("SCHED_FIFO, empty loop", partial(measure_floor, clock, seconds))
    say(
        "off: distance of one period from 20 ms. empty loop: nothing but waiting for the next 20 ms, so it\n"
        "shows what is the machine's. load: average of the minute. stolen: processor time that the host of\n"
        "a virtual machine gave to others meanwhile, of all cores."
    )


def _print_row(name: str, measure: Callable[[], PeriodFigures]) -> None:
    before_s = stolen_s(_STAT)
    figures = measure()
    say(
        f"{name:26}{figures.commands:9d}{figures.median_ms:8.3f} ms{figures.p99_off_ms:8.3f} ms"
        f"{figures.worst_off_ms:8.3f} ms{figures.within_1_ms:13.2%}{os.getloadavg()[0]:6.1f}"
        f"{stolen_s(_STAT) - before_s:7.2f} s"
    )


def stolen_s(stat: FilePath) -> float:
    """Processor time given to others by the host since the start (/proc/stat); NaN where nobody counts it."""
    try:
        fields = stat.read_text(encoding="ascii").split("\n", 1)[0].split()
        return int(fields[8]) / os.sysconf("SC_CLK_TCK")
    except (OSError, IndexError, ValueError):
        return math.nan


def measure_floor(clock: Clock, seconds: float) -> PeriodFigures:
    """What the machine itself does to a loop that only waits."""
    deadline_ns = clock.now_ns()
    woken_ns = []
    for _ in range(round(seconds * NS_PER_S / PERIOD_NS)):
        deadline_ns += PERIOD_NS
        clock.sleep_until_ns(deadline_ns)
        woken_ns.append(clock.now_ns())
    return PeriodFigures.of(woken_ns)


def measure_period(priority: int, seconds: float) -> PeriodFigures:
    """One drive of this length. priority: of SCHED_FIFO; 0 for ordinary scheduling. Raises UserError."""
    config, runner = _flooded(load_app(_CONFIG), priority, seconds + _SETTLE_S + _BEFORE_DRIVING_S)
    link = config.chassis.link
    assert isinstance(link, CanLinkConfig), "the bench drives over CAN"
    with _emulator(link):
        result = drive_realtime(config, runner, MissionOptions(_CONFIG, quiet=True), Console(quiet=True))
    assert result.punctuality is not None, "a real-time drive has one"
    commanded_ns = result.punctuality.commanded_ns
    began_ns = commanded_ns[0] + round(_SETTLE_S * NS_PER_S) if commanded_ns else 0
    kept = [stamp_ns for stamp_ns in commanded_ns if 0 <= stamp_ns - began_ns <= seconds * NS_PER_S]
    if len(kept) < 0.5 * seconds * NS_PER_S / PERIOD_NS:
        raise UserError(f"only {len(kept)} commands in {seconds:g} s: {result.loop.ending.stop_reason}")
    return PeriodFigures.of(kept)


def _flooded(config: AppConfig, priority: int, seconds: float) -> tuple[AppConfig, RealtimeRunner]:
    """The program as it ships, on a bus of its own, slow, with a camera that never lets perception wait."""
    assert isinstance(config.runner, RealtimeRunner)
    assert isinstance(config.camera, SimulatedCameraConfig)
    runner = config.runner.model_copy(update={"priority": priority, "max_duration_s": seconds})
    limits = config.robot.limits.model_copy(update={"max_speed_mps": _SPEED_MPS})
    link = config.chassis.link.model_copy(update={"port": 20_000 + os.getpid() % 40_000})
    changes = {
        "runner": runner,
        "camera": config.camera.model_copy(update={"fps": _FLOOD_FPS}),
        "robot": config.robot.model_copy(update={"limits": limits}),
        "chassis": config.chassis.model_copy(update={"link": link}),
    }
    return config.model_copy(update=changes), runner


@contextmanager
def _emulator(link: CanLinkConfig) -> Iterator[None]:
    """`treadwatch emulate agilex` as its own process. Raises UserError when it does not start."""
    command = [sys.executable, "-m", "controller", "emulate", "agilex", "--port", str(link.port)]
    pipe, nothing = subprocess.PIPE, subprocess.DEVNULL
    with subprocess.Popen(command, stdin=nothing, stdout=nothing, stderr=pipe, text=True) as process:
        try:
            assert process.stderr is not None
            ready = process.stderr.readline()
            if not ready.startswith("emulating"):
                raise UserError(f"the emulator did not start: {ready.strip()}")
            yield
        finally:
            process.terminate()
