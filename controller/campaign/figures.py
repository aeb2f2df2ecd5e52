"""The figures of a campaign's report."""

from __future__ import annotations

import math

import numpy as np

from controller.campaign.judge import Row
from controller.campaign.policies import FIELD, OURS, PAPER, ZONES
from controller.campaign.summary import Summary
from controller.campaign.task import time_ratio
from controller.evaluation.chart import BLUE, GREEN, GREY, ORANGE, PURPLE, Axis, Chart, blank
from controller.video.style import Colour, Image, Rect

_COLOURS: dict[str, Colour] = {OURS: BLUE, PAPER: ORANGE, ZONES: GREEN, FIELD: PURPLE}
_WIDTH, _HEIGHT = 900, 560
_MAX_RATIO = 3.0
_SHARES = tuple((value / 5, f"{value / 5:g}") for value in range(6))


def ratio_figure(rows: list[Row]) -> Image:
    """Cumulative distribution of time over the oracle's time, by policy."""
    image = blank(_WIDTH, _HEIGHT)
    chart = Chart(
        image,
        Rect(0, 0, _WIDTH, _HEIGHT),
        "Time over the oracle's",
        Axis("time / oracle's time", 0.9, _MAX_RATIO),
        Axis("share of the missions", 0.0, 1.02, ticks=_SHARES),
    )
    for policy in dict.fromkeys(row.policy for row in rows):
        ratios = [time_ratio(row) for row in rows if row.policy == policy]
        ratios = [ratio for ratio in ratios if not math.isnan(ratio)]
        _distribution(chart, ratios, _COLOURS.get(policy, GREY), policy, 0.9, _MAX_RATIO)
    chart.legend("lower right")
    return image


def clearance_figure(rows: list[Row]) -> Image:
    """Cumulative distribution of the smallest clearance, by policy; below 0 is contact."""
    image = blank(_WIDTH, _HEIGHT)
    chart = Chart(
        image,
        Rect(0, 0, _WIDTH, _HEIGHT),
        "Smallest clearance",
        Axis("clearance in m", -0.5, 2.0),
        Axis("share of the missions", 0.0, 1.02, ticks=_SHARES),
    )
    for policy in dict.fromkeys(row.policy for row in rows):
        nearest = [row.min_clearance_m for row in rows if row.policy == policy]
        _distribution(chart, nearest, _COLOURS.get(policy, GREY), policy, -0.5, 2.0)
    chart.legend("lower right")
    return image


def _distribution(
    chart: Chart, values: list[float], colour: Colour, label: str, low: float, high: float
) -> None:
    """Draw the cumulative distribution of values as a line from low to high."""
    if not values:
        return
    ordered = np.sort(np.array(values))
    grid = np.linspace(low, high, 400)
    chart.line(grid, np.searchsorted(ordered, grid, side="right") / len(ordered), colour, label)


def family_figure(summary: Summary) -> Image:
    """Median time over the oracle's time of each family, by policy. An arrow: longer than shown, or never."""
    families = list(summary.families)
    width = max(_WIDTH, 60 + 46 * len(families))
    image = blank(width, _HEIGHT)
    ticks = tuple((k + 0.5, str(k + 1)) for k in range(len(families)))
    chart = Chart(
        image,
        Rect(0, 0, width, _HEIGHT),
        "Median time by family",
        Axis("family, numbered as in the report", 0.0, max(len(families), 1), ticks=ticks),
        Axis("time / oracle's time", 0.9, _MAX_RATIO),
    )
    policies = list(summary.policies)
    for number, policy in enumerate(policies):
        bar = 0.8 / len(policies)
        medians = [summary.families[family][policy].ratio_median for family in families]
        heights = [math.nan if value is None else value for value in medians]
        left = np.arange(len(families), dtype=np.float64) + (0.1 + bar * number)
        chart.bars(left, left + 0.9 * bar, heights, _COLOURS.get(policy, GREY), policy)
    chart.target_line(1.1, GREY, "target 1.10")
    chart.inline_legend()
    return image
