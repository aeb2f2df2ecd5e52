"""Parts: connected components of the cells that stand out of the floor, separated at jumps in depth.

above_floor selects the cells, components labels the parts. Terms: vision/__init__.py.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled, inlined
from vision.depth.depth_grid import BoolGrid, DepthGrid, FloatGrid
from vision.numerics.order import median_of_positive

IntGrid = NDArray[np.int32]

# Bounds of the step in inverse depth (1/m) between two cells that counts as a jump.
MIN_JUMP = 0.006  # 0.15 m at 5 m: a smaller step is noise
MAX_JUMP = 0.03  # the depth of a body at 3 m: a larger step is a jump even on a slope
_USUAL_STEPS = 12.0  # between the bounds, a jump is this many times the median step from cell to cell
# What stands out of the floor is higher than the clearance by this many standard deviations of its height and
# by an error of the tilt of half a degree.
_HEIGHT_SIGMAS, _TILT_RAD = np.float32(3.0), np.float32(0.008)
MIN_PART_CELLS = 6  # parts with fewer cells are speckles: wrong stereo matches


def above_floor(grid: DepthGrid, clearance_m: float) -> BoolGrid:
    """(h, w) cells higher above the floor than clearance_m plus the noise of height and the error of tilt.

    Every valid cell where the floor is not known.
    """
    if grid.height_m is None or grid.height_sigma_m is None:
        return grid.valid
    return _above_floor(grid.valid, grid.depth_m, grid.height_m, grid.height_sigma_m, np.float32(clearance_m))


@compiled("boolean[:, ::1], float32[:, ::1], float32[:, ::1], float32[:, ::1], float32")
def _above_floor(
    valid: BoolGrid, depth_m: FloatGrid, height_m: FloatGrid, sigma_m: FloatGrid, clearance_m: np.float32
) -> BoolGrid:
    result = np.empty(valid.shape, np.bool_)
    for i in range(valid.shape[0]):
        for j in range(valid.shape[1]):
            margin_m = clearance_m + _HEIGHT_SIGMAS * sigma_m[i, j] + _TILT_RAD * depth_m[i, j]
            result[i, j] = valid[i, j] and height_m[i, j] > margin_m
    return result


def components(grid: DepthGrid, mask: BoolGrid) -> tuple[int, IntGrid]:
    """Connected parts of mask, separated at jumps in depth: their number, and labels (h, w), 0 for none.

    Jumps are measured in inverse depth, in which the noise of a stereo camera is constant. Only the cell on
    the far side of a jump is removed, so that a pole one cell wide stays whole.
    """
    kept = _without_jumps(grid.inverse_depth, mask)
    # Counting the cells ourselves takes a fraction of the time of OpenCV's own statistics.
    count, found = cv2.connectedComponents(kept, connectivity=4)
    return _without_speckles(np.asarray(found, np.int32), count)


@inlined
def _usual_step(inverse: FloatGrid, mask: BoolGrid) -> float:
    """Median step in inverse depth between neighbouring cells of mask, in every second row; 0 without any."""
    height, width = inverse.shape
    steps = np.empty(((height + 1) // 2) * width, np.float32)
    count = 0
    for i in range(0, height, 2):
        for j in range(width - 1):
            if mask[i, j] and mask[i, j + 1]:
                steps[count] = abs(inverse[i, j + 1] - inverse[i, j])
                count += 1
    return median_of_positive(steps[:count]) if count > 0 else 0.0


@compiled("float32[:, ::1], boolean[:, ::1]")
def _without_jumps(inverse: FloatGrid, mask: BoolGrid) -> NDArray[np.uint8]:
    """(h, w) 1 in the cells of mask, except for those on the far side of a jump."""
    usual = _USUAL_STEPS * _usual_step(inverse, mask)
    jump = np.float32(min(max(usual, MIN_JUMP), MAX_JUMP))
    height, width = inverse.shape
    kept = np.zeros((height, width), np.uint8)
    for i in range(height):
        for j in range(width):
            if not mask[i, j]:
                continue
            here = inverse[i, j]
            far_side = j + 1 < width and inverse[i, j + 1] - here > jump
            far_side |= j > 0 and inverse[i, j - 1] - here > jump
            far_side |= i + 1 < height and inverse[i + 1, j] - here > jump
            far_side |= i > 0 and inverse[i - 1, j] - here > jump
            kept[i, j] = not far_side
    return kept


@inlined
def _cell_counts(labels: IntGrid, count: int) -> NDArray[np.int64]:
    """(count,) number of cells of each label, summed up by runs of the same label in a row."""
    height, width = labels.shape
    cells = np.zeros(count, np.int64)
    for i in range(height):
        start = 0
        for j in range(1, width):
            if labels[i, j] != labels[i, start]:
                cells[labels[i, start]] += j - start
                start = j
        cells[labels[i, start]] += width - start
    return cells


@compiled("int32[:, ::1], int64")
def _without_speckles(labels: IntGrid, count: int) -> tuple[int, IntGrid]:
    """n, and labels (h, w) renumbered 1..n in their order, without speckles. count: labels, with 0."""
    cells = _cell_counts(labels, count)
    number, parts = np.zeros(count, np.int32), 0
    for label in range(1, len(cells)):
        if cells[label] >= MIN_PART_CELLS:
            parts += 1
            number[label] = parts
    result = np.empty(labels.shape, np.int32)
    for i in range(labels.shape[0]):
        for j in range(labels.shape[1]):
            result[i, j] = number[labels[i, j]]
    return parts, result


def spread_labels(labels: IntGrid, mask: BoolGrid) -> IntGrid:
    """labels (h, w) with each unlabelled (0) cell of mask given the label of the nearest labelled cell."""
    owned = labels > 0
    if not owned.any():
        return labels
    # The bounding box of all cells involved suffices: it holds every labelled cell.
    u, v, width, height = cv2.boundingRect((mask | owned).view(np.uint8))
    box = slice(v, v + height), slice(u, u + width)
    inner, owned = labels[box], owned[box]
    _, found = cv2.distanceTransformWithLabels(
        (~owned).view(np.uint8), cv2.DIST_L2, 3, labelType=cv2.DIST_LABEL_PIXEL
    )
    nearest: IntGrid = np.asarray(found, np.int32)
    table = np.zeros(int(nearest.max()) + 1, np.int32)
    table[nearest[owned]] = inner[owned]
    result = labels.copy()
    result[box] = np.where(mask[box] & ~owned, table.take(nearest), inner)
    return result
