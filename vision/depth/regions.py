"""Connected depth: the parts of the view that stand out of the floor, and what each of them measures.

Terms (cell, part, region): vision/__init__.py.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray
from vision.depth.depth_grid import BoolGrid, DepthGrid
from vision.numerics.order import median

IntGrid = NDArray[np.int32]

# 1/m: 0.15 m at 5 m, below which it is noise; a body's depth at 3 m, above which a slope is no excuse.
_LEAST_JUMP = 0.006
_MOST_JUMP = 0.03
_SPECKLE_CELLS = 6  # fewer are taken for wrong matches of a stereo camera
_UNIFORM = 3.46  # a uniform spread is this many standard deviations long
_FOOT_M, _FOOT_PER_METRE = 0.12, 0.015  # taken for floor: standing()'s clearance and margins
_OCCLUDED_SHARE = 0.15  # of its rows: at fewer rims it is noise that is nearer
_GAP_CELLS = 3  # beside what is nearer a stereo camera measures nothing for some cells
_HIDDEN_SHARE = 0.5  # of its width: else some of its lower end is seen, and ends there
_HEAD_M = 0.2  # a head to the chin: less is a strip of something
_RIM = 8  # one in so many columns of a part is its rim, on either side


@dataclass(frozen=True, slots=True, eq=False)
class Regions:
    """What R labelled parts of the grid measure; entries without cells have cells == 0.

    cells (R,). rows (R,) of the grid that they reach over. bbox_px (R, 4): u0, v0, u1, v1. position_m (R, 3):
    centre of the visible surface. extent_m (R, 3). wide (R,): not cut by the image's left or right border,
    tall (R,): nor above or below. overlapped (R,): by something nearer, seen from its side.
    """

    cells: NDArray[np.intp]
    rows: NDArray[np.intp]
    bbox_px: FloatArray
    position_m: FloatArray
    extent_m: FloatArray
    wide: NDArray[np.bool_]
    tall: NDArray[np.bool_]
    overlapped: NDArray[np.bool_]

    @property
    def whole(self) -> NDArray[np.bool_]:
        """(R,) parts that are cut on no side, and of which nothing nearer hides any."""
        return self.wide & self.tall & ~self.overlapped


def exchanged(regions: Regions, others: Regions, chosen: NDArray[np.bool_]) -> Regions:
    """regions, where chosen (R,) those of others."""
    return Regions(
        cells=np.where(chosen, others.cells, regions.cells),
        rows=np.where(chosen, others.rows, regions.rows),
        bbox_px=np.where(chosen[:, None], others.bbox_px, regions.bbox_px),
        position_m=np.where(chosen[:, None], others.position_m, regions.position_m),
        extent_m=np.where(chosen[:, None], others.extent_m, regions.extent_m),
        wide=np.where(chosen, others.wide, regions.wide),
        tall=np.where(chosen, others.tall, regions.tall),
        overlapped=np.where(chosen, others.overlapped, regions.overlapped),
    )


def standing(grid: DepthGrid, clearance_m: float) -> BoolGrid:
    """(h, w) cells that stand out of the floor; every valid cell where the floor is not known."""
    if grid.height_m is None or grid.height_sigma_m is None:
        return grid.valid
    margin = (
        np.float32(clearance_m) + np.float32(3.0) * grid.height_sigma_m + np.float32(0.008) * grid.depth_m
    )
    result: BoolGrid = grid.valid & (grid.height_m > margin)
    return result


def components(grid: DepthGrid, mask: BoolGrid) -> tuple[int, IntGrid]:
    """Connected parts of mask, parted where depth jumps: how many, and labels (h, w), 0 for none.

    Depth noise of a stereo camera is constant in inverse depth, so that is where a jump is measured. The
    far side of a jump is taken out, so that a pole one cell wide stays whole.
    """
    inverse = grid.inverse_depth
    # Cell by cell as they lie, which is faster than row by row; from the end of a row to the next is no step.
    across = np.empty_like(inverse)
    np.subtract(inverse.ravel()[1:], inverse.ravel()[:-1], out=across.ravel()[:-1])
    across[:, -1] = 0.0
    down = inverse[1:] - inverse[:-1]
    inner = np.abs(across[::2, :-1][mask[::2, 1:] & mask[::2, :-1]])
    typical = float(median(inner)) if len(inner) else 0.0
    jump = np.float32(min(max(12.0 * typical, _LEAST_JUMP), _MOST_JUMP))
    kept = mask & (across <= jump)
    kept.ravel()[1:] &= (across >= -jump).ravel()[:-1]
    kept[1:] &= down >= -jump
    kept[:-1] &= down <= jump
    # Counting the cells here is a fraction of the work of OpenCV's own statistics.
    count, found = cv2.connectedComponents(kept.view(np.uint8), connectivity=4)
    labels: IntGrid = np.asarray(found, np.int32)
    cells = np.flatnonzero(kept)
    label = labels.ravel().take(cells)
    # Renumber, leaving out the speckles.
    large = np.bincount(label, minlength=count) >= _SPECKLE_CELLS
    number = (np.cumsum(large) * large).astype(np.int32)
    labels.ravel()[cells] = number.take(label)
    return int(number.max()), labels


def _sorted_cells(labels: IntGrid, count: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Cells labelled 1..count in the order of their labels, then row by row: label and flat index of each."""
    flat = np.flatnonzero(labels > 0)
    label = labels.ravel().take(flat)
    bits = labels.size.bit_length()
    if count.bit_length() + bits > 31:
        order = np.argsort(label, kind="stable")
        return label[order], flat[order].astype(np.int32)
    # One number holds both: sorting numbers is faster than finding an order and following it.
    both = (label << bits) | flat.astype(np.int32)
    both.sort()
    return both >> bits, both & ((1 << bits) - 1)


