"""Boxes around regions, in space and in the image: gaps, overlaps, which lies above or within which, and what
is seen between two of them.

Used by vision/bodies/grouping.py, merging.py and report.py. Terms: vision/__init__.py.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled, inlined
from hal.records import record
from hal.types import FloatArray
from vision.bodies.sizes import NEARER_INVERSE, SEEN_THROUGH_HEIGHT, SEEN_THROUGH_SHARE
from vision.depth.cells import cell_at
from vision.depth.depth_grid import DepthGrid
from vision.depth.regions import Regions

_MIN_SAMPLES = 3  # of the cells sampled between two regions: with at least this many, something is there
_SAMPLES = 24  # cells sampled on the way from one region to another
_STACKED_SHARE = 0.7  # of a load's width is above its carrier at least; the rest may jut out
_TOUCHING_PX = 16.0  # two edges in the image touch: 4 cells, since the rims at a jump in depth are of neither


@record(frozen=True, slots=True, eq=False)
class Boxes:
    """Axis-parallel boxes of R surfaces in the camera frame: low_m (R, 3), high_m (R, 3)."""

    low_m: FloatArray
    high_m: FloatArray


def boxes(regions: Regions) -> Boxes:
    """The boxes that regions fill."""
    half = 0.5 * regions.extent_m
    return Boxes(regions.position_m - half, regions.position_m + half)


@record(frozen=True, slots=True, eq=False)
class Relations:
    """How each of K boxes lies relative to one other box, (K,) each.

    gap_m: distance between the two in space, 0 where they touch.
    overlap: share of the first box that the other covers in the image.
    stacked: in the image the lower edge of the first is the upper edge of the other, for most of its width.
    within: in the image the first lies within the other and is at most half as tall. A person behind another
        one is taller.
    """

    gap_m: FloatArray
    overlap: FloatArray
    stacked: NDArray[np.bool_]
    within: NDArray[np.bool_]


def relations(regions: Regions, one: NDArray[np.intp], other: NDArray[np.intp]) -> Relations:
    """How regions one (K,) lie relative to regions other (K,), both as indices."""
    return Relations(*_relations(regions, one, other))


@inlined
def gap_between_m(regions: Regions, one: int, other: int) -> float:
    """Distance in space between two regions, 0 where they touch."""
    squared = 0.0
    for i in range(3):
        apart_m = abs(regions.position_m[one, i] - regions.position_m[other, i])
        apart_m -= 0.5 * (regions.extent_m[one, i] + regions.extent_m[other, i])
        squared += max(apart_m, 0.0) ** 2
    return math.sqrt(squared)


@inlined
def lies(regions: Regions, one: int, other: int) -> tuple[float, bool, bool]:
    """How a region lies relative to another one in the image: overlap, stacked and within of Relations."""
    left, top, right, bottom = regions.bbox_px[one]
    u0, v0, u1, v1 = regions.bbox_px[other]
    width, height = right - left, bottom - top
    across, down = min(right, u1) - max(left, u0), min(bottom, v1) - max(top, v0)
    overlap = max(across, 0.0) * max(down, 0.0) / max(width * height, 1.0)
    stacked = across >= _STACKED_SHARE * width and abs(bottom - v0) <= _TOUCHING_PX
    within = height <= SEEN_THROUGH_HEIGHT * (v1 - v0) and overlap >= SEEN_THROUGH_SHARE
    return overlap, stacked, within


@compiled(Regions, "int64[:], int64[:]")
def _relations(
    regions: Regions, one: NDArray[np.intp], other: NDArray[np.intp]
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_], NDArray[np.bool_]]:
    """The fields of Relations."""
    gap_m, overlap = np.empty(len(one)), np.empty(len(one))
    stacked, within = np.empty(len(one), np.bool_), np.empty(len(one), np.bool_)
    for k in range(len(one)):
        gap_m[k] = gap_between_m(regions, one[k], other[k])
        overlap[k], stacked[k], within[k] = lies(regions, one[k], other[k])
    return gap_m, overlap, stacked, within


def overlaps(a: FloatArray, b: FloatArray) -> FloatArray:
    """(...) share of box a that box b covers in the image.

    a, b (..., 4): u0, v0, u1, v1; they are broadcast to each other.
    """
    size = np.minimum(a[..., 2:], b[..., 2:]) - np.maximum(a[..., :2], b[..., :2])
    shared = np.maximum(size, 0.0).prod(axis=-1)
    result: FloatArray = shared / np.maximum((a[..., 2:] - a[..., :2]).prod(axis=-1), 1.0)
    return result


def nearer_between(
    grid: DepthGrid, regions: Regions, one: NDArray[np.intp], other: NDArray[np.intp]
) -> NDArray[np.bool_]:
    """(K,) whether something nearer lies between the middles of regions one[k] and other[k] in the image."""
    inverse = grid.inverse_depth.ravel().take(_cells_between(grid, regions, one, other))
    depth = np.minimum(regions.position_m[one, 2], regions.position_m[other, 2])
    nearer = inverse > 1.0 / np.maximum(depth, 0.1) + NEARER_INVERSE
    result: NDArray[np.bool_] = nearer.sum(axis=0) >= _MIN_SAMPLES
    return result


def farther_between(
    grid: DepthGrid, regions: Regions, one: NDArray[np.intp], other: NDArray[np.intp]
) -> NDArray[np.bool_]:
    """(K,) whether something farther is seen between the middles of regions one[k] and other[k]."""
    cells = _cells_between(grid, regions, one, other)
    inverse, beyond = grid.inverse_depth.ravel().take(cells), grid.beyond.ravel().take(cells)
    depth = np.maximum(regions.position_m[one, 2], regions.position_m[other, 2])
    farther = (inverse > 0.0) & (inverse < 1.0 / np.maximum(depth, 0.1) - NEARER_INVERSE)
    result: NDArray[np.bool_] = (farther | beyond).sum(axis=0) >= _MIN_SAMPLES
    return result


@compiled(DepthGrid, Regions, "int64[:], int64[:]")
def _cells_between(
    grid: DepthGrid, regions: Regions, one: NDArray[np.intp], other: NDArray[np.intp]
) -> NDArray[np.intp]:
    """(24, K) flat cells on the straight line in the image from the middle of region one[k] to other[k]'s."""
    cells = np.empty((_SAMPLES, len(one)), np.intp)
    for k in range(len(one)):
        a, b = regions.bbox_px[one[k]], regions.bbox_px[other[k]]
        u, v = 0.5 * (a[0] + a[2]), 0.5 * (a[1] + a[3])
        across, down = 0.5 * (b[0] + b[2]) - u, 0.5 * (b[1] + b[3]) - v
        for i in range(_SAMPLES):
            share = i / (_SAMPLES - 1)
            row, column = cell_at(grid, u + across * share, v + down * share)
            cells[i, k] = row * len(grid.x) + column
    return cells
