from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import vision
from config.perception import PerceptionConfig
from controller.bench.opencv_calls import recorded_calls
from controller.bench.perception import SideBySide, measure_perception, run_side_by_side, run_watched
from controller.bench.reel import Reel, recorded_reel
from controller.bench.stages import modules_of
from hal.cameras.tum_replay import TumReplay
from vision.perception import Perception

DESK = Path(__file__).parents[2] / "recordings" / "desk_rpy"
MODULES = modules_of(vision)


@pytest.fixture(scope="module")
def reel() -> Reel:
    whole = recorded_reel(TumReplay(DESK), None)
    return Reel(whole.frames[:3], whole.odometry[:3], whole.mount)


def make() -> Perception:
    return Perception(PerceptionConfig(), None, 0.8, 0.05)


class Ticks:
    def __init__(self) -> None:
        self.count = 0

    def __call__(self) -> None:
        self.count += 1


def steady_clock() -> Iterator[int]:
    """Readings 1 us apart, so that every interval between two readings is 1 us."""
    now_ns = 0
    while True:
        yield now_ns
        now_ns += 1000


def test_functions_that_a_frame_does_not_call_take_no_time_in_it() -> None:
    side = SideBySide()
    side.add(5, 1, {"Canny": 2})
    side.add(6, 2, {"Canny": 3, "LUT": 4})
    side.add(7, 3, {"LUT": 1})
    assert side.total_ns == [6, 8, 10]
    assert side.bare_ns == [2, 7, 1]
    assert dict(side.opencv_ns) == {"Canny": [2, 3, 0], "LUT": [0, 4, 1]}


def test_side_by_side_times_perception_and_its_calls(reel: Reel) -> None:
    expected: list[int] = []
    perception = make()
    for frame in reel.frames:
        with recorded_calls(MODULES) as calls:
            perception.perceive(frame, None, None)
        expected.append(1000 * len(calls))
    assert expected[1] > 0
    side, ticks = SideBySide(), Ticks()
    run_side_by_side(reel, make, MODULES, steady_clock().__next__, side, ticks)
    assert side.detect_ns == side.track_ns == [1000, 1000]
    assert side.bare_ns == expected[1:]
    assert side.first_ns == [2000]
    assert ticks.count == 3


def test_a_watched_pass_sees_the_stages(reel: Reel) -> None:
    frames = run_watched(reel, make, MODULES, time.perf_counter_ns, Ticks())
    assert len(frames) == 2
    for spent in frames:
        assert spent["vision.perception.Perception.perceive"].calls == 1
        assert spent["vision.edges.find_edges"].opencv_ns > 0


def test_figures_of_a_reel(reel: Reel) -> None:
    ticks = Ticks()
    figures = measure_perception(reel, make, 2, time.perf_counter_ns, ticks)
    assert ticks.count == 2 * 2 * 3
    assert figures.total.count == figures.bare.count == 4
    assert figures.first.count == 2
    assert figures.ratio_of_medians == pytest.approx(figures.total.median_ms / figures.bare.median_ms)
    assert {"vision.edges", "vision.tracker"} <= set(figures.modules)
    assert "vision.edges.find_edges" in figures.functions
    assert set(figures.as_json()) == {
        "total", "detect", "track", "bare_opencv", "first_frame", "ratio_of_medians", "median_ratio",
        "opencv_functions", "modules", "functions",
    }  # fmt: skip
