"""Measures perception alone, beside its bare OpenCV calls on the same images, and function by function.

Alone is how it runs on a robot. Beside the calls that it is compared with it takes longer, because they leave
other data in the caches of the processor: both sides of a ratio are measured in the same way.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from types import ModuleType

import vision
from config.perception import FragmentSettings
from controller.bench.figures import Durations, Stopwatches, median_ratio
from controller.bench.opencv_calls import recorded_calls, time_bare
from controller.bench.own_search import recorded_searches
from controller.bench.reel import Reel, Tick
from controller.bench.stages import (
    FunctionTime,
    StageFigures,
    StageTimer,
    modules_of,
    summarise,
    timed_functions,
)
from controller.bench.whole_images import WholeImages
from hal.types import Pose, RgbdFrame
from vision.perception import Perception

MakePerception = Callable[[], Perception]


@dataclass(frozen=True, slots=True)
class FrameTime:
    """Times of one frame: processor time of detect and of track, elapsed time of both together."""

    detect_ns: int
    track_ns: int
    elapsed_ns: int


@dataclass
class PairedTimes:
    """Times of each frame for perception and for OpenCV alone; the same index is the same frame.

    alone_ns: processor time of perception with nothing in between.
    detect_ns, track_ns: processor time of the two steps of perception.
    elapsed_ns: elapsed time of both together.
    bare_ns: processor time of the bare OpenCV calls, with OpenCV's Lucas-Kanade (own_search.py).
    whole_ns: processor time of the paper's calls, see WholeImages.
    opencv_ns: bare calls by function name.
    first_ns: the first frame of each pass, which is in none of the other lists.
    """

    alone_ns: list[int] = field(default_factory=list)
    detect_ns: list[int] = field(default_factory=list)
    track_ns: list[int] = field(default_factory=list)
    elapsed_ns: list[int] = field(default_factory=list)
    bare_ns: list[int] = field(default_factory=list)
    whole_ns: list[int] = field(default_factory=list)
    opencv_ns: defaultdict[str, list[int]] = field(default_factory=lambda: defaultdict(list))
    first_ns: list[int] = field(default_factory=list)

    @property
    def total_ns(self) -> list[int]:
        """detect and track together."""
        return [detect + track for detect, track in zip(self.detect_ns, self.track_ns, strict=True)]

    def add(self, spent: FrameTime, opencv_ns: dict[str, int], whole_ns: int) -> None:
        """Add one frame; a function that is not called in it counts as zero."""
        known = len(self.detect_ns)
        self.detect_ns.append(spent.detect_ns)
        self.track_ns.append(spent.track_ns)
        self.elapsed_ns.append(spent.elapsed_ns)
        self.bare_ns.append(sum(opencv_ns.values()))
        self.whole_ns.append(whole_ns)
        for name in opencv_ns.keys() | self.opencv_ns.keys():
            samples = self.opencv_ns[name]
            samples.extend([0] * (known - len(samples)))
            samples.append(opencv_ns.get(name, 0))


@dataclass(frozen=True, slots=True)
class PerceptionFigures:
    """Figures of one reel, per frame.

    alone: detect and track together, in processor time, with nothing in between.
    total: the same beside what it is compared with.
    elapsed: total in wall-clock time.
    bare: the same OpenCV calls alone, with OpenCV's Lucas-Kanade in place of perception's own.
    whole: the paper's calls on whole images.
    first: the first frame of each pass.
    ratio_of_medians: median of perception over median of bare OpenCV.
    median_ratio: median over the frames of perception over bare OpenCV.
    ratio_to_whole: median of perception over median of whole.
    opencv: bare calls by function name.
    modules, functions: time inside perception, by names as in the code.
    """

    alone: Durations
    total: Durations
    elapsed: Durations
    detect: Durations
    track: Durations
    bare: Durations
    whole: Durations
    first: Durations
    ratio_of_medians: float
    median_ratio: float
    ratio_to_whole: float
    opencv: dict[str, Durations]
    modules: dict[str, StageFigures]
    functions: dict[str, StageFigures]

    def as_json(self) -> dict[str, object]:
        """Plain values."""
        return {
            "alone": self.alone.as_json(),
            "total": self.total.as_json(),
            "elapsed": self.elapsed.as_json(),
            "detect": self.detect.as_json(),
            "track": self.track.as_json(),
            "bare_opencv": self.bare.as_json(),
            "whole_images": self.whole.as_json(),
            "first_frame": self.first.as_json(),
            "ratio_of_medians": round(self.ratio_of_medians, 4),
            "median_ratio": round(self.median_ratio, 4),
            "ratio_to_whole_images": round(self.ratio_to_whole, 4),
            "opencv_functions": {name: durations.as_json() for name, durations in self.opencv.items()},
            "modules": {name: stage.as_json() for name, stage in self.modules.items()},
            "functions": {name: stage.as_json() for name, stage in self.functions.items()},
        }


def measure_perception(
    reel: Reel,
    make: MakePerception,
    settings: FragmentSettings,
    passes: int,
    stopwatches: Stopwatches,
    tick: Tick,
) -> PerceptionFigures:
    """Measure alone, then side by side, then with a stopwatch on every function.

    make: makes a new perception, for each pass over reel.
    settings: of its fragments.
    tick: called three times a frame and pass.
    """
    modules = modules_of(vision)
    times = PairedTimes()
    for _ in range(passes):
        run_alone(reel, make, stopwatches, times, tick)
    for _ in range(passes):
        run_side_by_side(reel, make, settings, modules, stopwatches, times, tick)
    spent: list[dict[str, FunctionTime]] = []
    for _ in range(passes):
        spent.extend(time_functions(reel, make, modules, stopwatches.processor_ns, tick))
    total, bare = Durations.of(times.total_ns), Durations.of(times.bare_ns)
    whole = Durations.of(times.whole_ns)
    return PerceptionFigures(
        alone=Durations.of(times.alone_ns),
        total=total,
        elapsed=Durations.of(times.elapsed_ns),
        detect=Durations.of(times.detect_ns),
        track=Durations.of(times.track_ns),
        bare=bare,
        whole=whole,
        first=Durations.of(times.first_ns),
        ratio_of_medians=total.median_ms / bare.median_ms,
        median_ratio=median_ratio(times.total_ns, times.bare_ns),
        ratio_to_whole=total.median_ms / whole.median_ms,
        opencv=_slowest_first({name: Durations.of(ns) for name, ns in times.opencv_ns.items()}),
        modules=summarise(spent, group=_module_of),
        functions=summarise(spent),
    )


def run_alone(
    reel: Reel, make: MakePerception, stopwatches: Stopwatches, result: PairedTimes, tick: Tick
) -> None:
    """Process every frame with nothing in between; add alone_ns to result, without the first frame."""
    perception = make()
    for index, (frame, odometry) in enumerate(zip(reel.frames, reel.odometry, strict=True)):
        spent = _time(perception, frame, odometry, stopwatches)
        if index > 0:
            result.alone_ns.append(spent.detect_ns + spent.track_ns)
        tick()


def run_side_by_side(
    reel: Reel,
    make: MakePerception,
    settings: FragmentSettings,
    modules: Sequence[ModuleType],
    stopwatches: Stopwatches,
    result: PairedTimes,
    tick: Tick,
) -> None:
    """Process every frame four times, and add the times to result.

    By a perception that records its OpenCV calls, by these calls alone (with OpenCV's Lucas-Kanade in place
    of its own), by an unchanged perception, and by the paper's calls on the whole image. The bare calls and
    the unchanged perception take turns in going first, so that neither always finds warm caches. The first
    frame is kept apart, because perception then searches the whole image, as after every restart.
    """
    timed, recorded, whole = make(), make(), WholeImages(settings, stopwatches.processor_ns)
    for index, (frame, odometry) in enumerate(zip(reel.frames, reel.odometry, strict=True)):
        with recorded_calls(modules) as calls, recorded_searches(calls):
            recorded.perceive(frame, odometry, None)
        if index % 2 == 0:
            opencv_ns = time_bare(calls, stopwatches.processor_ns)
        spent = _time(timed, frame, odometry, stopwatches)
        if index % 2 == 1:
            opencv_ns = time_bare(calls, stopwatches.processor_ns)
        whole_ns = whole.step(frame.colour)
        if index == 0:
            result.first_ns.append(spent.detect_ns + spent.track_ns)
        else:
            result.add(spent, opencv_ns, whole_ns)
        tick()


def time_functions(
    reel: Reel,
    make: MakePerception,
    modules: Sequence[ModuleType],
    stopwatch_ns: Callable[[], int],
    tick: Tick,
) -> list[dict[str, FunctionTime]]:
    """Time of every function of modules, frame by frame, without the first frame."""
    timer = StageTimer(stopwatch_ns)
    spent: list[dict[str, FunctionTime]] = []
    with timed_functions(modules, timer):
        perception = make()
        for frame, odometry in zip(reel.frames, reel.odometry, strict=True):
            perception.perceive(frame, odometry, None)
            spent.append(timer.take())
            tick()
    return spent[1:]


def _time(
    perception: Perception, frame: RgbdFrame, odometry: Pose | None, stopwatches: Stopwatches
) -> FrameTime:
    began_ns = stopwatches.elapsed_ns()
    started_ns = stopwatches.processor_ns()
    detection = perception.detect(frame, odometry)
    detected_ns = stopwatches.processor_ns()
    perception.track(detection, None)
    tracked_ns = stopwatches.processor_ns()
    elapsed_ns = stopwatches.elapsed_ns() - began_ns
    return FrameTime(detected_ns - started_ns, tracked_ns - detected_ns, elapsed_ns)


def _module_of(function: str) -> str:
    """The module of a function's full name: a.b for a.b.Class.method."""
    name = function
    while name not in sys.modules:
        name = name.rpartition(".")[0]
    return name


def _slowest_first(figures: dict[str, Durations]) -> dict[str, Durations]:
    return dict(sorted(figures.items(), key=lambda item: -item[1].median_ms))
