"""Division of one track that holds two bodies, such as two people who walk side by side.

It takes the cells of one track and returns those of a second body, if there is one.
vision/bodies/regrouping.py calls it after merging, for each track that moves, and for each that is restless:
a person who walks and one who stands, shoulder before shoulder, do not move as one body. Terms:
vision/__init__.py.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled
from hal.types import FloatArray
from vision.bodies.births import MIN_CELLS
from vision.bodies.sizes import (
    NEARER_INVERSE,
    SEEN_THROUGH_HEIGHT,
    SEEN_THROUGH_SHARE,
    SINGLE_WIDTH_M,
)
from vision.depth.connected import IntGrid
from vision.depth.depth_grid import BoolGrid, DepthGrid
from vision.numerics.order import median, quantile, quantiles

_PAIR_DISTANCE_M = 0.5  # minimum distance of the middles of two people side by side, shoulder to shoulder
# A valley between two bodies holds at most this share of the surface of the lower hill beside it. It is not
# empty, since arms touch.
_VALLEY = 0.35
# A group is static if fewer of its cells have left than this share of those that would have left, had it
# moved along.
_STANDING = 0.5
_DIP_M = 0.15  # minimum depth of the dip between two heads; a shoulder is lower still
# Shape of a head: a load is wider; a post is narrower and has no shoulders.
_HEAD_M = 0.15  # its width is measured this far below its top
_MIN_HEAD_M = 0.13  # minimum width; the shoulders are wider than the head by this as well
_MAX_HEAD_M = 0.30  # maximum width
_SHOULDERS_M = 0.36  # the width of the shoulders is measured this far below the top
_MIN_APART_M = 0.35  # minimum distance of two heads
_PAIR_WIDTH_M = 0.7  # minimum width of two people whose heads are _MIN_APART_M apart
_MAX_APART_M = 0.8  # maximum distance: people farther apart leave a valley
# A group is low beside a body if it is at most this share as tall in the image: a trolley is, a child beside
# an adult is not.
_LOW_BESIDE = 0.6
# Share of the image between two groups: if less shows something farther, nothing is seen there.
_NOTHING_SEEN_SHARE = 0.2
_MIN_GROUP = 2 * MIN_CELLS  # cells in each of two groups: twice those of a new track, as each is judged alone
_BINS = 12  # along the line: 0.1 m each where two people walk side by side


def second_bodies(
    grid: DepthGrid, labels: IntGrid, tracks: NDArray[np.intp], stayed: BoolGrid, displacement_m: FloatArray
) -> list[tuple[int, NDArray[np.intp]]]:
    """Those of tracks (K,), indices, that hold two bodies, each with the flat cells of the second one.

    labels (h, w): track index + 1. stayed (h, w), displacement_m (T,): see second_body.
    """
    each = (
        (track, second_body(grid, labels, track, stayed, float(displacement_m[track])))
        for track in tracks.tolist()
    )
    return [(track, cells) for track, cells in each if cells is not None]


def second_body(
    grid: DepthGrid, labels: IntGrid, track: int, stayed: BoolGrid, displacement_m: float
) -> NDArray[np.intp] | None:
    """Flat cells of labels == track + 1 that belong to a second body; None: it is one body.

    The second body is the smaller one, unless that moves and the larger one stands: then the track goes with
    the one that moves.

    The cells are projected onto the line along which they spread most, seen from above. Two people leave a
    valley in between if they are wider than one; a crate, however wide, does not. Where there is no valley,
    two heads with a dip between them show two people as well. The smaller group is not a second body if

    * it is seen through the larger group, as the far wheels of a cart are;
    * it is low beside the larger group and moves with it, as a trolley in front of the person who pushes it.
      It does not move with it if more of its cells are in stayed (h, w) than if it had moved by
      displacement_m;
    * something nearer fills the valley, since that hides the middle of one body;
    * the groups were found by a valley, one of them is too wide for a person, and hardly anything farther is
      seen in the valley.
    """
    cells, across, diagonal_m = _from_above(grid, labels, track + 1)
    # A quick test that many tracks end at: no line can be longer than the diagonal.
    if len(cells) < 2 * _MIN_GROUP or diagonal_m < _PAIR_WIDTH_M:
        return None
    points = across.T
    centred = points - median(points.T)
    _, axes = np.linalg.eigh(centred.T @ centred)
    along = centred @ axes[:, 1]
    low, high = quantiles(along, (0.03, 0.97))
    if high - low < _PAIR_WIDTH_M:
        return None
    beyond = _beyond_valley(points, along, low, high) if high - low >= SINGLE_WIDTH_M else None
    smaller_group = _second_head(grid, cells) if beyond is None else beyond
    if smaller_group is None:
        return None
    if _seen_through(cells[smaller_group], cells[~smaller_group], grid.depth_m.shape[1]):
        return None
    has_stayed = stayed.ravel().take(cells)
    stands = _stands(has_stayed, along, smaller_group, displacement_m)
    if not stands and _low_beside(cells[smaller_group], cells[~smaller_group], grid.depth_m.shape[1]):
        return None
    # Two heads are two bodies even if nothing farther is seen between them.
    wide = beyond is not None and _reach(along, smaller_group) > SINGLE_WIDTH_M
    if _hidden_between(grid, cells[smaller_group], cells[~smaller_group], wide):
        return None
    if not stands and _stands(has_stayed, along, ~smaller_group, displacement_m):
        smaller_group = ~smaller_group
    cut_off: NDArray[np.intp] = cells[smaller_group]
    return cut_off


@compiled(DepthGrid, "int32[:, ::1], int64")
def _from_above(grid: DepthGrid, labels: IntGrid, label: int) -> tuple[NDArray[np.intp], FloatArray, float]:
    """Flat cells (K,) with a label; how far right and ahead they are (2, K); the diagonal of their box."""
    height, width = labels.shape
    cells, count = np.empty(labels.size, np.intp), 0
    for i in range(height):
        for j in range(width):
            if labels[i, j] == label:
                cells[count] = i * width + j
                count += 1
    cells, points = cells[:count].copy(), np.empty((2, count))
    for k in range(count):
        i, j = cells[k] // width, cells[k] % width
        points[0, k], points[1, k] = grid.x[j] * grid.depth_m[i, j], grid.depth_m[i, j]
    if count == 0:
        return cells, points, 0.0
    return cells, points, math.hypot(points[0].max() - points[0].min(), points[1].max() - points[1].min())


def _stands(
    has_stayed: NDArray[np.bool_], along: FloatArray, group: NDArray[np.bool_], displacement_m: float
) -> bool:
    """Whether more of a group (K,) has stayed (K,) than if it had moved by displacement_m."""
    stays = np.count_nonzero(has_stayed[group]) / np.count_nonzero(group)
    left = min(displacement_m / max(float(np.ptp(along[group])), 0.1), 1.0)
    return bool(stays >= 1.0 - _STANDING * left)


def _reach(along: FloatArray, smaller_group: NDArray[np.bool_]) -> float:
    """Length of the longer of the two groups along the line."""
    return max(float(np.ptp(along[smaller_group])), float(np.ptp(along[~smaller_group])))


def _beyond_valley(
    points: FloatArray, along: FloatArray, low: float, high: float
) -> NDArray[np.bool_] | None:
    """(K,) the smaller group of points on one side of a valley; None: there is no valley.

    points (K, 2): seen from above. along (K,): their coordinates on the line, which low and high bound.
    """
    # A far cell stands for more surface than a near one.
    weight = np.square(points[:, 1])
    counts, edges = np.histogram(along, _BINS, (low, high), weights=weight)
    smooth = np.convolve(counts, [0.25, 0.5, 0.25], mode="same")
    valley = int(smooth[2:-2].argmin()) + 2
    left, right = smooth[:valley].max(), smooth[valley + 1 :].max()
    if smooth[valley] > _VALLEY * min(left, right):
        return None
    cut = 0.5 * (edges[valley] + edges[valley + 1])
    smaller_group = _fewer(along > cut)
    if np.count_nonzero(smaller_group) < _MIN_GROUP:
        return None
    apart_m = abs(median(along[smaller_group]) - median(along[~smaller_group]))
    return smaller_group if apart_m >= _PAIR_DISTANCE_M else None


def _second_head(grid: DepthGrid, cells: NDArray[np.intp]) -> NDArray[np.bool_] | None:
    """(K,) the smaller group of cells on one side of the dip between two heads; None: there are none.

    cells (K,): flat, in ascending order. People so close that their arms touch are still separate at the top.
    """
    row, column = np.divmod(cells, grid.depth_m.shape[1])
    column -= column.min()
    top = np.full(int(column.max()) + 1, len(grid.y) - 1, np.intp)
    top[column[::-1]] = row[::-1]  # the uppermost row of each column is written last and stays
    depth_m = median(grid.depth_m.ravel().take(cells))
    cell_m = float(grid.x[1] - grid.x[0]) * depth_m
    height_m: FloatArray = -grid.y.take(top).astype(float) * depth_m
    # A median over three columns, since one stray cell is no head.
    height_m[1:-1] = np.median((height_m[:-2], height_m[1:-1], height_m[2:]), axis=0)
    from_left, from_right = np.maximum.accumulate(height_m), np.maximum.accumulate(height_m[::-1])[::-1]
    dip_m = np.minimum(from_left, from_right) - height_m
    deepest_m = dip_m.max()
    if deepest_m < _DIP_M + cell_m:
        return None
    # The middle of all columns that are about as low.
    low = (dip_m >= deepest_m - cell_m).nonzero()[0]
    valley = int(low[len(low) // 2])
    one, other = int(height_m[:valley].argmax()), valley + int(height_m[valley:].argmax())
    if not _MIN_APART_M <= (other - one) * cell_m <= _MAX_APART_M:
        return None
    for head in (one, other):
        width_m = _width_below(height_m, head, _HEAD_M) * cell_m
        shoulders_m = _width_below(height_m, head, _SHOULDERS_M) * cell_m
        if not _MIN_HEAD_M - cell_m <= width_m <= _MAX_HEAD_M + cell_m:
            return None
        if shoulders_m < width_m + _MIN_HEAD_M:
            return None
    smaller_group = _fewer(column > valley)
    return smaller_group if np.count_nonzero(smaller_group) >= _MIN_GROUP else None


def _width_below(height_m: FloatArray, head: int, drop_m: float) -> int:
    """Number of adjacent columns around column head that are at most drop_m lower than it."""
    high = height_m >= height_m[head] - drop_m
    right = len(high) if high[head:].all() else head + int(high[head:].argmin())
    left = 0 if high[: head + 1].all() else head + 1 - int(high[head::-1].argmin())
    return right - left


def _fewer(chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(K,) chosen or its complement, whichever has fewer entries."""
    return ~chosen if np.count_nonzero(chosen) * 2 > len(chosen) else chosen


