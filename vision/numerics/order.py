"""Medians and quantiles of small arrays by sorting them.

np.median and np.quantile take several times as long on arrays of this size, and the first call of
np.median imports numpy.ma: 35 ms in the middle of a frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from vision.camera.lens import RealArray

Reals = TypeVar("Reals", NDArray[np.float32], NDArray[np.float64])


def median(values: Reals) -> Reals:
    """Median along the last axis of values (..., N), N > 0; for even N the mean of the middle two."""
    ordered, middle = np.sort(values, axis=-1), values.shape[-1] // 2
    result: Reals = ordered[..., middle]
    return result if values.shape[-1] % 2 else 0.5 * (ordered[..., middle - 1] + result)


def quantiles(values: RealArray, shares: Sequence[float]) -> tuple[float, ...]:
    """Quantiles of values (N,), N > 0, with linear interpolation: share 0 is the smallest, 1 the largest."""
    ordered = np.sort(values)
    return tuple(_at(ordered, share) for share in shares)


def quantile(values: RealArray, share: float) -> float:
    """One quantile of values (N,), N > 0."""
    return quantiles(values, (share,))[0]


def _at(ordered: NDArray[Any], share: float) -> float:
    place = share * (len(ordered) - 1)
    below = min(int(place), len(ordered) - 1)
    above = min(below + 1, len(ordered) - 1)
    low, high = float(ordered[below]), float(ordered[above])
    return low + (high - low) * (place - below)
