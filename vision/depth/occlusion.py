"""Whether a part of the grid is cut at its sides by what is measured, or hidden there or from below.

Used after the regions have been measured (vision/depth/regions.py). Terms (cell, part, region):
vision/__init__.py.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hal.compiled import compiled, inlined
from hal.types import Flags, Integers
from vision.depth.connected import MAX_JUMP, MIN_JUMP, IntGrid
from vision.depth.depth_grid import BoolGrid, DepthGrid, FloatGrid
from vision.depth.regions import Regions

_OCCLUDED_SHARE = 0.15  # of its rows: at fewer rims, a nearer neighbour is noise
_GAP_CELLS = 3  # a stereo camera measures nothing in some cells beside a nearer surface
# A stereo camera measures nothing in a band at one side of its image, which its other imager does not see.
# With a baseline of 5 cm and a focal length of 611 px the band is 24 px wide at 1.3 m, less farther away.
_BLIND_CELLS = 6
_HIDDEN_SHARE = 0.5  # of its width: if less of its lower end is hidden, the rest is seen to end
_HEAD_M = 0.2  # height of a head down to the chin: a lower part is a strip of something


def with_occlusion(grid: DepthGrid, labels: IntGrid, regions: Regions) -> Regions:
    """regions with occlusion taken into account: sides_visible is restricted, overlapped is set.

    The sides of a part stay visible only if no nearer surface hides its left or right side, and if it ends
    there at an edge in depth. Where a part was divided from its surroundings by a guess, its centre depends
    on the guess. A part that reaches the blind band of a stereo camera is cut there, as at the image border.
    """
    sides_visible, overlapped = _sides(grid, labels, regions)
    return replace(regions, sides_visible=sides_visible, overlapped=overlapped)


@inlined
def _cut_by_blind_band(valid: BoolGrid, labels: IntGrid, count: int) -> Flags:
    """(count,) parts with a cell beside a band without depth at the left or right border of the image."""
    height, width = labels.shape
    cut = np.zeros(max(count, labels.max()) + 1, np.bool_)
    for i in range(height):
        for border, inwards in ((0, 1), (width - 1, -1)):
            blind, j = 0, border
            while blind < min(_BLIND_CELLS, width - 1) and not valid[i, j]:
                blind += 1
                j += inwards
            if blind > 0 and valid[i, j]:
                cut[labels[i, j]] = True
    return cut[1 : count + 1].copy()


@inlined
def _hidden_cells(
    inverse: FloatGrid, labels: IntGrid, count: int, jump: np.float32
) -> tuple[Integers, Integers]:
    """Two counts of rim cells of each part, (count,) each.

    The first: cells at the left or right rim beside which there is something nearer, or another part at the
    same depth. The second: rim cells beside which there is another part that is nearer.

    Beside a nearer surface a stereo camera measures nothing, and the far side of a jump belongs to no part.
    Therefore the neighbour is the next part after a gap of up to _GAP_CELLS. jump: 1/m; less is noise.
    """
    room = max(count, labels.max()) + 1
    hidden, overlapped = np.zeros(room, np.intp), np.zeros(room, np.intp)
    for i in range(labels.shape[0]):
        before, neighbour = labels[i, 0], -1  # neighbour: the last cell in this row that belongs to a part
        for j in range(1, labels.shape[1]):
            here = labels[i, j]
            if here == before:
                continue
            step = inverse[i, j] - inverse[i, j - 1]
            if abs(step) > jump:
                hidden[before if step > 0 else here] += 1
            elif before > 0 and here > 0:
                hidden[before] += 1
                hidden[here] += 1
            neighbour = j - 1 if before > 0 else neighbour
            before = here
            if here == 0 or neighbour < 0 or j - neighbour > _GAP_CELLS + 1:
                continue
            step, beside = inverse[i, j] - inverse[i, neighbour], labels[i, neighbour]
            if beside != here and abs(step) > jump:
                overlapped[beside if step > 0 else here] += 1
    return hidden[1 : count + 1].copy(), overlapped[1 : count + 1].copy()


@compiled(DepthGrid, "int32[:, ::1]", Regions)
def _sides(grid: DepthGrid, labels: IntGrid, regions: Regions) -> tuple[Flags, Flags]:
    """sides_visible and overlapped of with_occlusion."""
    count = len(regions.cells)
    hidden, overlapping = _hidden_cells(grid.inverse_depth, labels, count, np.float32(MIN_JUMP))
    cut = _cut_by_blind_band(grid.valid, labels, count)
    sides_visible, overlapped = np.empty(count, np.bool_), np.empty(count, np.bool_)
    for part in range(count):
        least = _OCCLUDED_SHARE * regions.rows[part]
        sides_visible[part] = regions.sides_visible[part] and hidden[part] <= least and not cut[part]
        overlapped[part] = overlapping[part] > least
    return sides_visible, overlapped


@compiled(DepthGrid, "int32[:, ::1]", Regions)
def hidden_below(grid: DepthGrid, labels: IntGrid, regions: Regions) -> Flags:
    """(R,) parts of at least _HEAD_M height whose lower end is hidden over at least half of their width.

    How far down they reach is not known. Below the lower end of a beam, in contrast, something farther is
    seen.
    """
    inverse, hidden = grid.inverse_depth, np.zeros(len(regions.cells) + 1, np.intp)
    height, width = labels.shape
    for i in range(height - 1):
        for j in range(width):
            label = labels[i, j]
            if label == 0 or labels[i + 1, j] == label:
                continue
            nearest = np.float32(0.0)
            for k in range(i + 1, i + 1 + _GAP_CELLS):
                # Beyond the last row the last cell of all counts.
                nearest = max(nearest, inverse[k, j] if k < height else inverse[height - 1, width - 1])
            hidden[label] += nearest - inverse[i, j] > np.float32(MAX_JUMP)
    result = np.zeros(len(regions.cells), np.bool_)
    for part in range(len(regions.cells)):
        across = (regions.bbox_px[part, 2] - regions.bbox_px[part, 0]) / grid.step_px
        tall = regions.extent_m[part, 1] >= _HEAD_M
        result[part] = tall and regions.cells[part] > 0 and hidden[part + 1] >= _HIDDEN_SHARE * across
    return result
