"""Which cells of the depth grid belong to which track, by the votes of what was predicted.

Each track predicts where its cells are (predict of vision/bodies/masks.py), and these vote:

1. count_votes: each predicted cell is one vote of its track for the connected part in which it lies. A few
   stray votes do not count, and of several static tracks in a part only the strongest stays.
2. withdraw: an exception. A mover that must have gone on loses what was there before and is claimed by what
   stands: it went behind that, at about its depth.
3. release: another one. A standing track loses a newly arrived part if the rest of the track was there
   before: somebody who stood beside furniture has left it.
4. divide: a part with one voter goes to that track as a whole. A part with several voters (at most one of
   them is static) is divided: each cell goes to the nearest vote.

Between 3 and 4, vision/bodies/grouping.py corrects to which track a whole part goes. Terms:
vision/__init__.py.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled
from vision.depth.connected import IntGrid, spread_labels
from vision.depth.depth_grid import BoolGrid

_LEAST_VOTES = 4  # cells: fewer are strays of a prediction that is off by a cell
_SHARE_OF_PART = 0.15  # of all votes in it, or
_SHARE_OF_TRACK = 0.30  # of all votes of the track, whichever is less: else they are strays, too
_CAME_CELLS = 20  # as much as an arrival that proves by itself (vision/bodies/proof.py), and
_CAME_SHARE = 0.3  # of the part: who leaves furniture comes out of it side first
_LEAVING_SHARE = 0.75  # of what stands: a larger part is the thing itself
_STAYED_SHARE = 0.7  # of its votes: the rest is where the rims of both lie


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
    votes = _votes(parts, predicted, count, tracks)
    return elect(_claims(votes, mover), votes)


@compiled("int32[:, ::1], int32[:, ::1], int64, int64")
def _votes(parts: IntGrid, predicted: IntGrid, count: int, tracks: int) -> NDArray[np.intp]:
    """(P, T) how many cells speak for each track in each part."""
    height, width = parts.shape
    votes = np.zeros((count, tracks), np.intp)
    for i in range(height):
        for j in range(width):
            if parts[i, j] > 0 and predicted[i, j] > 0:
                votes[parts[i, j] - 1, predicted[i, j] - 1] += 1
    return votes


@compiled("int64[:, ::1], boolean[::1]")
def _claims(votes: NDArray[np.intp], mover: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(P, T) the tracks that a part may belong to."""
    parts, tracks = votes.shape
    present = np.zeros((parts, tracks), np.bool_)
    total, own = votes.sum(axis=1), votes.sum(axis=0)
    for p in range(parts):
        strongest, most = 0, 0  # of the static ones
        for t in range(tracks):
            least = min(_SHARE_OF_PART * total[p], _SHARE_OF_TRACK * own[t])
            present[p, t] = votes[p, t] >= max(least, _LEAST_VOTES)
            if present[p, t] and not mover[t] and votes[p, t] > most:
                strongest, most = t, votes[p, t]
        for t in range(tracks):
            present[p, t] = present[p, t] and (mover[t] or t == strongest)
    return present


def elect(present: NDArray[np.bool_], cast: NDArray[np.intp]) -> Ballot:
    """The ballot of P parts, each for the one with the most votes, cast (P, T), of those present."""
    return Ballot(present, cast, *_elected(present, cast))


@compiled("boolean[:, ::1], int64[:, ::1]")
def _elected(
    present: NDArray[np.bool_], cast: NDArray[np.intp]
) -> tuple[NDArray[np.int32], NDArray[np.intp]]:
    """winner and votes of Ballot. Of those with as many votes it is the first."""
    parts, tracks = cast.shape
    winner, votes = np.zeros(parts, np.int32), np.zeros(parts, np.intp)
    for p in range(parts):
        for t in range(tracks):
            if present[p, t] and (winner[p] == 0 or cast[p, t] > votes[p]):
                winner[p], votes[p] = t + 1, cast[p, t]
    return winner, votes