def _low_beside(small: NDArray[np.intp], large: NDArray[np.intp], width: int) -> bool:
    """Whether a small group of flat cells is much less tall in the image than the large one."""
    return bool(np.ptp(small // width) + 1 <= _LOW_BESIDE * (np.ptp(large // width) + 1))


def _seen_through(small: NDArray[np.intp], large: NDArray[np.intp], width: int) -> bool:
    """Whether a small group of flat cells is low and mostly within the image box of the large one.

    So are the far wheels of a cart that are seen under it.
    """
    (top, left), (bottom, right) = (edge(np.divmod(large, width), axis=1) for edge in (np.min, np.max))
    row, column = np.divmod(small, width)
    if np.ptp(row) + 1 > SEEN_THROUGH_HEIGHT * (bottom - top + 1):
        return False
    inside = (row >= top) & (row <= bottom) & (column >= left) & (column <= right)
    return bool(np.count_nonzero(inside) >= SEEN_THROUGH_SHARE * len(small))


def _hidden_between(grid: DepthGrid, one: NDArray[np.intp], other: NDArray[np.intp], wide: bool) -> bool:
    """Whether something nearer fills most of the image between two groups of flat cells.

    Then the valley is what hides the middle of one body. wide: the same holds if hardly anything farther is
    seen there.
    """
    width = grid.depth_m.shape[1]
    left, right = (one, other) if median(one % width) < median(other % width) else (other, one)
    first, last = int(quantile(left % width, 0.9)) + 1, int(quantile(right % width, 0.1))
    if last <= first:
        return False
    top, last_row = quantiles(np.concatenate((one, other)) // width, (0.25, 0.75))
    inverse, inside = grid.inverse_depth, (slice(int(top), int(last_row) + 1), slice(first, last))
    between = inverse[inside]
    nearest = max(float(median(inverse.ravel()[one])), float(median(inverse.ravel()[other])))
    nearer = np.count_nonzero(between > nearest + NEARER_INVERSE)
    farther = (between > 0.0) & (between < nearest - NEARER_INVERSE)
    unseen = np.count_nonzero(farther | grid.beyond[inside]) <= _NOTHING_SEEN_SHARE * between.size
    return bool(nearer >= 0.5 * between.size or (wide and unseen))
