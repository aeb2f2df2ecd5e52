"""The command period: its figures, the floor under it, and the command itself."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from config.app import RealtimeRunner, load_app
from config.loader import CONFIG_DIR
from controller.bench.period import PeriodFigures, _saturated_config, measure_empty_loop, stolen_s
from hal.clocks import SimulatedClock

MS = 1_000_000


def test_one_late_command_shows_in_the_worst_period_and_not_in_the_median() -> None:
    stamps_ns, now_ns = [], 0
    for k in range(200):
        stamps_ns.append(now_ns)
        now_ns += (25 if k == 50 else 15 if k == 51 else 20) * MS
    figures = PeriodFigures.of(stamps_ns)
    assert figures.commands == 200
    assert figures.median_ms == pytest.approx(20.0)
    assert figures.worst_off_ms == pytest.approx(5.0)
    assert figures.within_1_ms == pytest.approx(197 / 199)
    assert figures.p99_off_ms == pytest.approx(0.1), "2 of 199: just above the 99th"


def test_one_command_has_no_period() -> None:
    with pytest.raises(ValueError, match="no period"):
        PeriodFigures.of([5])


class JitteryClock(SimulatedClock):
    """Wakes up 0.5 ms late every other time."""

    def __init__(self) -> None:
        super().__init__()
        self._calls = 0

    def sleep_until_ns(self, deadline_ns: int) -> None:
        self._calls += 1
        super().sleep_until_ns(deadline_ns + (self._calls % 2) * MS // 2)


def test_the_floor_is_the_clock_s_own() -> None:
    assert measure_empty_loop(SimulatedClock(), 10.0) == PeriodFigures(500, 20.0, 0.0, 0.0, 1.0)
    assert measure_empty_loop(JitteryClock(), 10.0).worst_off_ms == pytest.approx(0.5)


def test_stolen_time_is_that_of_all_cpus_and_unknown_without_the_file(tmp_path: Path) -> None:
    stat = tmp_path / "stat"
    stat.write_text("cpu  1 2 3 4 5 6 7 800 0 0\ncpu0 1\n")
    assert stolen_s(stat) == pytest.approx(8.0)
    assert stolen_s(tmp_path / "no") != stolen_s(tmp_path / "no"), "not known is NaN"


def test_perception_never_waits_and_the_path_lasts() -> None:
    config, runner = _saturated_config(load_app(CONFIG_DIR / "hil-agilex.yaml"), 50, 40.0)
    assert isinstance(config.runner, RealtimeRunner)
    assert (runner.priority, runner.max_duration_s, config.camera.kind) == (50, 40.0, "simulated")
    assert config.robot.limits.max_speed_mps * 40.0 < 20.0, "the path of the warehouse is longer"


def test_the_command_measures_both_kinds_of_scheduling(request: pytest.FixtureRequest) -> None:
    if not request.config.getoption("--hil"):
        pytest.skip("half a minute; with --hil")
    command = [sys.executable, "-m", "controller", "bench", "--period", "--seconds", "5"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    rows = done.stdout.splitlines()
    assert [row.split("  ")[0] for row in rows[2:5]] == ["ordinary", "SCHED_FIFO", "SCHED_FIFO, empty loop"]
