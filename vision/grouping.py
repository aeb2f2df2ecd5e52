"""Parts to bodies, where connected depth says too much or too little.

A shoe, an arm or a load may be parted from its body by a hole in the depth image: what is small, close
to a mover and does not contradict its motion is part of it. Two people who walk side by side may be one
connected part: a mover that is too wide for one is divided where it is thin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray
from vision.depth_grid import DepthGrid
from vision.order import median, quantiles
from vision.regions import IntGrid, Regions

_CLOSE_M = 0.25
_APART_M = 0.40
_SMALL_SHARE = 0.5
_SAME_VELOCITY_MPS = 0.4
_SINGLE_WIDTH_M = 0.85
_PAIR_DISTANCE_M = 0.5
_VALLEY = 0.35
_MIN_CELLS = 24
_BINS = 12
_OVERLAP = 0.5  # of the smaller box: side by side people overlap less


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
    """(K,) distance between box first[k] of a and box second[k] of b, 0 where they touch."""
    gap = np.maximum(a.low_m[first] - b.high_m[second], b.low_m[second] - a.high_m[first])
    result: FloatArray = np.sqrt(np.square(np.maximum(gap, 0.0)).sum(axis=1))
    return result


def detach(winner: NDArray[np.int32], parts: Regions, votes: NDArray[np.intp]) -> NDArray[np.int32]:
    """winner (P,), track index + 1 of each part or 0, without the parts far from the track's main one.

    votes (P,): how many cells spoke for the winner.
    """
    owned = np.flatnonzero(winner > 0)
    if len(owned) == 0:
        return winner
    order = owned[np.lexsort((-votes[owned], winner[owned]))]
    track = winner[order]
    is_main = np.concatenate(([True], track[1:] != track[:-1]))
    main = order[np.maximum.accumulate(np.where(is_main, np.arange(len(order)), 0))]
    box = boxes(parts)
    far = gaps_m(box, order, box, main) > _APART_M
    result = winner.copy()
    result[order[far]] = 0
    return result


def attach(
    new_parts: NDArray[np.intp], parts: Regions, winner: NDArray[np.int32], mover: NDArray[np.bool_]
) -> NDArray[np.int32]:
    """winner (P,) with new parts (indices) given to the mover that they are small beside and close to."""
    of_mover = np.flatnonzero((winner > 0) & np.concatenate(([False], mover))[winner])
    if len(of_mover) == 0 or len(new_parts) == 0:
        return winner
    box = boxes(parts)
    a, b = np.repeat(new_parts, len(of_mover)), np.tile(of_mover, len(new_parts))
    gap = gaps_m(box, a, box, b)
    gap[parts.cells[a] > _SMALL_SHARE * parts.cells[b]] = np.inf
    gap = gap.reshape(len(new_parts), len(of_mover))
    best = gap.argmin(axis=1)
    close = gap[np.arange(len(new_parts)), best] <= _CLOSE_M
    result = winner.copy()
    result[new_parts[close]] = winner[of_mover[best[close]]]
    return result


def merges(
    regions: Regions,
    velocity: FloatArray,
    velocity_sigma: FloatArray,
    mover: NDArray[np.bool_],
    moving: NDArray[np.bool_],
) -> list[tuple[int, int]]:
    """Pairs (small, large) of tracks that are one body: a suspect or mover beside a larger mover.

    velocity (T, 3) and velocity_sigma (T,) of the tracks.
    """
    small = np.flatnonzero(mover & (regions.cells > 0))
    large = np.flatnonzero(moving & (regions.cells > 0))
    if len(small) == 0 or len(large) == 0:
        return []
    box = boxes(regions)
    a, b = np.repeat(small, len(large)), np.tile(large, len(small))
    difference = np.sqrt(np.square(velocity[a] - velocity[b]).sum(axis=1))
    alike = difference <= _SAME_VELOCITY_MPS + velocity_sigma[a] + velocity_sigma[b]
    width = np.maximum(box.high_m[a, 0], box.high_m[b, 0]) - np.minimum(box.low_m[a, 0], box.low_m[b, 0])
    overlap = _overlaps(regions.bbox_px[a], regions.bbox_px[b])
    fits = (
        (regions.cells[a] <= _SMALL_SHARE * regions.cells[b])
        | (width <= _SINGLE_WIDTH_M)
        | (overlap >= _OVERLAP)
    )
    reach = np.where(overlap >= _OVERLAP, _APART_M, _CLOSE_M)
    one = (
        (a != b)
        & (regions.cells[a] <= regions.cells[b])
        & (gaps_m(box, a, box, b) <= reach)
        & alike
        & fits
        & ~((regions.cells[a] == regions.cells[b]) & (a < b))
    )
    result, gone = [], set()
    for part, whole in zip(a[one].tolist(), b[one].tolist(), strict=True):
        if part not in gone and whole not in gone:
            result.append((part, whole))
            gone.add(part)
    return result


def _overlaps(a: FloatArray, b: FloatArray) -> FloatArray:
    """(K,) share of box a[k] that box b[k] covers in the image; (K, 4) each: u0, v0, u1, v1."""
    size = np.minimum(a[:, 2:], b[:, 2:]) - np.maximum(a[:, :2], b[:, :2])
    shared = np.maximum(size, 0.0).prod(axis=1)
    result: FloatArray = shared / np.maximum((a[:, 2:] - a[:, :2]).prod(axis=1), 1.0)
    return result


def split(grid: DepthGrid, labels: IntGrid, track: int) -> NDArray[np.intp] | None:
    """Flat cells of labels == track + 1 that belong to a second body, the smaller one; None: it is one.

    The cells are laid along the line on which they spread most (seen from above). Two people leave a
    valley in between; a crate, however wide, does not.
    """
    cells = np.flatnonzero(labels.ravel() == track + 1)
    if len(cells) < 2 * _MIN_CELLS:
        return None
    points = grid.points(cells)[::2].T.astype(float)
    centred = points - median(points.T)
    _, axes = np.linalg.eigh(centred.T @ centred)
    along = centred @ axes[:, 1]
    low, high = quantiles(along, (0.03, 0.97))
    if high - low < _SINGLE_WIDTH_M:
        return None
    # A far cell stands for more surface than a near one.
    weight = np.square(points[:, 1])
    counts, edges = np.histogram(along, _BINS, (low, high), weights=weight)
    smooth = np.convolve(counts, [0.25, 0.5, 0.25], mode="same")
    valley = int(smooth[2:-2].argmin()) + 2
    left, right = smooth[:valley].max(), smooth[valley + 1 :].max()
    if smooth[valley] > _VALLEY * min(left, right):
        return None
    cut = 0.5 * (edges[valley] + edges[valley + 1])
    second = along > cut
    if np.count_nonzero(second) * 2 > len(cells):
        second = ~second
    if np.count_nonzero(second) < _MIN_CELLS:
        return None
    if abs(median(along[second]) - median(along[~second])) < _PAIR_DISTANCE_M:
        return None
    cut_off: NDArray[np.intp] = cells[second]
    return cut_off
