"""All figures of one run: as JSON with stable keys, and as tables for the terminal."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from controller.bench.driving import ControlFigures
from controller.bench.figures import Durations
from controller.bench.mission_speed import LockstepFigures
from controller.bench.perception import PerceptionFigures
from controller.bench.rendering import RendererFigures
from controller.bench.stages import StageFigures

SCHEMA = 1  # version of the JSON layout
_NAME_WIDTH = 34  # width of the name column, in characters
# Rows of the stage table that are below this in every column appear in the JSON file only.
_MIN_SHOWN_MS = 0.02
_BUSY_SHARE = 0.9  # with less than this share of a core, the machine counts as busy


@dataclass(frozen=True, slots=True)
class BenchReport:
    """All figures of one run.

    taken_at: ISO 8601.
    cpu_share: processor time over elapsed time of the whole run; below 1, other programs took the rest.
    machine: what it ran on.
    perception: by reel.
    drivers: one exchange of each, by name of chassis and link.
    """

    taken_at: str
    cpu_share: float
    machine: Mapping[str, str | int]
    perception: Mapping[str, PerceptionFigures]
    renderer: RendererFigures
    control: ControlFigures
    drivers: Mapping[str, Durations]
    lockstep: LockstepFigures

    def as_json(self) -> dict[str, object]:
        """Plain values. Published keys keep their meaning; SCHEMA is raised if one has to change."""
        return {
            "schema": SCHEMA,
            "taken_at": self.taken_at,
            "cpu_share": round(self.cpu_share, 4),
            "machine": dict(self.machine),
            "perception": {name: figures.as_json() for name, figures in self.perception.items()},
            "renderer": self.renderer.as_json(),
            "control": self.control.as_json(),
            "drivers": {name: exchange.as_json() for name, exchange in self.drivers.items()},
            "lockstep": self.lockstep.as_json(),
        }

    def to_text(self) -> str:
        """The JSON text of the file."""
        return json.dumps(self.as_json(), indent=2, allow_nan=False) + "\n"

    def lines(self) -> Iterator[str]:
        """Lines for the terminal."""
        machine = self.machine
        yield (
            f"{machine['cpu']}, {machine['cores']} cores, Python {machine['python']}, "
            f"NumPy {machine['numpy']}, OpenCV {machine['opencv']} on one thread; {self.taken_at}"
        )
        if self.cpu_share < _BUSY_SHARE:
            yield (
                f"the machine is busy: this run got {self.cpu_share:.0%} of a core; what counts is "
                "processor time, which shared caches still lengthen"
            )
        yield ""
        yield from _perception_lines(self.perception)
        yield ""
        yield from _stage_lines(self.perception)
        yield ""
        yield from self._other_lines()

    def _other_lines(self) -> Iterator[str]:
        size = f"{self.renderer.width}x{self.renderer.height}"
        yield f"{'milliseconds of processor time':{_NAME_WIDTH}}  median     p99"
        yield _row(f"renderer, {size}, {self.renderer.faces:.0f} faces", self.renderer.picture)
        yield _row("renderer with the sensor's noise", self.renderer.exposure)
        yield _row(f"control step, {self.control.obstacles} obstacles", self.control.step)
        for name, exchange in self.drivers.items():
            yield _row(f"exchange, {name.replace('_', ' ')}", exchange)
        yield ""
        lockstep = self.lockstep
        yield (
            f"lock-step: {lockstep.simulated_s:.1f} s of the default mission in {lockstep.wall_s:.1f} s: "
            f"{lockstep.speed:.2f} x real time, {lockstep.speed_on_own_core:.2f} x on a core of its own"
        )


def _perception_lines(reels: Mapping[str, PerceptionFigures]) -> Iterator[str]:
    yield (
        f"{'perception, milliseconds a frame':{_NAME_WIDTH}}   alone     p99  beside     p99  detect   track"
        "  bare OpenCV   ratio  by frame  whole images   ratio   first  elapsed     p99"
    )
    for name, figures in reels.items():
        yield (
            f"{_row(name.replace('_', ' ', 1), figures.alone)}{figures.total.median_ms:8.2f}"
            f"{figures.total.p99_ms:8.2f}{figures.detect.median_ms:8.2f}"
            f"{figures.track.median_ms:8.2f}{figures.bare.median_ms:13.2f}{figures.ratio_of_medians:8.2f}"
            f"{figures.median_ratio:10.2f}{figures.whole.median_ms:14.2f}{figures.ratio_to_whole:8.2f}"
            f"{figures.first.median_ms:8.2f}{figures.elapsed.median_ms:9.2f}{figures.elapsed.p99_ms:8.2f}"
        )
    yield "alone: as on a robot; beside: by turns with what it is compared with, which fills the caches"
    yield "processor time, but for the last two columns; first: the first frame, a search of the whole image"
    yield "bare OpenCV: the calls that perception makes on the same frames, without anything around them,"
    yield "and OpenCV's Lucas-Kanade, in place of which perception has its own"
    yield "ratio: beside over bare OpenCV, of the medians; by frame: median of the ratios of all frames"
    yield "whole images: the paper's calls on them (Canny, contours, Hough, Lucas-Kanade); ratio: over that"


def _stage_lines(reels: Mapping[str, PerceptionFigures]) -> Iterator[str]:
    """Each stage's own time and that of its OpenCV calls, for each reel; then the OpenCV functions alone."""
    width = max(17, *(len(name) for name in reels))
    headings = "".join(f"  {name.replace('_', ' ', 1):>{width}}" for name in reels)
    yield f"{'stage, own + OpenCV':{_NAME_WIDTH}}{headings}"
    for module in _rows([figures.modules for figures in reels.values()]):
        cells = (figures.modules.get(module) for figures in reels.values())
        yield f"{module:{_NAME_WIDTH}}" + "".join(f"  {_stage_cell(cell):>{width}}" for cell in cells)
    yield f"{'bare OpenCV':{_NAME_WIDTH}}{headings}"
    functions = dict.fromkeys(name for figures in reels.values() for name in figures.opencv)
    for function in functions:
        times = (figures.opencv.get(function) for figures in reels.values())
        cells_text = ("" if time is None else f"{time.median_ms:.2f}" for time in times)
        yield f"{'cv2.' + function:{_NAME_WIDTH}}" + "".join(f"  {text:>{width}}" for text in cells_text)


def _rows(columns: list[dict[str, StageFigures]]) -> list[str]:
    """Names that reach _MIN_SHOWN_MS in any column, in the order of the first column."""
    return list(
        dict.fromkeys(
            name
            for column in columns
            for name, stage in column.items()
            if stage.own_ms + stage.opencv_ms >= _MIN_SHOWN_MS
        )
    )


def _stage_cell(stage: StageFigures | None) -> str:
    return "" if stage is None else f"{stage.own_ms:.2f} + {stage.opencv_ms:.2f}"


def _row(name: str, durations: Durations) -> str:
    digits = 2 if durations.median_ms >= 1.0 else 3
    return f"{name:{_NAME_WIDTH}}{durations.median_ms:8.{digits}f}{durations.p99_ms:8.{digits}f}"
