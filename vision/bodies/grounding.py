"""Extension of movers down to the floor: a mover that was cut out of a larger surface stands on the floor.

For a person close to a wall, depth and fragments show motion at the head or the hands first. But a moving
body does not hover: the cells below it, connected and at the same depth, are the rest of it. This step gives
them to the mover. Terms: vision/__init__.py.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise
from hal.compiled import compiled
from vision.bodies.sizes import SAME_BODY_M, SAME_BODY_SIGMAS
from vision.depth.connected import IntGrid
from vision.depth.depth_grid import DepthGrid
from vision.depth.regions import Regions, exchanged, measure
from vision.numerics.order import median_of

_MIN_GAIN_M = 0.2  # minimum gain in height: less is only the rim of the cells that were found already
_LOWEST = 4  # the lowest quarter of a mover's rows gives the depth at which it reaches down


def extend_to_floor(
    grid: DepthGrid,
    labels: IntGrid,
    measured: Regions,
    chosen: NDArray[np.bool_],
    mover: NDArray[np.bool_],
    noise: DepthNoise,
) -> tuple[IntGrid, Regions]:
    """Give the static cells below the tracks chosen (T,) to them, at their depth and without a gap.

    Returns labels (h, w), track index + 1, with these cells, and the regions with the chosen tracks measured
    anew. measured: regions of labels. mover (T,): tracks that lose no cells. The static tracks keep their
    measures, since the cells may be theirs after all.

    The same objects are returned where there is nothing to give, and where the floor is not known: then the
    floor itself would count as cells below.
    """
    if grid.height_m is None:
        return labels, measured
    standing = np.concatenate(([False], ~mover))
    result, grown = labels, np.zeros(len(mover), np.bool_)
    for track in (chosen & (measured.cells > 0)).nonzero()[0].tolist():
        below = _below(grid, labels, track + 1, standing, noise)
        if len(below):
            result = labels.copy() if result is labels else result
            result.ravel()[below] = track + 1
            grown[track] = True
    if result is labels:
        return labels, measured
    return result, exchanged(measured, measure(grid, result, len(mover)), grown)


@compiled(DepthGrid, "int32[:, ::1], int64, boolean[::1]", DepthNoise)
def _below(
    grid: DepthGrid, labels: IntGrid, label: int, standing: NDArray[np.bool_], noise: DepthNoise
) -> NDArray[np.intp]:
    """Flat cells below those with label that belong to it, column by column.

    standing: for each label, whether cells may be taken from it.
    """
    (height, width), depth_m = labels.shape, grid.depth_m
    # Its first and last row, and its lowest row in each column.
    top, bottom, foot = height, -1, np.full(width, height, np.intp)
    for i in range(height):
        for j in range(width):
            if labels[i, j] == label:
                top, bottom, foot[j] = min(top, i), i, i
    taken = np.empty(height * width, np.intp)
    if bottom < 0:
        return taken[:0]
    lowest_rows = slice(bottom - (bottom - top + 1) // _LOWEST, bottom + 1)
    own_m = median_of(depth_m[lowest_rows].ravel()[labels[lowest_rows].ravel() == label])
    same_m = np.float32(SAME_BODY_M + SAME_BODY_SIGMAS * noise.quadratic_per_m * own_m * own_m)
    count, lowest = 0, 0
    for j in range(width):
        for i in range(foot[j] + 1, height):
            found_m, there = depth_m[i, j], labels[i, j]
            if abs(found_m - own_m) > same_m:
                # Another depth separates the two; a cell without data, or at the rim of a jump, does not.
                if found_m > 0.0:
                    break
            elif there > 0 and standing[there]:
                taken[count] = i * width + j
                count, lowest = count + 1, max(lowest, i)
    # The lowest cell of all columns counts: it may stand on one foot only.
    if (grid.y[lowest] - grid.y[bottom]) * own_m < np.float32(_MIN_GAIN_M):
        return taken[:0]
    return taken[:count]
