"""Which cells of the depth grid belong to which track. Terms: vision/__init__.py.

Connected depth alone would merge a person with the wall that the person passes. So each track remembers the
cells that it covered, and these vote:

1. predict: the old cells of each track move with the camera and, for movers, with the track's velocity. A
   cell where they arrive belongs to the prediction if the depth measured there agrees.
2. count_votes: each predicted cell is one vote of its track for the connected part in which it lies. A few
   stray votes do not count, and of several static tracks in a part only the strongest stays.
3. withdraw: an exception. A mover that must have gone on loses what was there before and is claimed by what
   stands: it went behind that, at about its depth.
4. release: another one. A standing track loses a newly arrived part if the rest of the track was there
   before: somebody who stood beside furniture has left it.
5. divide: a part with one voter goes to that track as a whole. A part with several voters (at most one of
   them is static) is divided: each cell goes to the nearest vote.

Between 4 and 5, vision/bodies/grouping.py corrects to which track a whole part goes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray, Pose
from vision.depth.connected import IntGrid, spread_labels
from vision.depth.depth_grid import BoolGrid, DepthGrid, FloatGrid

_LEAST_VOTES = 4  # cells: fewer are strays of a prediction that is off by a cell
_SHARE_OF_PART = 0.15  # of all votes in it, or
_SHARE_OF_TRACK = 0.30  # of all votes of the track, whichever is less: else they are strays, too
_CAME_CELLS = 20  # as much as an arrival that proves by itself (vision/bodies/judgement.py), and
_CAME_SHARE = 0.3  # of the part: who leaves furniture comes out of it side first
_LEAVING_SHARE = 0.75  # of what stands: a larger part is the thing itself
_STAYED_SHARE = 0.7  # of its votes: the rest is where the rims of both lie
_DEPTH_GATE_INVERSE = 0.03  # 1/m, as large as a jump in depth may be within one part, and
_DEPTH_GATE_M = 0.25  # what may come nearer as a body turns or bends, beside its own velocity
_NOBODY = np.zeros(1, np.int32)


@dataclass(frozen=True, slots=True, eq=False)
class TrackSurfaces:
    """What T tracks covered in one frame: points_m (3, K) in the camera axes of pose, owner (K,): which of
    the tracks, track_id (T,)."""

    points_m: FloatGrid
    owner: NDArray[np.int32]
    track_id: NDArray[np.int64]
    pose: Pose


NO_TRACK_SURFACES = TrackSurfaces(
    np.empty((3, 0), np.float32),
    np.empty(0, np.int32),
    np.empty(0, np.int64),
    Pose(np.eye(3), np.zeros(3)),
)


def surfaces(grid: DepthGrid, labels: IntGrid, ids: NDArray[np.int64], pose: Pose) -> TrackSurfaces:
    """The surfaces of tracks with ids (T,), where labels (h, w) holds index + 1, 0 for none."""
    cells = np.flatnonzero(labels > 0)
    return TrackSurfaces(grid.points(cells), labels.ravel().take(cells) - 1, ids, pose)


def predict(
    before: TrackSurfaces, index: NDArray[np.intp], shift_m: FloatArray, grid: DepthGrid, pose: Pose
) -> IntGrid:
    """(h, w) track index + 1 that is expected, and found at the depth expected, in each cell; 0: none.

    index (T,): what track each one of before is now, -1: gone. shift_m (now's tracks, 3): way of each since
    then, in the fixed frame that before.pose and pose are given in.
    """
    result = np.zeros(grid.depth_m.shape, np.int32)
    if len(before.owner) == 0:
        return result
    number = (index + 1).astype(np.int32)
    relative = pose.inverse() @ before.pose
    there = relative.rotation.astype(np.float32) @ before.points_m
    there += relative.translation_m.astype(np.float32)[:, None]
    if shift_m.any():
        # Of what is gone, any way will do.
        way = shift_m[index] @ pose.rotation
        there += way.T.astype(np.float32).take(before.owner, axis=1)
    cell, inside, expected = grid.project(there)
    measured = grid.inverse_depth.ravel().take(cell)
    gate = np.float32(_DEPTH_GATE_INVERSE) + np.float32(_DEPTH_GATE_M) * expected * expected
    agrees = inside & (measured > 0) & (np.abs(measured - expected) <= gate)
    if not number.all():
        agrees &= number.take(before.owner) > 0
    chosen = agrees.nonzero()[0]
    _write_nearest(
        result.ravel(), cell.take(chosen), number.take(before.owner.take(chosen)), expected.take(chosen)
    )
    return result


def _write_nearest(
    into: NDArray[np.int32],
    cell: NDArray[np.intp],
    value: NDArray[np.int32],
    inverse_depth: NDArray[np.float32],
) -> None:
    """Into each cell (M,) of into its value (M,); of those that want the same cell, the nearest one's."""
    into[cell] = value
    held = np.zeros(len(into), np.float32)
    held[cell] = inverse_depth
    # What is written last stays. Most cells are wanted once; only what is nearer than the last has to be
    # written again, the nearest last.
    nearer = (inverse_depth > held.take(cell)).nonzero()[0]
    nearer = nearer[np.argsort(inverse_depth.take(nearer), kind="stable")]
    into[cell.take(nearer)] = value.take(nearer)


@dataclass(frozen=True, slots=True, eq=False)
class Ballot:
    """present (P, T): the tracks that a part may belong to. cast (P, T): votes for each. winner (P,): track
    index + 1 of the one with the most, 0 for none. votes (P,): the winner's."""

    present: NDArray[np.bool_]
    cast: NDArray[np.intp]
    winner: NDArray[np.int32]
    votes: NDArray[np.intp]


def count_votes(
    parts: IntGrid, count: int, predicted: IntGrid, tracks: int, mover: NDArray[np.bool_]
) -> Ballot:
    """How the cells predicted (h, w), track index + 1, vote in the connected parts 1..count of parts.

    mover (T,): tracks that move, or may: only these divide a part; of the static ones the strongest stays.
    """
    if tracks == 0 or count == 0:
        nobody, cast = np.zeros(count, np.int32), np.zeros((count, tracks), np.intp)
        return Ballot(cast.astype(np.bool_), cast, nobody, nobody.astype(np.intp))
    votes = _votes(parts, predicted, (parts > 0) & (predicted > 0), (count, tracks))
    total, own = votes.sum(axis=1)[:, None], votes.sum(axis=0)
    least = np.minimum(_SHARE_OF_PART * total, _SHARE_OF_TRACK * own)
    present = votes >= np.maximum(least, _LEAST_VOTES)
    # Of the static tracks the strongest stays.
    static_votes = np.where(mover, 0, votes) * present
    strongest = static_votes.argmax(axis=1)[:, None] == np.arange(tracks)
    present &= mover | (strongest & (static_votes > 0))
    return elect(present, votes)


def _votes(parts: IntGrid, predicted: IntGrid, voters: BoolGrid, shape: tuple[int, int]) -> NDArray[np.intp]:
    """(P, T) how many of the cells voters (h, w) speak for each track in each part; shape: P, T."""
    ballots = np.flatnonzero(voters)
    pair = parts.ravel().take(ballots) * shape[1] + predicted.ravel().take(ballots) - (shape[1] + 1)
    return np.bincount(pair, minlength=shape[0] * shape[1]).reshape(shape)


def elect(present: NDArray[np.bool_], cast: NDArray[np.intp]) -> Ballot:
    """The ballot of P parts, each for the one with the most votes, cast (P, T), of those present."""
    best, each = np.where(present, cast, -1).argmax(axis=1), np.arange(len(cast))
    claimed = present[each, best]
    return Ballot(present, cast, ((best + 1) * claimed).astype(np.int32), cast[each, best] * claimed)


def guessed(ballot: Ballot, mover: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(T,) movers, mover (T,), all of whose parts something that stands claims as well: where such a mover
    ends is a guess."""
    shared = np.any(ballot.present & ~mover, axis=1, keepdims=True)
    result: NDArray[np.bool_] = (
        mover & np.any(ballot.present, axis=0) & ~np.any(ballot.present & ~shared, axis=0)
    )
    return result


def release(
    ballot: Ballot, cells: NDArray[np.intp], arrived: NDArray[np.intp], mover: NDArray[np.bool_]
) -> Ballot:
    """ballot without what stands for parts that have come while the rest of it was there: somebody who stood
    beside furniture, as one part with it, has left it.

    cells (P,) of the parts; arrived (P,): those where free space was seen. mover (T,): keep what is theirs.
    """
    came = (arrived >= _CAME_CELLS) & (arrived >= _CAME_SHARE * cells)
    if not (came.any() and ballot.present.any()):
        return ballot
    whole, rest = cells @ ballot.present, (cells * ~came) @ ballot.present
    leaves = ~mover & (rest > 0)
    left = ballot.present & leaves & came[:, None] & (cells[:, None] <= _LEAVING_SHARE * whole)
    return elect(ballot.present & ~left, ballot.cast)


def withdraw(
    ballot: Ballot,
    parts: IntGrid,
    predicted: IntGrid,
    stayed: BoolGrid,
    overdue: NDArray[np.bool_],
    mover: NDArray[np.bool_],
) -> tuple[Ballot, NDArray[np.bool_]]:
    """ballot without movers that must have gone on for parts that something that stands claims as well, if
    most of their votes there are for surfaces that have stayed: they went behind them, at about their depth.
    And which tracks (T,) have lost all of their parts so.

    parts, predicted and mover as for count_votes; stayed (h, w); overdue (T,): the movers in question.
    """
    present = ballot.present
    doubtful = present & overdue & np.any(present & ~mover, axis=1, keepdims=True)
    if not doubtful.any():
        return ballot, np.zeros(len(mover), np.bool_)
    votes = _votes(parts, predicted, (parts > 0) & (predicted > 0) & stayed, present.shape)
    left = present & ~(doubtful & (votes >= _STAYED_SHARE * ballot.cast))
    hidden: NDArray[np.bool_] = np.any(present, axis=0) & ~np.any(left, axis=0)
    return elect(left, ballot.cast), hidden


def divide(parts: IntGrid, predicted: IntGrid, ballot: Ballot, winner: NDArray[np.int32]) -> IntGrid:
    """(h, w) track index + 1: whole parts to their winner (P,), shared ones by the nearest vote."""
    labels = np.concatenate((_NOBODY, winner)).take(parts)
    shared = np.zeros(len(winner) + 1, np.bool_)
    count, tracks = ballot.present.shape
    # Nobody shares in the part of a track that begins just now.
    shared[1:] = (ballot.present.sum(axis=1) > 1) & (winner > 0) & (winner <= tracks)
    if not shared.any():
        return labels
    allowed = np.zeros((count + 1, tracks + 1), np.bool_)
    allowed[1:, 1:] = ballot.present
    inside = shared.take(parts)
    cells = np.flatnonzero(inside)
    part, vote = parts.ravel().take(cells), predicted.ravel().take(cells)
    seeds = np.zeros(parts.shape, np.int32)
    seeds.ravel()[cells] = vote * allowed[part, vote]
    filled = spread_labels(seeds, inside).ravel().take(cells)
    fits = allowed[part, filled]
    labels.ravel()[cells[fits]] = filled[fits]
    return labels
