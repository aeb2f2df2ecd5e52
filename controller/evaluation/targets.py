"""The figures that the detector has to reach on the simulated set, with and without odometry."""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import dataclass

from controller.evaluation.totals import Figures


@dataclass(frozen=True, slots=True)
class Target:
    """A figure and its bounds.

    value: the figure, from all figures of a method.
    with_odometry, alone: bounds with and without odometry.
    at_least: the figure must be at least the bound; otherwise at most.
    """

    name: str
    unit: str
    value: Callable[[Figures], float]
    with_odometry: float
    alone: float
    at_least: bool

    def bound(self, alone: bool) -> str:
        """The bound as text, such as ">= 0.99"."""
        return f"{'>=' if self.at_least else '<='} {self.alone if alone else self.with_odometry:g}"

    def reached(self, value: float, alone: bool) -> bool:
        """Whether the value meets the bound; an unknown value (NaN) does not."""
        compare = operator.ge if self.at_least else operator.le
        return bool(compare(value, self.alone if alone else self.with_odometry))


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
