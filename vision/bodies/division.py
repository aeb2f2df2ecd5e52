"""Two bodies in one part of connected depth, such as two people who walk side by side: where to divide it.

Terms (cell, part, body): vision/__init__.py.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray
from vision.depth.connected import IntGrid
from vision.depth.depth_grid import BoolGrid, DepthGrid
from vision.numerics.order import median, quantile, quantiles

SINGLE_WIDTH_M = 0.85  # nobody is wider
NEARER_INVERSE = 0.02  # 1/m, of what stands before a body
_PAIR_DISTANCE_M = 0.5  # shoulder to shoulder, middle to middle: bodies cannot be closer side by side
_VALLEY = 0.35  # of the lower hill: so little is left between two bodies; arms touch
WITHIN = 0.9  # of a group of cells: it is seen through another one
LOW_BESIDE = 0.6  # of the height of a body in the image: a trolley is, a child beside an adult is not
_STANDING = 0.5  # of the share that would not have stayed
LOW = 0.5  # of the height of that in the image; somebody behind somebody else is taller
_DIP_M = 0.15  # between two heads; a shoulder is lower still
# Of a head, so much from its top down: a load is wider, a post narrower and has no shoulders.
_HEAD_M, _LEAST_HEAD_M, _HEAD_WIDTH_M, _SHOULDERS_M = 0.15, 0.13, 0.30, 0.36
_LEAST_APART_M, _MOST_APART_M = 0.35, 0.8  # two heads; who walks farther apart leaves a valley
_HARDLY = 0.2  # of the image between two groups of cells
_MIN_CELLS = 24  # of either of two: twice what a track begins with, for each half is to be judged by itself
_BINS = 12  # along the line: a tenth of a metre each where two people walk side by side


def split(
    grid: DepthGrid, labels: IntGrid, track: int, stayed: BoolGrid, way_m: float
) -> NDArray[np.intp] | None:
    """Flat cells of labels == track + 1 that belong to a second body, the smaller one; None: it is one.

    The cells are laid along the line on which they spread most (seen from above). Two people leave a
    valley in between; a crate, however wide, does not, and where something nearer fills it, it is none. Nor
    is it one beside a piece that is too wide for anybody, where nothing is seen in it, unless there are two
    heads: then it is two, with or without a valley. What is seen through the larger group is no second body
    either. Nor is what is low beside it, a trolley before who pushes it, unless it stands: more of it has
    stayed (h, w) where it was than if it had gone way_m with the track.
    """
    cells = (labels.ravel() == track + 1).nonzero()[0]
    if len(cells) < 2 * _MIN_CELLS:
        return None
    points = grid.points(cells)[::2].T.astype(float)
    if np.hypot(*(points.max(axis=0) - points.min(axis=0))) < SINGLE_WIDTH_M:
        return None  # as is most, whichever line they are laid along
    centred = points - median(points.T)
    _, axes = np.linalg.eigh(centred.T @ centred)
    along = centred @ axes[:, 1]
    low, high = quantiles(along, (0.03, 0.97))
    if high - low < SINGLE_WIDTH_M:
        return None
    beyond = _beyond_valley(points, along, low, high)
    second = _second_head(grid, cells) if beyond is None else beyond
    if second is None:
        return None
    if _seen_through(cells[second], cells[~second], grid.depth_m.shape[1]):
        return None
    stays = np.count_nonzero(stayed.ravel().take(cells[second])) / np.count_nonzero(second)
    stands = stays >= 1.0 - _STANDING * min(way_m / max(float(np.ptp(along[second])), 0.1), 1.0)
    if not stands and _low_beside(cells[second], cells[~second], grid.depth_m.shape[1]):
        return None
    # Two heads are two bodies, however little is seen between these.
    wide = beyond is not None and _reach(along, second) > SINGLE_WIDTH_M
    if _hidden_between(grid, cells[second], cells[~second], wide):
        return None
    cut_off: NDArray[np.intp] = cells[second]
    return cut_off


def _reach(along: FloatArray, second: NDArray[np.bool_]) -> float:
    """How far the longer of two groups reaches."""
    return max(float(np.ptp(along[second])), float(np.ptp(along[~second])))


def _beyond_valley(
    points: FloatArray, along: FloatArray, low: float, high: float
) -> NDArray[np.bool_] | None:
    """(K,) which of points (K, 2), seen from above, along (K,) their line, are beyond a valley, the fewer;
    None: there is none."""
    # A far cell stands for more surface than a near one.
    weight = np.square(points[:, 1])
    counts, edges = np.histogram(along, _BINS, (low, high), weights=weight)
    smooth = np.convolve(counts, [0.25, 0.5, 0.25], mode="same")
    valley = int(smooth[2:-2].argmin()) + 2
    left, right = smooth[:valley].max(), smooth[valley + 1 :].max()
    if smooth[valley] > _VALLEY * min(left, right):
        return None
    cut = 0.5 * (edges[valley] + edges[valley + 1])
    second = _fewer(along > cut)
    if np.count_nonzero(second) < _MIN_CELLS:
        return None
    apart_m = abs(median(along[second]) - median(along[~second]))
    return second if apart_m >= _PAIR_DISTANCE_M else None


def _second_head(grid: DepthGrid, cells: NDArray[np.intp]) -> NDArray[np.bool_] | None:
    """(K,) which of flat cells (K,), in rising order, are beside a dip between two heads, the fewer; None:
    there are no two. People who walk so close that their arms touch are still two at the top."""
    row, column = np.divmod(cells, grid.depth_m.shape[1])
    column -= column.min()
    top = np.full(int(column.max()) + 1, len(grid.y) - 1, np.intp)
    top[column[::-1]] = row[::-1]  # what is written last stays
    depth_m = median(grid.depth_m.ravel().take(cells))
    cell_m = float(grid.x[1] - grid.x[0]) * depth_m
    height_m: FloatArray = -grid.y.take(top).astype(float) * depth_m
    # One stray cell is no head.
    height_m[1:-1] = np.median((height_m[:-2], height_m[1:-1], height_m[2:]), axis=0)
    from_left, from_right = np.maximum.accumulate(height_m), np.maximum.accumulate(height_m[::-1])[::-1]
    dip_m = np.minimum(from_left, from_right) - height_m
    deepest_m = dip_m.max()
    if deepest_m < _DIP_M + cell_m:
        return None
    # In the middle of what is about as low.
    low = (dip_m >= deepest_m - cell_m).nonzero()[0]
    valley = int(low[len(low) // 2])
    one, other = int(height_m[:valley].argmax()), valley + int(height_m[valley:].argmax())
    if not _LEAST_APART_M <= (other - one) * cell_m <= _MOST_APART_M:
        return None
    for head in (one, other):
        width_m = _width_below(height_m, head, _HEAD_M) * cell_m
        shoulders_m = _width_below(height_m, head, _SHOULDERS_M) * cell_m
        if not _LEAST_HEAD_M - cell_m <= width_m <= _HEAD_WIDTH_M + cell_m:
            return None
        if shoulders_m < width_m + _LEAST_HEAD_M:
            return None
    second = _fewer(column > valley)
    return second if np.count_nonzero(second) >= _MIN_CELLS else None


def _width_below(height_m: FloatArray, head: int, drop_m: float) -> int:
    """How many columns around head are at most drop_m lower."""
    high = height_m >= height_m[head] - drop_m
    right = len(high) if high[head:].all() else head + int(high[head:].argmin())
    left = 0 if high[: head + 1].all() else head + 1 - int(high[head::-1].argmin())
    return right - left


def _fewer(chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(K,) chosen, or the others, whichever are fewer."""
    return ~chosen if np.count_nonzero(chosen) * 2 > len(chosen) else chosen


