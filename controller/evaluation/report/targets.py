"""The figures that the detector has to reach on the simulated set, with and without odometry."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from controller.evaluation.scores.totals import Figures

Verdict = Literal["reached", "missed", "not measured"]


@dataclass(frozen=True, slots=True)
class Target:
    """A figure and its bounds.

    value: the figure, from all figures of a method.
    with_odometry, without_odometry: bounds with and without odometry.
    is_minimum: the figure must be at least the bound; otherwise at most.
    """

    name: str
    unit: str
    value: Callable[[Figures], float]
    with_odometry: float
    without_odometry: float
    is_minimum: bool

    def bound(self, without_odometry: bool) -> str:
        """The bound as text, such as ">= 0.99"."""
        limit = self.without_odometry if without_odometry else self.with_odometry
        return f"{'>=' if self.is_minimum else '<='} {limit:g}"

    def verdict(self, value: float, without_odometry: bool) -> Verdict:
        """Whether the value meets the bound. NaN is not measured: no sequence had what it is a figure of."""
        if math.isnan(value):
            return "not measured"
        compare = operator.ge if self.is_minimum else operator.le
        met = compare(value, self.without_odometry if without_odometry else self.with_odometry)
        return "reached" if met else "missed"


TARGETS = (
    Target("precision per object", "", lambda f: f.objects.precision, 0.99, 0.97, True),
    Target("recall per object", "", lambda f: f.objects.recall, 0.97, 0.93, True),
    Target("precision per frame", "", lambda f: f.settled.precision, 0.97, 0.95, True),
    Target("recall per frame", "", lambda f: f.settled.recall, 0.92, 0.88, True),
    Target("false moving obstacles", "a minute", lambda f: f.wrong_per_minute, 0.5, 1.0, False),
    Target("velocity error, median", "m/s", lambda f: f.speed_error_median_mps, 0.08, 0.12, False),
    Target("velocity error, 90th percentile", "m/s", lambda f: f.speed_error_p90_mps, 0.25, 0.35, False),
    Target("first detection, median", "s", lambda f: f.latency_median_s, 0.2, 0.3, False),
)
