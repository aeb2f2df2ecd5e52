"""What moves stands on the floor: a mover cut out of something larger reaches down as far as that does.

Depth tells a person close to a wall from it at the head or at the hands first, and fragments are where there
are edges. What is connected below, at the same depth, is the rest of the body: nothing that goes hovers.
Terms: vision/__init__.py.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vision.depth.connected import IntGrid
from vision.depth.depth_grid import DepthGrid
from vision.depth.regions import Regions, exchanged, measure
from vision.numerics.order import median

_SAME_M = 0.3  # about a body's depth, and
_SAME_PER_M2 = 0.015  # two sigmas of depth by the default noise
_HOVERS_M = 0.2  # what reaches no farther down is the rim of what was found already
_LOWEST = 4  # one in so many of its rows, the lowest: what reaches down does so at their depth


def ground(
    grid: DepthGrid, labels: IntGrid, measured: Regions, chosen: NDArray[np.bool_], mover: NDArray[np.bool_]
) -> tuple[IntGrid, Regions]:
    """labels (h, w), track index + 1, with what stands below the tracks chosen (T,), at their depth and not
    parted from them, given to them, and what they measure with that. mover (T,): keep what is theirs.

    measured: of labels. What stands there measures what it did: these cells may be its own, after all. The
    same labels and measures come back where there is nothing to give, as where the floor is not known: then
    all of it would be below.
    """
    if grid.height_m is None:
        return labels, measured
    standing = np.concatenate(([False], ~mover))
    result, grown = labels, np.zeros(len(mover), np.bool_)
    for track in (chosen & (measured.cells > 0)).nonzero()[0].tolist():
        below = _below(grid, labels, track, standing)
        if below is not None:
            result = labels.copy() if result is labels else result
            result.ravel()[below] = track + 1
            grown[track] = True
    if result is labels:
        return labels, measured
    return result, exchanged(measured, measure(grid, result, len(mover)), grown)


def _below(
    grid: DepthGrid, labels: IntGrid, track: int, standing: NDArray[np.bool_]
) -> NDArray[np.intp] | None:
    """Flat cells below those labelled track + 1 that belong to it, column by column; None: there are none."""
    cells = np.flatnonzero(labels == track + 1)
    rows = cells // labels.shape[1]
    columns = cells - rows * labels.shape[1]
    top, bottom, left, right = int(rows[0]), int(rows[-1]), int(columns.min()), int(columns.max()) + 1
    lowest = cells[rows >= bottom - (bottom - top + 1) // _LOWEST]
    depth_m = float(median(grid.depth_m.ravel().take(lowest)))
    # In each of its columns the lowest row of its own, which is written last.
    foot = np.full(right - left, len(labels), np.intp)
    foot[columns - left] = rows
    box = slice(top, None), slice(left, right)
    under = np.arange(top, len(labels))[:, None] > foot
    there, found_m = labels[box], grid.depth_m[box]
    same = np.abs(found_m - depth_m) <= _SAME_M + _SAME_PER_M2 * depth_m * depth_m
    # Without data, or on the rim of a jump in depth, nothing parts them.
    parts = under & ~same & (found_m > 0.0)
    taken = under & same & standing.take(there) & (there > 0) & ~np.logical_or.accumulate(parts, axis=0)
    if not taken.any():
        return None
    row, column = np.nonzero(taken)
    # It may stand with one foot, and has no more feet than it shows.
    if (grid.y[int(row.max()) + top] - grid.y[bottom]) * depth_m < _HOVERS_M:
        return None
    flat: NDArray[np.intp] = (row + top) * labels.shape[1] + column + left
    return flat
