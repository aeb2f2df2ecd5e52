"""Medians and quantiles of small arrays, the noise that these tell, and places in ordered arrays.

np.median and np.quantile take several times as long on arrays of this size, and the first call of
np.median imports numpy.ma: 35 ms in the middle of a frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled, in_place, inlined
from vision.camera.lens import RealArray

_CHI2_THIRD = 0.811  # a third of chi-square with 2 degrees of freedom lies below it

Reals = TypeVar("Reals", NDArray[np.float32], NDArray[np.float64])


def median(values: Reals) -> Reals:
    """Median along the last axis of values (..., N), N > 0; for even N the mean of the middle two."""
    ordered, middle = np.sort(values, axis=-1), values.shape[-1] // 2
    result: Reals = ordered[..., middle]
    return result if values.shape[-1] % 2 else 0.5 * (ordered[..., middle - 1] + result)


@inlined
def median_of(values: NDArray[np.float32]) -> np.float32:
    """Median of values (N,), N > 0, as of median(), for compiled steps."""
    middle = len(values) // 2
    ordered = np.partition(values, middle)
    upper: np.float32 = ordered[middle]
    return upper if len(values) % 2 == 1 else np.float32(0.5) * (ordered[:middle].max() + upper)


@in_place
def _of_rank(values: NDArray[np.float32], rank: int) -> float:
    """The one of values (N,), none of them negative, that comes after rank others in ascending order.

    Such numbers are in the order of their bits, which are found one by one, from the highest on, by counting
    the values that are less. That is quicker than to sort in part: the processor compares sixteen at once.
    """
    bits, found = values.view(np.int32), np.int32(0)
    for place in range(30, -1, -1):
        tried, less = np.int32(found | (1 << place)), np.int32(0)
        for k in range(len(bits)):
            less = np.int32(less + np.int32(bits[k] < tried))
        if less <= rank:
            found = tried
    return float(np.int32(found).view(np.float32))


@in_place
def median_of_positive(values: NDArray[np.float32]) -> float:
    """Median of values (N,), N > 0, none of them negative."""
    middle = len(values) // 2
    upper = _of_rank(values, middle)
    return upper if len(values) % 2 == 1 else 0.5 * (_of_rank(values, middle - 1) + upper)


def quantiles(values: RealArray, shares: Sequence[float]) -> tuple[float, ...]:
    """Quantiles of values (N,), N > 0, with linear interpolation: share 0 is the smallest, 1 the largest."""
    ordered = np.sort(values)
    return tuple(_at(ordered, share) for share in shares)


def quantile(values: RealArray, share: float) -> float:
    """One quantile of values (N,), N > 0."""
    return quantiles(values, (share,))[0]


def variance_ratio(chi2: RealArray) -> float:
    """The variance that residuals show, as a ratio to the assumed one.

    chi2 (N,), N > 0: squared lengths of residuals with 2 degrees of freedom, in assumed sigmas. The lower
    third decides: up to two thirds may be outliers, such as movers that are not known yet.
    """
    return quantile(chi2, 1.0 / 3.0) / _CHI2_THIRD


@in_place
def index_of(ordered: NDArray[np.int64], value: int) -> int:
    """Index of value in ordered (M,), which ascends; -1 if it is not among them."""
    place = int(np.searchsorted(ordered, value))
    return place if place < len(ordered) and ordered[place] == value else -1


@compiled("int64[::1], int64[::1]")
def indices_of(ordered: NDArray[np.int64], values: NDArray[np.int64]) -> NDArray[np.intp]:
    """(N,) index of each of values (N,) in ordered (M,), which ascends; -1 where it is not among them."""
    result = np.empty(len(values), np.intp)
    for k in range(len(values)):
        result[k] = index_of(ordered, values[k])
    return result


def _at(ordered: NDArray[Any], share: float) -> float:
    place = share * (len(ordered) - 1)
    below = min(int(place), len(ordered) - 1)
    above = min(below + 1, len(ordered) - 1)
    low, high = float(ordered[below]), float(ordered[above])
    return low + (high - low) * (place - below)
