"""What moves stands on the floor: a mover cut out of something larger reaches down as far as that does.

Depth tells a person close to a wall from it at the head or at the hands first, and fragments are where there
are edges. What is connected below, at the same depth, is the rest of the body: nothing that goes hovers.
Terms: vision/__init__.py.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled, inlined
from vision.depth.connected import IntGrid
from vision.depth.depth_grid import DepthGrid, FloatGrid
from vision.depth.regions import Regions, exchanged, measure

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
        below = _below(grid.depth_m, grid.y, labels, track + 1, standing)
        if len(below):
            result = labels.copy() if result is labels else result
            result.ravel()[below] = track + 1
            grown[track] = True
    if result is labels:
        return labels, measured
    return result, exchanged(measured, measure(grid, result, len(mover)), grown)


@inlined
def _median_depth_m(depth_m: FloatGrid, labels: IntGrid, label: int, first: int, last: int) -> np.float32:
    """Of the cells with that label in rows first to last, of which there is one at least."""
    found_m = np.sort(depth_m[first : last + 1].ravel()[labels[first : last + 1].ravel() == label])
    middle = len(found_m) // 2
    odd = len(found_m) % 2 == 1
    result: np.float32 = found_m[middle] if odd else np.float32(0.5) * (found_m[middle - 1] + found_m[middle])
    return result


@compiled("float32[:, ::1], float32[::1], int32[:, ::1], int64, boolean[::1]")
def _below(
    depth_m: FloatGrid, ray_y: FloatGrid, labels: IntGrid, label: int, standing: NDArray[np.bool_]
) -> NDArray[np.intp]:
    """Flat cells below those with that label that belong to them, column by column. standing: of the labels,
    whether cells may be taken from them."""
    height, width = labels.shape
    # The rows it is in; in each of its columns the lowest row of its own.
    top, bottom, foot = height, -1, np.full(width, height, np.intp)
    for i in range(height):
        for j in range(width):
            if labels[i, j] == label:
                top, bottom, foot[j] = min(top, i), i, i
    taken = np.empty(height * width, np.intp)
    if bottom < 0:
        return taken[:0]
    own_m = _median_depth_m(depth_m, labels, label, bottom - (bottom - top + 1) // _LOWEST, bottom)
    same_m = np.float32(_SAME_M + _SAME_PER_M2 * own_m * own_m)
    count, lowest = 0, 0
    for j in range(width):
        for i in range(foot[j] + 1, height):
            found_m, there = depth_m[i, j], labels[i, j]
            if abs(found_m - own_m) > same_m:
                # Without data, or on the rim of a jump in depth, nothing parts them.
                if found_m > 0.0:
                    break
            elif there > 0 and standing[there]:
                taken[count] = i * width + j
                count, lowest = count + 1, max(lowest, i)
    # It may stand with one foot, and has no more feet than it shows.
    if (ray_y[lowest] - ray_y[bottom]) * own_m < np.float32(_HOVERS_M):
        return taken[:0]
    return taken[:count]
