"""Boxes around parts and surfaces, in space and in the image: which are close, above or within which.

Terms: vision/__init__.py.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray
from vision.bodies.division import LOW, WITHIN
from vision.depth.depth_grid import DepthGrid
from vision.depth.regions import Regions

LOAD_M = 0.8  # by so much farther back a load may begin than what carries it
THROUGH_M = 1.5  # by so much farther back a vehicle may be seen through itself
LEAST_SAMPLES = 3  # of the cells between two: something is there
_ALONG = np.linspace(0.0, 1.0, 24)[:, None]  # from one to another
_MOSTLY = 0.7  # of its width: a load juts out beyond its carrier by no more
_TOUCHING_PX = 16.0  # four cells: the rims between two depths are of neither


@dataclass(frozen=True, slots=True, eq=False)
class Boxes:
    """Axis-parallel boxes of R surfaces in the camera frame: low_m (R, 3), high_m (R, 3)."""

    low_m: FloatArray
    high_m: FloatArray


def boxes(regions: Regions) -> Boxes:
    """The boxes that regions fill."""
    half = 0.5 * regions.extent_m
    return Boxes(regions.position_m - half, regions.position_m + half)


def gaps_m(a: Boxes, first: NDArray[np.intp], b: Boxes, second: NDArray[np.intp]) -> FloatArray:
    """(K,) distance between box first[k] of a and box second[k] of b, 0 where they touch; or of any shape
    that first and second are broadcast to."""
    gap = np.maximum(a.low_m[first] - b.high_m[second], b.low_m[second] - a.high_m[first])
    result: FloatArray = np.sqrt(np.square(np.maximum(gap, 0.0)).sum(axis=-1))
    return result


def stacked(a: FloatArray, b: FloatArray) -> NDArray[np.bool_]:
    """(K,) whether the lower end of box a[k] is the upper end of box b[k] in the image, for most of the
    width of a[k]; (K, 4) each: u0, v0, u1, v1."""
    shared = np.minimum(a[:, 2], b[:, 2]) - np.maximum(a[:, 0], b[:, 0])
    apart = np.abs(a[:, 3] - b[:, 1])
    result: NDArray[np.bool_] = (shared >= _MOSTLY * (a[:, 2] - a[:, 0])) & (apart <= _TOUCHING_PX)
    return result


def seen_through(a: FloatArray, b: FloatArray) -> NDArray[np.bool_]:
    """(K,) whether box a[k] lies within box b[k] in the image and is at most half as tall, as nobody behind
    somebody else is; (K, 4) each: u0, v0, u1, v1."""
    low = a[:, 3] - a[:, 1] <= LOW * (b[:, 3] - b[:, 1])
    result: NDArray[np.bool_] = low & (overlaps(a, b) >= WITHIN)
    return result


def overlaps(a: FloatArray, b: FloatArray) -> FloatArray:
    """(K,) share of box a[k] that box b[k] covers in the image; (K, 4) each: u0, v0, u1, v1; or of any
    shape (..., 4) that a and b are broadcast to."""
    size = np.minimum(a[..., 2:], b[..., 2:]) - np.maximum(a[..., :2], b[..., :2])
    shared = np.maximum(size, 0.0).prod(axis=-1)
    result: FloatArray = shared / np.maximum((a[..., 2:] - a[..., :2]).prod(axis=-1), 1.0)
    return result


def cells_between(
    grid: DepthGrid, regions: Regions, one: NDArray[np.intp], other: NDArray[np.intp]
) -> NDArray[np.intp]:
    """(24, K) cells in the image on the way from the middle of region one[k] to that of other[k]."""
    middle = 0.5 * (regions.bbox_px[:, :2] + regions.bbox_px[:, 2:])
    u, v = (k[one] + (k[other] - k[one]) * _ALONG for k in middle.T)
    return grid.cells(u, v)
