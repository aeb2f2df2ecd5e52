"""Measures the command period in real time, while perception works without a pause in the other process.

It measures the program itself: `treadwatch run`, with the base emulated in a third process. The only change
is a camera that is faster than perception, so that the perception process never waits.
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
from controller.errors import UserError
from controller.mission.options import MissionOptions
from controller.mission.realtime_drive import drive_realtime
from controller.realtime.service import handlers_kept
from controller.terminal.console import Console
from controller.terminal.outlet import say_result
from hal.api import Clock
from hal.clocks import NS_PER_MS, NS_PER_S, MonotonicClock

PERIOD_NS = 20 * NS_PER_MS
_SETTLE_S = 2.0  # the first commands are not counted, until the processes have settled
_START_ALLOWANCE_S = 8.0  # allowance for the start, on top of the measurement
_SATURATION_FPS = 300.0  # fast enough that perception never waits for a frame
_SPEED_MPS = 0.25  # slow enough that the path is long enough for the measurement
_CONFIG = CONFIG_DIR / "hil-agilex.yaml"
_STAT = FilePath("/proc/stat")


@dataclass(frozen=True, slots=True)
class PeriodFigures:
    """Statistics of the time between consecutive commands.

    commands: their number.
    median_ms: of the period.
    p99_off_ms, worst_off_ms: 99th percentile and maximum of the difference from 20 ms.
    within_1_ms: share of the periods that differ by at most 1 ms.
    """

    commands: int
    median_ms: float
    p99_off_ms: float
    worst_off_ms: float
    within_1_ms: float

    @classmethod
    def of(cls, commanded_ns: Sequence[int]) -> Self:
        """Statistics from the times at which the commands were sent. Raises ValueError for fewer than two."""
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
    say_result(
        f"command period, 20 ms wanted, {seconds:g} s each; perception without a pause in another process\n"
        f"{'scheduling':26}{'commands':>9}{'median':>11}{'p99 off':>11}{'worst off':>11}{'within 1 ms':>13}"
        f"{'load':>6}{'stolen':>9}"
    )
    clock = MonotonicClock()
    for name, priority in (("ordinary", 0), ("SCHED_FIFO", 50)):
        _print_row(name, partial(measure_period, priority, seconds))
    # This process keeps the real-time scheduling of the second drive.
    _print_row("SCHED_FIFO, empty loop", partial(measure_empty_loop, clock, seconds))
    say_result(
        "off: deviation of a period from 20 ms. empty loop: only waits for the next 20 ms, so it shows what\n"
        "is due to the machine. load: average of the last minute. stolen: processor time that the host of\n"
        "a virtual machine gave to others in the meantime, all cores together."
    )


def _print_row(name: str, measure: Callable[[], PeriodFigures]) -> None:
    before_s = stolen_s(_STAT)
    figures = measure()
    say_result(
        f"{name:26}{figures.commands:9d}{figures.median_ms:8.3f} ms{figures.p99_off_ms:8.3f} ms"
        f"{figures.worst_off_ms:8.3f} ms{figures.within_1_ms:13.2%}{os.getloadavg()[0]:6.1f}"
        f"{stolen_s(_STAT) - before_s:7.2f} s"
    )


def stolen_s(stat: FilePath) -> float:
    """Processor time that the host gave to others since the start (/proc/stat); NaN if it is not counted."""
    try:
        fields = stat.read_text(encoding="ascii").split("\n", 1)[0].split()
        return int(fields[8]) / os.sysconf("SC_CLK_TCK")
    except (OSError, IndexError, ValueError):
        return math.nan


def measure_empty_loop(clock: Clock, seconds: float) -> PeriodFigures:
    """The period of a loop that only waits, which shows the machine's own jitter."""
    deadline_ns = clock.now_ns()
    woken_ns = []
    for _ in range(round(seconds * NS_PER_S / PERIOD_NS)):
        deadline_ns += PERIOD_NS
        clock.sleep_until_ns(deadline_ns)
        woken_ns.append(clock.now_ns())
    return PeriodFigures.of(woken_ns)


def measure_period(priority: int, seconds: float) -> PeriodFigures:
    """Measure one drive of this length. priority: of SCHED_FIFO; 0: ordinary scheduling. Raises UserError."""
    config, runner = _saturated_config(load_app(_CONFIG), priority, seconds + _SETTLE_S + _START_ALLOWANCE_S)
    link = config.chassis.link
    assert isinstance(link, CanLinkConfig), "the bench drives over CAN"
    with _emulator(link), handlers_kept():
        result = drive_realtime(config, runner, MissionOptions(_CONFIG, quiet=True), Console(quiet=True))
    assert result.punctuality is not None, "a real-time drive has one"
    commanded_ns = result.punctuality.commanded_ns
    start_ns = commanded_ns[0] + round(_SETTLE_S * NS_PER_S) if commanded_ns else 0
    counted_ns = [stamp_ns for stamp_ns in commanded_ns if 0 <= stamp_ns - start_ns <= seconds * NS_PER_S]
    if len(counted_ns) < 0.5 * seconds * NS_PER_S / PERIOD_NS:
        raise UserError(
            f"only {len(counted_ns)} commands in {seconds:g} s: {result.loop.lifecycle.stop_reason}"
        )
    return PeriodFigures.of(counted_ns)


def _saturated_config(config: AppConfig, priority: int, seconds: float) -> tuple[AppConfig, RealtimeRunner]:
    """The configuration with a bus of its own, a low speed, and a camera that never lets perception wait."""
    assert isinstance(config.runner, RealtimeRunner)
    assert isinstance(config.camera, SimulatedCameraConfig)
    runner = config.runner.model_copy(update={"priority": priority, "max_duration_s": seconds})
    limits = config.robot.limits.model_copy(update={"max_speed_mps": _SPEED_MPS})
    link = config.chassis.link.model_copy(update={"port": 20_000 + os.getpid() % 40_000})
    changes = {
        "runner": runner,
        "camera": config.camera.model_copy(update={"fps": _SATURATION_FPS}),
        "robot": config.robot.model_copy(update={"limits": limits}),
        "chassis": config.chassis.model_copy(update={"link": link}),
    }
    return config.model_copy(update=changes), runner


@contextmanager
def _emulator(link: CanLinkConfig) -> Iterator[None]:
    """Run `treadwatch emulate agilex` as its own process. Raises UserError if it does not start."""
    command = [sys.executable, "-m", "controller", "emulate", "agilex", "--port", str(link.port)]
    pipe, devnull = subprocess.PIPE, subprocess.DEVNULL
    with subprocess.Popen(command, stdin=devnull, stdout=devnull, stderr=pipe, text=True) as process:
        try:
            assert process.stderr is not None
            ready = process.stderr.readline()
            if not ready.startswith("emulating"):
                raise UserError(f"the emulator did not start: {ready.strip()}")
            yield
        finally:
            process.terminate()
