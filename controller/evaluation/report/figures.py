"""The report's diagrams, drawn from figures only. Pictures with camera images are in pictures.py."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

from controller.evaluation.methods.timed_methods import (
    BACKGROUND,
    DENSE_FLOW,
    LIDAR,
    LOW_RANK,
    OURS,
    OURS_ALONE,
    TRACKING,
    TRAJECTORIES,
)
from controller.evaluation.report.chart import (
    AMBER,
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PURPLE,
    SKY,
    Axis,
    Chart,
    blank,
)
from controller.evaluation.report.paper import PAPER_LIDAR, PAPER_OURS
from controller.evaluation.report.summary import MethodSummary, Summary
from controller.evaluation.scores.totals import DISTANCE_BINS_M, ByDistance, Curve
from controller.video.style import Colour, Image, Rect

COLOURS: dict[str, Colour] = {
    OURS: BLUE,
    OURS_ALONE: SKY,
    LIDAR: GREEN,
    BACKGROUND: AMBER,
    TRAJECTORIES: PURPLE,
    TRACKING: GREY,
    LOW_RANK: ORANGE,
    DENSE_FLOW: INK,
}
_SHARE = Axis("", 0.0, 1.02, ticks=tuple((value / 5, f"{value / 5:g}") for value in range(6)))
_PANEL = (760, 620)  # width and height of one diagram
TARGET_ENDPOINT_PX = 0.15  # for the median beyond 2 m


def precision_recall(summary: Summary) -> Image:
    """Fig. 4: curves at pixel level (left) and at object level (right), with the operating points."""
    width, height = _PANEL
    image = blank(2 * width, height)
    ours = summary.splits["reporting"][OURS]
    recall, precision = _shares("recall", "precision")
    left = Chart(image, Rect(0, 0, width, height), "Pixel level", recall, precision)
    _curve(left, summary.per_pixel, BLUE, "treadwatch")
    operating_point = ours.pixel_counts
    left.points([operating_point.recall], [operating_point.precision], BLUE, "circle", "called moving")
    left.legend("lower left")
    right = Chart(image, Rect(width, 0, width, height), "Object level", recall, precision)
    _curve(right, summary.per_object, BLUE, "treadwatch, per object")
    _curve(right, summary.per_frame, SKY, "treadwatch, per frame")
    figures = ours.figures
    right.points([figures.objects.recall], [figures.objects.precision], BLUE, "circle", "called moving")
    right.points([figures.settled.recall], [figures.settled.precision], SKY, "circle")
    lidar = summary.splits["reporting"].get(LIDAR)
    if lidar is not None:
        right.points(
            [lidar.figures.objects.recall], [lidar.figures.objects.precision], GREEN, "square",
            "our lidar baseline",
        )  # fmt: skip
    right.points([PAPER_OURS.recall], [PAPER_OURS.precision], ORANGE, "diamond", "the paper's method")
    right.points([PAPER_LIDAR.recall], [PAPER_LIDAR.precision], GREY, "diamond", "the paper's lidar")
    right.legend("lower left")
    return image


def endpoint_error(endpoint: ByDistance) -> Image:
    """Fig. 5: median, mean and 90th percentile by distance."""
    width, height = _PANEL
    image = blank(width + 200, height)
    highest = _round_up(np.nanmax([*endpoint.p90, *endpoint.mean, 0.3]))
    chart = Chart(
        image, Rect(0, 0, width + 200, height), "Endpoint error of tracked fragments, static scene",
        Axis("distance in m", 0.0, endpoint.edges_m[-1]), Axis("error in px", 0.0, highest),
    )  # fmt: skip
    middles = _middles(endpoint.edges_m)
    chart.line(middles, endpoint.p90, SKY, "90th percentile", "square")
    chart.line(middles, endpoint.mean, ORANGE, "mean", "diamond")
    chart.line(middles, endpoint.median, BLUE, "median", "circle")
    chart.target_line(TARGET_ENDPOINT_PX, GREY, "target beyond 2 m (median)")
    chart.legend("upper right")
    return image


def speed_error(methods: dict[str, MethodSummary]) -> Image:
    """Median and 90th percentile of the velocity error by distance, for methods that measure velocity."""
    width, height = _PANEL
    image = blank(2 * width, height)
    names = [name for name in (OURS, OURS_ALONE, LIDAR) if name in methods and _measures_speed(methods[name])]
    for index, (title, pick) in enumerate((("Median", _medians), ("90th percentile", _p90s))):
        values = [pick(methods[name].figures.speed_error) for name in names]
        highest = _round_up(np.nanmax([0.2, *(value for row in values for value in row)]))
        chart = Chart(
            image, Rect(index * width, 0, width, height), f"Velocity error: {title.lower()}",
            Axis("distance in m", 0.0, 10.0), Axis("error in m/s", 0.0, highest),
        )  # fmt: skip
        for name, row in zip(names, values, strict=True):
            edges = methods[name].figures.speed_error.edges_m
            chart.line(_middles(edges), row, COLOURS[name], name, "circle")
        chart.legend("upper left")
    return image


def latency(methods: dict[str, MethodSummary]) -> Image:
    """Share of the objects detected by a time, counted from when each became eligible."""
    width, height = _PANEL
    image = blank(width + 200, height)
    chart = Chart(
        image, Rect(0, 0, width + 200, height), "From eligible to first detection",
        Axis("time in s", 0.0, 2.0), Axis("share of the objects detected", 0.0, 1.02, ticks=_SHARE.ticks),
    )  # fmt: skip
    for name, summary in methods.items():
        times = np.sort(np.array(summary.figures.latencies_s))
        if len(times) == 0:
            continue
        shares = np.arange(1, len(times) + 1) / len(times)
        known = times <= 2.0
        x = np.concatenate([[0.0], np.repeat(times[known], 2), [2.0]])
        last = float(shares[known][-1]) if known.any() else 0.0
        y = np.concatenate([[0.0, 0.0], np.repeat(shares[known], 2)])[: len(x) - 1]
        chart.line(x, np.concatenate([y, [last]]), COLOURS[name], name)
    chart.legend("lower right")
    return image


def found_by_distance(method: MethodSummary) -> Image:
    """The number of objects at each distance, and how many of them were found."""
    width, height = _PANEL
    image = blank(width + 200, height)
    counts = method.figures.found_by_distance
    object_counts = [count.correct + count.missed for count in counts]
    edges = np.array(DISTANCE_BINS_M)
    chart = Chart(
        image, Rect(0, 0, width + 200, height), "Moving objects by distance",
        Axis("median distance in m", 0.0, float(edges[-1])),
        Axis("objects", 0.0, _round_up(max(*object_counts, 4))),
    )  # fmt: skip
    chart.bars(edges[:-1] + 0.06, edges[1:] - 0.06, object_counts, GREY, "there were")
    chart.bars(edges[:-1] + 0.06, edges[1:] - 0.06, [count.correct for count in counts], BLUE, "found")
    chart.legend("upper right")
    return image


def table_one(methods: dict[str, MethodSummary]) -> Image:
    """Table 1 as measured: precision and recall per object, and processing time per frame."""
    names = list(methods)
    width, row = 1520, 58
    height = 140 + row * len(names)
    image = blank(width, height)
    ticks = tuple((len(names) - 1 - index + 0.5, name) for index, name in enumerate(names))
    rows = Axis("", 0.0, float(len(names)), ticks=ticks)
    left = Rect(170, 0, 720, height)
    share = Axis("per object", 0.0, 1.02, ticks=_SHARE.ticks)
    chart = Chart(image, left, "Precision and recall", share, rows)
    for index, name in enumerate(names):
        middle = len(names) - 1 - index + 0.5
        objects = methods[name].figures.objects
        for value, offset, colour in ((objects.precision, 0.16, BLUE), (objects.recall, -0.16, AMBER)):
            chart.line([0.0, value], [middle + offset] * 2, colour)
            chart.points([value], [middle + offset], colour, "circle")
    chart.points([], [], BLUE, "circle", "precision")
    chart.points([], [], AMBER, "circle", "recall")
    chart.inline_legend()
    empty = Axis("", 0.0, float(len(names)), ticks=tuple((place, "") for place, _ in ticks))
    cost = Axis("median ms a frame", 0.5, 1000.0, log=True)
    times = Chart(image, Rect(left.right, 0, width - left.right, height), "Time", cost, empty)
    for index, name in enumerate(names):
        middle = len(names) - 1 - index + 0.5
        ms = methods[name].figures.ms_per_frame
        times.line([0.5, ms], [middle] * 2, COLOURS[name])
        times.points([ms], [middle], COLOURS[name], "square")
        times.annotate(ms, middle + 0.06, f"{ms:.1f}")
    return image


def _shares(x: str, y: str) -> tuple[Axis, Axis]:
    return Axis(x, 0.0, 1.02, ticks=_SHARE.ticks), Axis(y, 0.0, 1.02, ticks=_SHARE.ticks)


def _curve(chart: Chart, curve: Curve, colour: Colour, label: str) -> None:
    chart.line(curve.recall, curve.precision, colour, label)


def _middles(edges_m: Sequence[float]) -> list[float]:
    return [0.5 * (low + high) for low, high in itertools.pairwise(edges_m)]


def _medians(bins: ByDistance) -> tuple[float, ...]:
    return bins.median


def _p90s(bins: ByDistance) -> tuple[float, ...]:
    return bins.p90


def _measures_speed(method: MethodSummary) -> bool:
    return math.isfinite(method.figures.speed_error_median_mps)


def _round_up(value: float) -> float:
    """The next round number that is at least 5 % higher, so that there is some room above."""
    power = 10.0 ** math.floor(math.log10(value))
    steps = (1.0, 1.5, 2.0, 3.0, 5.0, 7.5, 10.0, 15.0)
    return next(step * power for step in steps if step * power >= 1.05 * value)