def guessed(ballot: Ballot, mover: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(T,) movers, mover (T,), all of whose parts something that stands claims as well: where such a mover
    ends is a guess."""
    return _guessed(ballot.present, mover)


@compiled("boolean[:, ::1], boolean[::1]")
def _guessed(present: NDArray[np.bool_], mover: NDArray[np.bool_]) -> NDArray[np.bool_]:
    parts, tracks = present.shape
    somewhere, alone = np.zeros(tracks, np.bool_), np.zeros(tracks, np.bool_)
    for p in range(parts):
        shared = False
        for t in range(tracks):
            shared = shared or (present[p, t] and not mover[t])
        for t in range(tracks):
            if present[p, t]:
                somewhere[t] = True
                alone[t] = alone[t] or not shared
    return mover & somewhere & ~alone


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
    if not overdue.any():
        return ballot, np.zeros(len(mover), np.bool_)
    present = ballot.present
    doubtful = present & overdue & np.any(present & ~mover, axis=1, keepdims=True)
    if not doubtful.any():
        return ballot, np.zeros(len(mover), np.bool_)
    votes = _votes(parts, np.where(stayed, predicted, np.int32(0)), *present.shape)
    left = present & ~(doubtful & (votes >= _STAYED_SHARE * ballot.cast))
    hidden: NDArray[np.bool_] = np.any(present, axis=0) & ~np.any(left, axis=0)
    return elect(left, ballot.cast), hidden


def divide(parts: IntGrid, predicted: IntGrid, ballot: Ballot, winner: NDArray[np.int32]) -> IntGrid:
    """(h, w) track index + 1: whole parts to their winner (P,), shared ones by the nearest vote."""
    present, filled = ballot.present, predicted
    shared = _shared(present, winner)
    if shared.any():
        seeds, inside = _seeds(parts, predicted, present, shared)
        filled = spread_labels(seeds, inside)
    return _divided(parts, filled, present, shared, winner)


@compiled("boolean[:, ::1], int32[::1]")
def _shared(present: NDArray[np.bool_], winner: NDArray[np.int32]) -> NDArray[np.bool_]:
    """(P,) parts that belong to several tracks. Nobody shares in that of a track that begins just now."""
    parts, tracks = present.shape
    result = np.zeros(parts, np.bool_)
    for p in range(parts):
        result[p] = 0 < winner[p] <= tracks and np.count_nonzero(present[p]) > 1
    return result


@compiled("int32[:, ::1], int32[:, ::1], boolean[:, ::1], boolean[::1]")
def _seeds(
    parts: IntGrid, predicted: IntGrid, present: NDArray[np.bool_], shared: NDArray[np.bool_]
) -> tuple[IntGrid, BoolGrid]:
    """(h, w) the votes in the parts that are shared (P,), of those who are present there; and (h, w) where
    these parts are."""
    height, width = parts.shape
    seeds, inside = np.zeros((height, width), np.int32), np.zeros((height, width), np.bool_)
    for i in range(height):
        for j in range(width):
            part, vote = parts[i, j] - 1, predicted[i, j]
            if part >= 0 and shared[part]:
                inside[i, j] = True
                if vote > 0 and present[part, vote - 1]:
                    seeds[i, j] = vote
    return seeds, inside


@compiled("int32[:, ::1], int32[:, ::1], boolean[:, ::1], boolean[::1], int32[::1]")
def _divided(
    parts: IntGrid,
    filled: IntGrid,
    present: NDArray[np.bool_],
    shared: NDArray[np.bool_],
    winner: NDArray[np.int32],
) -> IntGrid:
    """(h, w) the winner of each part; in shared ones (P,) what is filled in, if that one is present there."""
    height, width = parts.shape
    labels = np.zeros((height, width), np.int32)
    for i in range(height):
        for j in range(width):
            part, vote = parts[i, j] - 1, filled[i, j]
            if part < 0:
                continue
            own = shared[part] and vote > 0 and present[part, vote - 1]
            labels[i, j] = vote if own else winner[part]
    return labels
