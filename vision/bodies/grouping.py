"""Parts to bodies, where connected depth says too little. Terms: vision/__init__.py.

* attach: a hole in the depth image may part a shoe, an arm or a load from its body. A small new part close to
  somebody who moves, or has moved before, becomes part of it.
* expected_in: something nearer, a post for example, may divide a mover in the image. The piece on the other
  side of it is still part of the mover.
* detach: a part far from the main part of its track leaves the track, unless it is expected there or is a
  load that stands on the main part.

Two tracks that are one body: vision/bodies/merging.py.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray
from vision.bodies.boxes import (
    LEAST_SAMPLES,
    LOAD_M,
    THROUGH_M,
    boxes,
    cells_between,
    gaps_m,
    seen_through,
    stacked,
)
from vision.bodies.division import NEARER_INVERSE
from vision.depth.depth_grid import DepthGrid
from vision.depth.regions import Regions

_APART_M = 0.40  # parts further from the main one are of something else
_CLOSE_M = 0.25  # a hand's length of depth is lost at a shoe or under an arm
_SAME_DEPTH_M = 0.30  # about a body's depth, beside the noise
_SMALL_SHARE = 0.5  # of the larger part: what is more is a body of its own
_MOSTLY = 0.7  # of its cells were the track's before: then it stays, as a load does


@dataclass(frozen=True, slots=True, eq=False)
class ExpectedBodies:
    """Where T bodies are expected, in the camera frame. centre_m (T, 3), extent_m (T, 3): of what was seen of
    them last; box_m (T, 4): edges of the whole ones from their centres, left, upper, right, lower; sigma_m
    (T,): of depth there."""

    centre_m: FloatArray
    extent_m: FloatArray
    box_m: FloatArray
    sigma_m: FloatArray


def expected_in(
    grid: DepthGrid,
    parts: Regions,
    winner: NDArray[np.int32],
    votes: NDArray[np.intp],
    bodies: ExpectedBodies,
    mover: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """(P, T) which parts are what is seen of a mover on the other side of something nearer that divides it.

    winner (P,), votes (P,): as in a Ballot; the part with the most votes is what is surely the body's. The
    rest of it is no farther away than the whole makes room for, and it is at its depth. mover (T,): of the
    others nothing is expected.
    """
    result = np.zeros((len(parts.cells), len(mover)), np.bool_)
    if not mover.any():
        return result
    half = 0.5 * bodies.extent_m[:, :2]
    room = np.maximum(bodies.box_m[:, 2:] - bodies.box_m[:, :2] - half, half) + _CLOSE_M
    offset = parts.position_m[:, None] - bodies.centre_m
    inside = (np.abs(offset[..., :2]) <= room).all(axis=2) & (parts.cells > 0)[:, None] & mover
    inside &= np.abs(offset[..., 2]) <= _SAME_DEPTH_M + bodies.sigma_m
    main = np.full(len(bodies.sigma_m) + 1, -1, np.intp)
    fewest_first = np.argsort(votes)
    main[winner[fewest_first]] = fewest_first
    part, track = np.nonzero(inside & (main[1:] >= 0))
    if len(part) == 0:
        return result
    result[part, track] = something_nearer_between(grid, parts, part, main[track + 1])
    return result


def something_nearer_between(
    grid: DepthGrid, parts: Regions, one: NDArray[np.intp], other: NDArray[np.intp]
) -> NDArray[np.bool_]:
    """(K,) whether something nearer stands between the middles of parts one[k] and other[k] in the image."""
    inverse = grid.inverse_depth.ravel().take(cells_between(grid, parts, one, other))
    depth = np.minimum(parts.position_m[one, 2], parts.position_m[other, 2])
    nearer = inverse > 1.0 / np.maximum(depth, 0.1) + NEARER_INVERSE
    result: NDArray[np.bool_] = nearer.sum(axis=0) >= LEAST_SAMPLES
    return result


def detach(
    winner: NDArray[np.int32], parts: Regions, votes: NDArray[np.intp], expected: NDArray[np.bool_]
) -> NDArray[np.int32]:
    """winner (P,), track index + 1 of each part or 0, without the parts far from the track's main one.

    votes (P,): how many cells spoke for the winner. expected (P, T): parts that stay with it all the same, as
    those do that stand on the main one in the image, or are seen through it, and were its own before.
    """
    owned = (winner > 0).nonzero()[0]
    if len(owned) == 0:
        return winner
    order = owned[np.lexsort((-votes[owned], winner[owned]))]
    track = winner[order]
    is_main = np.concatenate(([True], track[1:] != track[:-1]))
    if is_main.all():
        return winner
    main = order[np.maximum.accumulate(np.where(is_main, np.arange(len(order)), 0))]
    box = boxes(parts)
    gap = gaps_m(box, order, box, main)
    own, of = parts.bbox_px[order], parts.bbox_px[main]
    carried = (gap <= LOAD_M) & stacked(own, of)
    carried |= (gap <= THROUGH_M) & seen_through(own, of)
    carried &= votes[order] >= _MOSTLY * parts.cells[order]
    far = (gap > _APART_M) & ~expected[order, track - 1] & ~carried
    result = winner.copy()
    result[order[far]] = 0
    return result


def attach(
    new_parts: NDArray[np.intp],
    parts: Regions,
    winner: NDArray[np.int32],
    alive: NDArray[np.bool_],
    expected: NDArray[np.bool_],
) -> NDArray[np.int32]:
    """winner (P,) with new parts (indices) given to the track that they are small beside and close to, or to
    the one that is expected there (P, T). alive (T,): the tracks that may get them, which move or moved."""
    of_mover = ((winner > 0) & np.concatenate(([False], alive))[winner]).nonzero()[0]
    if len(of_mover) == 0 or len(new_parts) == 0:
        return winner
    box = boxes(parts)
    a, b = new_parts[:, None], of_mover
    gap = gaps_m(box, a, box, b)
    gap[expected[a, winner[b] - 1]] = 0.0
    gap[parts.cells[a] > _SMALL_SHARE * parts.cells[b]] = np.inf
    best = gap.argmin(axis=1)
    close = gap[np.arange(len(new_parts)), best] <= _CLOSE_M
    result = winner.copy()
    result[new_parts[close]] = winner[of_mover[best[close]]]
    return result
