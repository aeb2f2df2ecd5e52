from __future__ import annotations

import time
from pathlib import Path

import pytest

import vision
from config.perception import PerceptionConfig
from controller.bench.figures import Stopwatches
from controller.bench.opencv_calls import recorded_calls
from controller.bench.own_search import recorded_searches
from controller.bench.perception import (
    FrameTime,
    PairedTimes,
    measure_perception,
    run_alone,
    run_side_by_side,
    time_functions,
)
from controller.bench.reel import Reel, recorded_reel
from controller.bench.stages import modules_of
from hal.cameras.tum_replay import TumReplay
from tests.support.bench_clocks import Ticks, every
from vision.perception import Perception

DESK = Path(__file__).parents[3] / "recordings" / "desk_rpy"
MODULES = modules_of(vision)
SETTINGS = PerceptionConfig().fragments


@pytest.fixture(scope="module")
def reel() -> Reel:
    whole = recorded_reel(TumReplay(DESK))
    return Reel(whole.frames[:3], whole.odometry[:3], whole.mount)


def make() -> Perception:
    return Perception(PerceptionConfig(), None, 0.8, 0.05)


def test_functions_that_a_frame_does_not_call_take_no_time_in_it() -> None:
    side = PairedTimes()
    side.add(FrameTime(5, 1, 10), {"Canny": 2}, 20)
    side.add(FrameTime(6, 2, 11), {"Canny": 3, "LUT": 4}, 21)
    side.add(FrameTime(7, 3, 12), {"LUT": 1}, 22)
    assert side.total_ns == [6, 8, 10]
    assert side.elapsed_ns == [10, 11, 12]
    assert side.bare_ns == [2, 7, 1]
    assert side.whole_ns == [20, 21, 22]
    assert dict(side.opencv_ns) == {"Canny": [2, 3, 0], "LUT": [0, 4, 1]}


def test_side_by_side_times_perception_and_its_calls(reel: Reel) -> None:
    expected: list[int] = []
    perception = make()
    for frame in reel.frames:
        with recorded_calls(MODULES) as calls, recorded_searches(calls):
            perception.perceive(frame, None, None)
        expected.append(1000 * len(calls))
    assert expected[1] > 0
    side, ticks = PairedTimes(), Ticks()
    stopwatches = Stopwatches(every(1000), every(7))
    run_side_by_side(reel, make, SETTINGS, MODULES, stopwatches, side, ticks)
    assert side.detect_ns == side.track_ns == [1000, 1000]
    assert side.elapsed_ns == [7, 7]
    assert side.bare_ns == expected[1:]
    assert side.whole_ns == [1000, 1000]
    assert side.first_ns == [2000]
    assert ticks.count == 3


def test_alone_times_perception_only(reel: Reel) -> None:
    side, ticks = PairedTimes(), Ticks()
    run_alone(reel, make, Stopwatches(every(1000), every(7)), side, ticks)
    assert side.alone_ns == [2000, 2000]
    assert side.total_ns == []
    assert ticks.count == 3


def test_a_watched_pass_sees_the_stages(reel: Reel) -> None:
    frames = time_functions(reel, make, MODULES, time.perf_counter_ns, Ticks())
    assert len(frames) == 2
    for spent in frames:
        assert spent["vision.perception.Perception.perceive"].calls == 1
        assert spent["vision.fragments.edges.find_edges"].opencv_ns > 0


def test_the_figures_of_a_reel_are_whole(reel: Reel) -> None:
    ticks = Ticks()
    stopwatches = Stopwatches(time.process_time_ns, time.perf_counter_ns)
    figures = measure_perception(reel, make, SETTINGS, 2, stopwatches, ticks)
    assert ticks.count == 3 * 2 * 3
    assert figures.alone.count == figures.total.count == figures.bare.count == 4
    assert figures.first.count == 2
    assert figures.ratio_of_medians == pytest.approx(figures.total.median_ms / figures.bare.median_ms)
    assert figures.ratio_to_whole == pytest.approx(figures.total.median_ms / figures.whole.median_ms)
    assert {"vision.fragments.edges", "vision.tracker"} <= set(figures.modules)
    assert "vision.fragments.edges.find_edges" in figures.functions
    assert set(figures.as_json()) == {
        "alone", "total", "elapsed", "detect", "track", "bare_opencv", "whole_images", "first_frame",
        "ratio_of_medians", "median_ratio", "ratio_to_whole_images", "opencv_functions", "modules",
        "functions",
    }  # fmt: skip