def _low_beside(small: NDArray[np.intp], large: NDArray[np.intp], width: int) -> bool:
    """Whether a small group of flat cells is much lower in the image than the large one."""
    return bool(np.ptp(small // width) + 1 <= LOW_BESIDE * (np.ptp(large // width) + 1))


def _seen_through(small: NDArray[np.intp], large: NDArray[np.intp], width: int) -> bool:
    """Whether a small group of flat cells is low and mostly within the image box of the large one, as the far
    wheels of a cart are that are seen under it."""
    (top, left), (bottom, right) = (edge(np.divmod(large, width), axis=1) for edge in (np.min, np.max))
    row, column = np.divmod(small, width)
    if np.ptp(row) + 1 > LOW * (bottom - top + 1):
        return False
    inside = (row >= top) & (row <= bottom) & (column >= left) & (column <= right)
    return bool(np.count_nonzero(inside) >= WITHIN * len(small))


def _hidden_between(grid: DepthGrid, one: NDArray[np.intp], other: NDArray[np.intp], wide: bool) -> bool:
    """Whether something nearer fills most of the image between two groups of flat cells: then the valley
    there is what hides the middle of one body. wide: so it is, too, if hardly anything is seen there."""
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
    unseen = np.count_nonzero(farther | grid.beyond[inside]) <= _HARDLY * between.size
    return bool(nearer >= 0.5 * between.size or (wide and unseen))
