"""Which cells of the depth grid belong to which obstacle: the nearest fragment decides, depth must agree."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise
from hal.types import FloatArray
from vision.depth_grid import BoolGrid, DepthGrid
from vision.depth_mask import depth_sigma_m

IntGrid = NDArray[np.int32]
_NOTHING = -1
_REACH_M = 0.45
_DEPTH_REACH_M = 0.35
_SHARE = 0.6


@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """What one obstacle covers: bbox_px (u0, v0, u1, v1), position_m (3,), extent_m (3,), cells.

    touches_border: it may go on outside of the image."""

    bbox_px: tuple[float, float, float, float]
    position_m: FloatArray
    extent_m: FloatArray
    cells: int
    touches_border: bool


def standing(grid: DepthGrid, clearance_m: float) -> BoolGrid:
    """(h, w) cells that stand out of the floor; every valid cell where the mounting is not known."""
    if grid.height_m is None or grid.height_sigma_m is None:
        return grid.valid
    margin = clearance_m + 3.0 * grid.height_sigma_m + np.float32(0.008) * grid.depth_m
    result: BoolGrid = grid.valid & (grid.height_m > margin)
    return result


def components(grid: DepthGrid, mask: BoolGrid) -> tuple[int, IntGrid, NDArray[np.int32]]:
    """Connected parts of mask, parted where depth jumps: count, labels (h, w) with 0 for none, and the
    statistics of cv2.connectedComponentsWithStats.

    Depth noise of a stereo camera is constant in inverse depth, so that is where a jump is measured. The
    far side of a jump is taken out, so that a pole one cell wide stays whole.
    """
    with np.errstate(divide="ignore"):
        inverse = np.where(grid.valid, 1.0 / grid.depth_m, np.float32(0.0)).astype(np.float32)
    across = inverse[:, 1:] - inverse[:, :-1]
    down = inverse[1:] - inverse[:-1]
    pairs = mask[:, 1:] & mask[:, :-1]
    typical = float(np.median(np.abs(across[pairs]))) if pairs.any() else 0.0
    jump = float(np.clip(8.0 * typical, 0.008, 0.03))
    cut = np.zeros_like(mask)
    cut[:, 1:] |= across < -jump
    cut[:, :-1] |= across > jump
    cut[1:] |= down < -jump
    cut[:-1] |= down > jump
    kept = (mask & ~cut).astype(np.uint8)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(kept, connectivity=4)
    return count, np.asarray(labels, np.int32), np.asarray(stats, np.int32)


def claim(
    grid: DepthGrid,
    mask: BoolGrid,
    ends_px: FloatArray,
    depth_m: FloatArray,
    owner: NDArray[np.intp],
    focal_px: float,
    noise: DepthNoise,
) -> IntGrid:
    """(h, w) owner of each cell of mask: that of the nearest end within reach whose depth agrees; -1: none.

    ends_px (N, 2), depth_m (N,), owner (N,) with -1 for static fragments.
    """
    result = np.full(mask.shape, _NOTHING, np.int32)
    if len(ends_px) == 0:
        return result
    columns, rows = grid.columns(ends_px[:, 0]), grid.rows(ends_px[:, 1])
    # Later writes win a shared cell: those of obstacles come last.
    order = np.argsort(owner, kind="stable")
    seeds = np.ones(mask.shape, np.uint8)
    seeds[rows, columns] = 0
    index = np.zeros(mask.shape, np.intp)
    index[rows[order], columns[order]] = order
    distance, label = cv2.distanceTransformWithLabels(seeds, cv2.DIST_L2, 3, labelType=cv2.DIST_LABEL_PIXEL)
    table = np.zeros(int(label.max()) + 1, np.intp)
    table[label[rows, columns]] = index[rows, columns]
    nearest = table[label]
    there_m = depth_m[nearest]
    gate_m = _DEPTH_REACH_M + 2.0 * depth_sigma_m(there_m, noise)
    near_enough = distance * grid.step_px <= _REACH_M * focal_px / there_m
    agrees = near_enough & (np.abs(grid.depth_m - there_m) <= gate_m) & mask
    result[agrees] = owner[nearest[agrees]]
    return result


def absorb(claimed: IntGrid, labels: IntGrid, count: int, obstacles: int) -> IntGrid:
    """Give whole depth components to the obstacle that claims most of what was claimed of them.

    A component of which a good part is claimed by static fragments stays divided.
    """
    if obstacles == 0 or count <= 1:
        return claimed
    owned = claimed >= 0
    flat = labels[owned].astype(np.intp) * obstacles + claimed[owned]
    votes = np.bincount(flat, minlength=count * obstacles).reshape(count, obstacles)
    size = np.bincount(labels.ravel(), minlength=count)
    best = votes.argmax(axis=1)
    won = votes[np.arange(count), best] >= _SHARE * np.maximum(size, 1)
    won[0] = False
    gift = np.where(won, best, _NOTHING).astype(np.int32)
    result = claimed.copy()
    take = won[labels]
    result[take] = gift[labels[take]]
    return result


def measure(grid: DepthGrid, cells: BoolGrid) -> Region | None:
    """Box and centre of the visible surface of cells (h, w); None where there are too few."""
    rows, columns = np.nonzero(cells)
    if len(rows) < 4:
        return None
    depth = grid.depth_m[rows, columns].astype(float)
    middle = float(np.median(depth))
    low, high = np.percentile(depth, (10, 90))
    x = float(grid.x[columns].mean()) * middle
    y = float(grid.y[rows].mean()) * middle
    left, right = int(columns.min()), int(columns.max())
    top, bottom = int(rows.min()), int(rows.max())
    step, half = grid.step_px, 0.5 * grid.step_px
    first, last = grid.offset_px - half, grid.offset_px + half
    bbox = (left * step + first, top * step + first, right * step + last, bottom * step + last)
    extent = np.array(
        [
            float(grid.x[right] - grid.x[left]) * middle,
            float(grid.y[bottom] - grid.y[top]) * middle,
            float(high - low),
        ]
    )
    height, width = cells.shape
    border = left == 0 or top == 0 or right == width - 1 or bottom == height - 1
    return Region(bbox, np.array([x, y, middle]), extent, len(rows), border)