def measure(grid: DepthGrid, labels: IntGrid, count: int) -> Regions:
    """Boxes, centres and sizes of the parts 1..count of labels (h, w); entry k - 1 is part k.

    wide knows of the image's border only; see unhidden.
    """
    height, width = labels.shape
    label, flat = _sorted_cells(labels, count)
    ends = label.searchsorted(np.arange(count + 1), side="right")
    starts, cells = ends[:-1], ends[1:] - ends[:-1]
    # Box, centre and size of each, in this order.
    table, reach = np.zeros((10, count)), np.zeros(count, np.intp)
    wide, tall, nothing = np.zeros((3, count), np.bool_)
    result = Regions(
        cells=cells,
        rows=reach,
        bbox_px=table[:4].T,
        position_m=table[4:7].T,
        extent_m=table[7:].T,
        wide=wide,
        tall=tall,
        overlapped=nothing,
    )
    if len(flat) == 0:
        return result
    present = cells.nonzero()[0]
    starts, number = starts[present], cells[present]
    rows = flat // np.int32(width)
    columns = flat - rows * np.int32(width)
    left, right = np.minimum.reduceat(columns, starts), np.maximum.reduceat(columns, starts)
    top, bottom = rows[starts], rows[starts + number - 1]
    inverse = grid.inverse_depth.ravel().take(flat)
    mean_inverse = np.add.reduceat(inverse, starts) / number
    spread = np.sqrt(np.maximum(np.add.reduceat(inverse * inverse, starts) / number - mean_inverse**2, 0.0))
    found = np.empty((10, len(present)))
    box, centre, size = found[:4], found[4:7], found[7:]
    depth = centre[2] = 1.0 / mean_inverse
    centre[0] = np.add.reduceat(grid.x.take(columns), starts) / number * depth
    centre[1] = np.add.reduceat(grid.y.take(rows), starts) / number * depth
    box[0], box[1], box[2], box[3] = left, top, right, bottom
    box *= grid.step_px
    box[:2] += grid.offset_px - 0.5 * grid.step_px
    box[2:] += grid.offset_px + 0.5 * grid.step_px
    box[3] = np.maximum(box[3], _foot_px(grid, bottom, centre[0] / depth, depth))
    size[0] = _width_m(grid, columns, inverse, starts, number, left, right)
    size[1] = (grid.y[bottom] - grid.y[top]) * depth
    size[2] = _UNIFORM * spread * depth * depth
    table[:, present] = found
    wide[present] = (left > 0) & (right < width - 1)
    tall[present] = (top > 0) & (bottom < height - 1)
    reach[present] = bottom - top + 1
    return result


def _width_m(
    grid: DepthGrid,
    columns: IntGrid,
    inverse: NDArray[np.floating],
    starts: NDArray[np.intp],
    number: NDArray[np.intp],
    left: IntGrid,
    right: IntGrid,
) -> FloatArray:
    """(R,) from the left to the right rim of parts, each at its own depth: whoever looks along a side of a
    body would take it for wider, at the depth of its middle, than it is."""
    rim = (right - left) // _RIM
    low, high = columns <= (left + rim).repeat(number), columns >= (right - rim).repeat(number)
    ends_m = []
    for x, of in ((grid.x[left], low), (grid.x[right], high)):
        share = of.astype(np.float32)
        cells = np.add.reduceat(share, starts).astype(np.intp)
        ends_m.append(x * cells / np.add.reduceat(inverse * share, starts))
    # What goes back and outwards has its far end on the inner rim.
    width: FloatArray = np.abs(ends_m[1] - ends_m[0])
    return width


def unhidden(grid: DepthGrid, labels: IntGrid, regions: Regions) -> Regions:
    """regions as measured, wide only where nothing nearer hides a part, either, and where it ends at an edge
    in depth: what was divided from its surroundings by guess has its middle where the guess put it."""
    hidden = _hidden_cells(grid, labels, len(regions.cells))
    overlapped = _overlapped_cells(grid, labels, len(regions.cells))
    least = _OCCLUDED_SHARE * regions.rows
    return replace(regions, wide=regions.wide & (hidden <= least), overlapped=overlapped > least)


