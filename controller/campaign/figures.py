"""The figures of a campaign's report."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from controller.campaign.judge import Row
from controller.campaign.policies import FIELD, OURS, PAPER, POLICY_NAMES, ZONES
from controller.campaign.summary import Summary
from controller.campaign.task import time_ratio
from controller.evaluation.report.chart import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, Axis, Chart, blank
from controller.video import text
from controller.video.style import Colour, Image, Rect

_COLOURS: dict[str, Colour] = {OURS: BLUE, PAPER: ORANGE, ZONES: GREEN, FIELD: PURPLE}
_WIDTH, _HEIGHT = 900, 560
_MIN_RATIO, _MAX_RATIO = 0.9, 3.0
_RATIO_STEP, _CLEARANCE_STEP_M = 0.1, 0.5
_MIN_CLEARANCE_M, _MAX_CLEARANCE_M = -0.5, 2.0
_NAMES_PX = 150  # for the names of the families, which stand upright
_SHARES = tuple((value / 5, f"{value / 5:g}") for value in range(6))


def ratio_figure(rows: list[Row]) -> Image:
    """Cumulative distribution of time over the oracle's time, by policy."""
    image = blank(_WIDTH, _HEIGHT)
    low, high = _ratio_range([time_ratio(row) for row in rows])
    chart = Chart(
        image,
        Rect(0, 0, _WIDTH, _HEIGHT),
        "Time over the oracle's",
        Axis("time / oracle's time", low, high),
        Axis("share of missions with at most this", 0.0, 1.02, ticks=_SHARES),
    )
    for policy in _in_order(rows):
        ratios = [time_ratio(row) for row in rows if row.policy == policy]
        _distribution(chart, [ratio for ratio in ratios if not math.isnan(ratio)], policy, low, high)
    chart.legend("lower right")
    return image


def clearance_figure(rows: list[Row]) -> Image:
    """Cumulative distribution of the smallest clearance, by policy; below 0 is contact."""
    image = blank(_WIDTH, _HEIGHT)
    least_m = min((row.min_clearance_m for row in rows if math.isfinite(row.min_clearance_m)), default=0.0)
    low_m = min(_MIN_CLEARANCE_M, math.floor(least_m / _CLEARANCE_STEP_M) * _CLEARANCE_STEP_M)
    chart = Chart(
        image,
        Rect(0, 0, _WIDTH, _HEIGHT),
        "Smallest clearance",
        Axis("clearance in m; below 0: contact", low_m, _MAX_CLEARANCE_M),
        Axis("share of missions with at most this", 0.0, 1.02, ticks=_SHARES),
    )
    for policy in _in_order(rows):
        nearest = [row.min_clearance_m for row in rows if row.policy == policy]
        _distribution(chart, nearest, policy, low_m, _MAX_CLEARANCE_M)
    chart.legend("lower right")
    return image


def _in_order(rows: list[Row]) -> list[str]:
    """The policies of the rows, ours first."""
    driven = {row.policy for row in rows}
    return [name for name in POLICY_NAMES if name in driven] + sorted(driven - set(POLICY_NAMES))


def _ratio_range(ratios: Iterable[float | None]) -> tuple[float, float]:
    """An axis for these times over the oracle's, in round numbers."""
    finite = [ratio for ratio in ratios if ratio is not None and math.isfinite(ratio)] or [1.0]
    low = math.floor(min(finite) / _RATIO_STEP + 1e-6) * _RATIO_STEP
    high = math.ceil((max(finite) + 0.05) / _RATIO_STEP) * _RATIO_STEP
    return min(_MIN_RATIO, low - 0.5 * _RATIO_STEP), min(_MAX_RATIO, max(1.2, high))


def _distribution(chart: Chart, values: list[float], policy: str, low: float, high: float) -> None:
    """Draw the cumulative distribution of values as a line from low to high; dashed for the protective field,
    which is drawn last and often coincides with the zones."""
    if not values:
        return
    ordered = np.sort(np.array(values))
    grid = np.linspace(low, high, 400)
    shares = np.searchsorted(ordered, grid, side="right") / len(ordered)
    chart.line(grid, shares, _COLOURS.get(policy, GREY), policy, dashed=policy == FIELD)


def family_figure(summary: Summary) -> Image:
    """Median time over the oracle's time of each family, by policy. An arrow: longer than shown, or never."""
    families = list(summary.families)
    width = max(_WIDTH, 60 + 46 * len(families))
    image = blank(width, _HEIGHT + _NAMES_PX)
    medians = [one.ratio_median for by_policy in summary.families.values() for one in by_policy.values()]
    low, high = _ratio_range(medians)
    ticks = tuple((k + 0.5, "") for k in range(len(families)))
    chart = Chart(
        image,
        Rect(0, 0, width, _HEIGHT),
        "Median time by family",
        Axis("", 0.0, max(len(families), 1), ticks=ticks),
        Axis("time / oracle's time", low, high),
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
    for number, family in enumerate(families):
        x, _ = chart.to_px([number + 0.5], [low])[0]
        _write_upright(image, f"{number + 1}. {family}", round(float(x)), chart.plot.bottom + 10)
    return image


def _write_upright(image: Image, words: str, x: int, top: int) -> None:
    """Words that read upwards, centred at x, and end at top."""
    length = min(text.width(words, 14) + 4, image.shape[0] - top)
    line = blank(length, 20)
    text.put(line, words, 0, 15, INK, 14)
    image[top : top + length, x - 10 : x + 10] = np.rot90(line)
