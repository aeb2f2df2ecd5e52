"""Whether something nearer hides a part of the grid at its sides, or from below.

Used after the regions have been measured (vision/depth/regions.py). Terms (cell, part, region):
vision/__init__.py.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hal.compiled import compiled
from hal.types import Flags, Integers
from vision.depth.connected import MAX_JUMP, MIN_JUMP, IntGrid
from vision.depth.depth_grid import DepthGrid, FloatGrid
from vision.depth.regions import Regions

_OCCLUDED_SHARE = 0.15  # of its rows: at fewer rims, a nearer neighbour is noise
_GAP_CELLS = 3  # a stereo camera measures nothing in some cells beside a nearer surface
_HIDDEN_SHARE = 0.5  # of its width: if less of its lower end is hidden, the rest is seen to end
_HEAD_M = 0.2  # height of a head down to the chin: a lower part is a strip of something


def with_occlusion(grid: DepthGrid, labels: IntGrid, regions: Regions) -> Regions:
    """regions with occlusion taken into account: sides_visible is restricted, overlapped is set.

    The sides of a part stay visible only if no nearer surface hides its left or right side, and if it ends
    there at an edge in depth. Where a part was divided from its surroundings by a guess, its centre depends
    on the guess.
    """
    hidden, overlapped = _hidden_cells(grid.inverse_depth, labels, len(regions.cells), np.float32(MIN_JUMP))
    least = _OCCLUDED_SHARE * regions.rows
    return replace(
        regions, sides_visible=regions.sides_visible & (hidden <= least), overlapped=overlapped > least
    )


@compiled("float32[:, ::1], int32[:, ::1], int64, float32")
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
        neighbour = -1  # column of the last cell in this row that belongs to a part
        for j in range(labels.shape[1]):
            here = labels[i, j]
            if j > 0 and labels[i, j - 1] != here:
                beside, step = labels[i, j - 1], inverse[i, j] - inverse[i, j - 1]
                if abs(step) > jump:
                    hidden[beside if step > 0 else here] += 1
                elif beside > 0 and here > 0:
                    hidden[beside] += 1
                    hidden[here] += 1
            if here == 0:
                continue
            if neighbour >= 0 and labels[i, neighbour] != here and j - neighbour <= _GAP_CELLS + 1:
                step = inverse[i, j] - inverse[i, neighbour]
                if abs(step) > jump:
                    overlapped[labels[i, neighbour] if step > 0 else here] += 1
            neighbour = j
    return hidden[1 : count + 1].copy(), overlapped[1 : count + 1].copy()


def hidden_below(grid: DepthGrid, labels: IntGrid, regions: Regions) -> Flags:
    """(R,) parts of at least _HEAD_M height whose lower end is hidden over at least half of their width.

    How far down they reach is not known. Below the lower end of a beam, in contrast, something farther is
    seen.
    """
    inverse, flat = grid.inverse_depth.ravel(), labels.ravel()
    width = labels.shape[1]
    rims = ((flat[:-width] > 0) & (flat[:-width] != flat[width:])).nonzero()[0]
    below = np.zeros(len(rims), inverse.dtype)
    for step in range(1, _GAP_CELLS + 1):
        below = np.maximum(below, inverse.take(np.minimum(rims + step * width, len(flat) - 1)))
    nearer = below - inverse.take(rims) > np.float32(MAX_JUMP)
    cells = np.bincount(flat.take(rims[nearer]), minlength=len(regions.cells) + 1)[1:]
    across = (regions.bbox_px[:, 2] - regions.bbox_px[:, 0]) / grid.step_px
    tall = regions.extent_m[:, 1] >= _HEAD_M
    result: Flags = tall & (regions.cells > 0) & (cells >= _HIDDEN_SHARE * across)
    return result