def _foot_px(
    grid: DepthGrid, bottom: NDArray[np.intp], middle_x: FloatArray, depth_m: FloatArray
) -> FloatArray:
    """(R,) image row where a part that nearly reaches down to the floor stands on it; -inf for others.

    The lowest hand's breadth of a body is taken for floor, as the noise of depth demands.
    """
    if grid.up is None:
        return np.full(len(bottom), -np.inf)
    # On the floor: camera height = - up . ray * depth.
    floor_y = (-grid.camera_height_m / depth_m - grid.up[2] - grid.up[0] * middle_x) / grid.up[1]
    missing_m = (floor_y - grid.y[bottom]) * depth_m
    row = (floor_y - grid.y[0]) / float(grid.y[1] - grid.y[0]) * grid.step_px + grid.offset_px
    end = grid.offset_px + (len(grid.y) - 0.5) * grid.step_px
    stands = missing_m <= _FOOT_M + _FOOT_PER_METRE * depth_m
    result: FloatArray = np.where(stands, np.minimum(row, end), -np.inf)
    return result


def _hidden_cells(grid: DepthGrid, labels: IntGrid, count: int) -> NDArray[np.intp]:
    """(count,) cells at the left or right rim of each part beside which something else stands nearer, or
    another part goes on at the same depth."""
    inverse, flat = grid.inverse_depth.ravel(), labels.ravel()
    rims = (flat[1:] != flat[:-1]).nonzero()[0]
    rims = rims[(rims + 1) % labels.shape[1] > 0]  # not from the end of a row to the next one
    left, right = flat.take(rims), flat.take(rims + 1)
    step = inverse.take(rims + 1) - inverse.take(rims)
    jumps = np.abs(step) > np.float32(_LEAST_JUMP)
    shared = ~jumps & (left > 0) & (right > 0)
    hidden = np.concatenate((np.where(step > 0, left, right)[jumps], left[shared], right[shared]))
    return np.bincount(hidden, minlength=count + 1)[1:]


def _overlapped_cells(grid: DepthGrid, labels: IntGrid, count: int) -> NDArray[np.intp]:
    """(count,) cells at the left or right rim of each part that end at another part, which is nearer.

    Beside what stands nearer a stereo camera measures nothing, and the far side of a jump is of no part: what
    comes after that gap is the neighbour.
    """
    inverse, flat = grid.inverse_depth.ravel(), labels.ravel()
    owned = (flat > 0).nonzero()[0]
    label = flat.take(owned)
    rims = (label[1:] != label[:-1]).nonzero()[0]
    first, second = owned.take(rims), owned.take(rims + 1)
    apart = second - first
    near = (apart <= _GAP_CELLS + 1) & (second % labels.shape[1] >= apart)  # not from one row to the next
    step = inverse.take(second) - inverse.take(first)
    farther = np.where(step > 0.0, label.take(rims), label.take(rims + 1))
    jumps = np.abs(step) > np.float32(_LEAST_JUMP)
    return np.bincount(farther[near & jumps], minlength=count + 1)[1:]


def hidden_below(grid: DepthGrid, labels: IntGrid, regions: Regions) -> NDArray[np.bool_]:
    """(R,) parts whose lower end something nearer hides, for at least half of their width: what they are
    further down is not known. A beam ends before what is farther away. A head is as tall as _HEAD_M."""
    inverse, flat = grid.inverse_depth.ravel(), labels.ravel()
    width = labels.shape[1]
    rims = ((flat[:-width] > 0) & (flat[:-width] != flat[width:])).nonzero()[0]
    below = np.zeros(len(rims), inverse.dtype)
    for step in range(1, _GAP_CELLS + 1):
        below = np.maximum(below, inverse.take(np.minimum(rims + step * width, len(flat) - 1)))
    nearer = below - inverse.take(rims) > np.float32(_MOST_JUMP)
    cells = np.bincount(flat.take(rims[nearer]), minlength=len(regions.cells) + 1)[1:]
    across = (regions.bbox_px[:, 2] - regions.bbox_px[:, 0]) / grid.step_px
    tall = regions.extent_m[:, 1] >= _HEAD_M
    result: NDArray[np.bool_] = tall & (regions.cells > 0) & (cells >= _HIDDEN_SHARE * across)
    return result


def spread_labels(labels: IntGrid, mask: BoolGrid) -> IntGrid:
    """labels (h, w) with every unlabelled (0) cell of mask given the label of the nearest labelled cell."""
    owned = labels > 0
    if not owned.any():
        return labels
    # Nothing outside of the cells in question is nearer to one of them than what is inside.
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
