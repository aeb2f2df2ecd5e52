"""Statistics of repeated time measurements."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from hal.clocks import NS_PER_MS


@dataclass(frozen=True, slots=True)
class Stopwatches:
    """Two clocks. On an idle machine both give the same for work on one core.

    processor_ns: processor time of all threads of this program, whatever else the machine does meanwhile.
    elapsed_ns: wall-clock time.
    """

    processor_ns: Callable[[], int]
    elapsed_ns: Callable[[], int]


@dataclass(frozen=True, slots=True)
class Durations:
    """Median and 99th percentile of count durations, in milliseconds."""

    count: int
    median_ms: float
    p99_ms: float

    @classmethod
    def of(cls, samples_ns: Sequence[int]) -> Self:
        """Statistics of these samples. Raises ValueError if there are none: unknown is not zero."""
        if not samples_ns:
            raise ValueError("nothing was measured")
        values_ms = np.asarray(samples_ns, dtype=float) / NS_PER_MS
        return cls(len(samples_ns), float(np.median(values_ms)), float(np.percentile(values_ms, 99)))

    def as_json(self) -> dict[str, float]:
        """Plain values."""
        return {
            "count": self.count,
            "median_ms": round(self.median_ms, 4),
            "p99_ms": round(self.p99_ms, 4),
        }


def median_ratio(numerators_ns: Sequence[int], denominators_ns: Sequence[int]) -> float:
    """Median of the ratios of pairs that were measured directly one after the other.

    A moment in which the machine is slow affects both of a pair, so this varies less than the ratio of the
    two medians. Pairs with a denominator of zero are left out; NaN if no pair is left.
    """
    pairs = zip(numerators_ns, denominators_ns, strict=True)
    ratios = [above / below for above, below in pairs if below > 0]
    return float(np.median(ratios)) if ratios else float("nan")
