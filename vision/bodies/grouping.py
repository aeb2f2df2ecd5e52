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

from hal.compiled import compiled
from hal.types import FloatArray
from vision.bodies.boxes import LEAST_SAMPLES, LOAD_M, THROUGH_M, cells_between, relations
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
    result, main = _with_room(
        parts.position_m,
        parts.cells,
        winner,
        votes,
        bodies.centre_m,
        bodies.extent_m,
        bodies.box_m,
        bodies.sigma_m,
        mover,
    )
    part, track = np.nonzero(result)
    if len(part):
        result[part, track] = something_nearer_between(grid, parts, part, main[track])
    return result


@compiled(
    "float64[:, :], int64[:], int32[::1], int64[:], float64[:, :], float64[:, :], float64[:, :],"
    "float64[::1], boolean[::1]"
)
def _with_room(
    position_m: FloatArray,
    cells: NDArray[np.intp],
    winner: NDArray[np.int32],
    votes: NDArray[np.intp],
    centre_m: FloatArray,
    extent_m: FloatArray,
    box_m: FloatArray,
    sigma_m: FloatArray,
    mover: NDArray[np.bool_],
) -> tuple[NDArray[np.bool_], NDArray[np.intp]]:
    """(P, T) which parts a mover makes room for, at its depth; and (T,) which part is surely its own: without
    one it makes no room."""
    result, main = np.zeros((len(cells), len(mover)), np.bool_), np.full(len(mover), -1, np.intp)
    for p in range(len(winner)):
        t = winner[p] - 1
        if 0 <= t < len(mover) and (main[t] < 0 or votes[p] >= votes[main[t]]):
            main[t] = p
    for t in range(len(mover)):
        if not mover[t] or main[t] < 0:
            continue
        half_x, half_y = 0.5 * extent_m[t, 0], 0.5 * extent_m[t, 1]
        room_x = max(box_m[t, 2] - box_m[t, 0] - half_x, half_x) + _CLOSE_M
        room_y = max(box_m[t, 3] - box_m[t, 1] - half_y, half_y) + _CLOSE_M
        room_z = _SAME_DEPTH_M + sigma_m[t]
        for p in range(len(cells)):
            result[p, t] = (
                cells[p] > 0
                and abs(position_m[p, 0] - centre_m[t, 0]) <= room_x
                and abs(position_m[p, 1] - centre_m[t, 1]) <= room_y
                and abs(position_m[p, 2] - centre_m[t, 2]) <= room_z
            )
    return result, main


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
    main = _main_parts(winner, votes)
    beside = (main != np.arange(len(main))).nonzero()[0]
    if len(beside) == 0:
        return winner
    lie = relations(parts, beside, main[beside])
    carried = ((lie.gap_m <= LOAD_M) & lie.stacked) | ((lie.gap_m <= THROUGH_M) & lie.within)
    carried &= votes[beside] >= _MOSTLY * parts.cells[beside]
    far = (lie.gap_m > _APART_M) & ~expected[beside, winner[beside] - 1] & ~carried
    result = winner.copy()
    result[beside[far]] = 0
    return result


@compiled("int32[::1], int64[:]")
def _main_parts(winner: NDArray[np.int32], votes: NDArray[np.intp]) -> NDArray[np.intp]:
    """(P,) the part with the most votes, the first of these, of those with the same winner; of nobody's part
    itself."""
    parts = len(winner)
    main = np.arange(parts)
    for p in range(parts):
        for other in range(parts):
            same = winner[p] > 0 and winner[other] == winner[p]
            if same and (
                votes[other] > votes[main[p]] or (votes[other] == votes[main[p]] and other < main[p])
            ):
                main[p] = other
    return main


def attach(
    new_parts: NDArray[np.intp],
    parts: Regions,
    winner: NDArray[np.int32],
    alive: NDArray[np.bool_],
    expected: NDArray[np.bool_],
) -> NDArray[np.int32]:
    """winner (P,) with new parts (indices) given to the track that they are small beside and close to, or to
    the one that is expected there (P, T). alive (T,): the tracks that may get them, which move or moved."""
    if len(new_parts) == 0 or not alive.any():
        return winner
    of_mover = ((winner > 0) & np.concatenate(([False], alive))[winner]).nonzero()[0]
    if len(of_mover) == 0:
        return winner
    a, b = new_parts.repeat(len(of_mover)), np.tile(of_mover, len(new_parts))
    gap_m = relations(parts, a, b).gap_m
    gap_m[expected[a, winner[b] - 1]] = 0.0
    gap_m[parts.cells[a] > _SMALL_SHARE * parts.cells[b]] = np.inf
    gap_m = gap_m.reshape(len(new_parts), -1)
    nearest, close = of_mover[gap_m.argmin(axis=1)], gap_m.min(axis=1) <= _CLOSE_M
    result = winner.copy()
    result[new_parts[close]] = winner[nearest[close]]
    return result
