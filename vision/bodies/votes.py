"""Assignment of connected parts to tracks, by votes of the predicted cells. Terms: vision/__init__.py.

The cells that each track is predicted to cover (predict of vision/bodies/masks.py) vote:

1. count_votes: each predicted cell is one vote of its track for the connected part in which it lies. A few
   stray votes do not count, and of several static tracks in a part only the one with the most votes stays.
2. drop_overdue_movers, an exception: a mover that must have moved on (overdue_movers) loses a part that was
   there before and that a static track claims as well. The mover has gone behind the static surface, at
   about its depth.
3. drop_static_from_arrived, another exception: a static track loses a part that has newly arrived if the rest
   of the track was there before. Somebody who stood beside furniture, as one part with it, has left it.
4. divide: a part that one track claims goes to that track as a whole. A part that several tracks claim (at
   most one of them static) is divided: each cell goes to the track of the nearest vote.

Between 3 and 4, vision/bodies/grouping.py corrects the winners of whole parts.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled
from hal.records import record
from hal.types import FlagMatrix, FloatArray
from vision.bodies.arrivals import MUCH_ARRIVED_CELLS
from vision.bodies.tracks import Tracks
from vision.depth.connected import IntGrid, spread_labels
from vision.depth.depth_grid import BoolGrid

# A track needs this many votes in a part to claim it, in cells: fewer are strays of a prediction that is off
# by one cell.
_MIN_VOTES = 4
# It also needs this share of all votes in the part, or this share of all votes of the track, whichever is
# less. Fewer are strays as well.
_SHARE_OF_PART = 0.15
_SHARE_OF_TRACK = 0.30
# A part has newly arrived if MUCH_ARRIVED_CELLS of its cells have, at least, and this share of them: a person
# who leaves furniture emerges with one side first.
_ARRIVED_SHARE = 0.3
_LEAVING_SHARE = 0.75  # of a static track's cells: a larger part is the static thing itself and cannot leave
_UNPROVEN_S = 0.05  # a frame or two: for that long proof may be missing by chance
_LEFT_SHARE = 0.6  # of its width: a mover displaced by more has clearly left its former place
_STAYED_SHARE = 0.7  # of a mover's votes must be for cells that have stayed; the others lie at the rims


@record(frozen=True, slots=True, eq=False)
class Ballot:
    """The votes of T tracks in P parts.

    claims: the tracks that claim a part, to which it may belong, (P, T).
    votes_of: votes of each track in each part, (P, T).
    winner: index + 1 of the claiming track with the most votes, 0 for none, (P,).
    votes: the winner's votes, (P,).
    """

    claims: FlagMatrix
    votes_of: NDArray[np.intp]
    winner: NDArray[np.int32]
    votes: NDArray[np.intp]


def count_votes(
    parts: IntGrid, count: int, predicted: IntGrid, tracks: int, mover: NDArray[np.bool_]
) -> Ballot:
    """Count the votes of predicted (h, w), track index + 1, in the connected parts 1..count of parts.

    mover (T,): tracks that move, or may. All movers stay in a part; of the static tracks only the strongest.
    """
    votes = _votes(parts, predicted, count, tracks)
    return elect(_claims(votes, mover), votes)


@compiled("int32[:, ::1], int32[:, ::1], int64, int64")
def _votes(parts: IntGrid, predicted: IntGrid, count: int, tracks: int) -> NDArray[np.intp]:
    """(P, T) how many predicted cells each track has in each part."""
    height, width = parts.shape
    votes = np.zeros((count, tracks), np.intp)
    for i in range(height):
        for j in range(width):
            if parts[i, j] > 0 and predicted[i, j] > 0:
                votes[parts[i, j] - 1, predicted[i, j] - 1] += 1
    return votes


@compiled("int64[:, ::1], boolean[::1]")
def _claims(votes: NDArray[np.intp], mover: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(P, T) which tracks have enough votes in a part to claim it."""
    parts, tracks = votes.shape
    claims = np.zeros((parts, tracks), np.bool_)
    total, own = votes.sum(axis=1), votes.sum(axis=0)
    for p in range(parts):
        strongest, most = 0, 0  # of the static tracks
        for t in range(tracks):
            least = min(_SHARE_OF_PART * total[p], _SHARE_OF_TRACK * own[t])
            claims[p, t] = votes[p, t] >= max(least, _MIN_VOTES)
            if claims[p, t] and not mover[t] and votes[p, t] > most:
                strongest, most = t, votes[p, t]
        for t in range(tracks):
            claims[p, t] = claims[p, t] and (mover[t] or t == strongest)
    return claims


def elect(claims: NDArray[np.bool_], votes_of: NDArray[np.intp]) -> Ballot:
    """The ballot in which each part goes to the track with the most votes of those that claim it."""
    return Ballot(claims, votes_of, *_winners(claims, votes_of))


@compiled("boolean[:, ::1], int64[:, ::1]")
def _winners(
    claims: NDArray[np.bool_], votes_of: NDArray[np.intp]
) -> tuple[NDArray[np.int32], NDArray[np.intp]]:
    """winner and votes of Ballot. Of tracks with equally many votes the first one wins."""
    parts, tracks = votes_of.shape
    winner, votes = np.zeros(parts, np.int32), np.zeros(parts, np.intp)
    for p in range(parts):
        for t in range(tracks):
            if claims[p, t] and (winner[p] == 0 or votes_of[p, t] > votes[p]):
                winner[p], votes[p] = t + 1, votes_of[p, t]
    return winner, votes


@compiled(Ballot, "boolean[::1]")
def border_is_guess(ballot: Ballot, mover: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(T,) movers, of mover (T,), all of whose parts are claimed by a static track as well.

    The border between the two within such a part is a guess.
    """
    claims, (parts, tracks) = ballot.claims, ballot.claims.shape
    somewhere, alone = np.zeros(tracks, np.bool_), np.zeros(tracks, np.bool_)
    for p in range(parts):
        shared = False
        for t in range(tracks):
            shared = shared or (claims[p, t] and not mover[t])
        for t in range(tracks):
            if claims[p, t]:
                somewhere[t] = True
                alone[t] = alone[t] or not shared
    return mover & somewhere & ~alone


def drop_static_from_arrived(
    ballot: Ballot, cells: NDArray[np.intp], arrived: NDArray[np.intp], mover: NDArray[np.bool_]
) -> Ballot:
    """ballot without static tracks in parts that have newly arrived while the rest of the track was there.

    Somebody who stood beside furniture, as one part with it, has left it. cells (P,): of the parts. arrived
    (P,): cells of them in space that was seen free. mover (T,): these keep their parts.
    """
    newly_arrived = (arrived >= MUCH_ARRIVED_CELLS) & (arrived >= _ARRIVED_SHARE * cells)
    if not (newly_arrived.any() and ballot.claims.any()):
        return ballot
    whole, rest = cells @ ballot.claims, (cells * ~newly_arrived) @ ballot.claims
    leaves = ~mover & (rest > 0)
    left = ballot.claims & leaves & newly_arrived[:, None] & (cells[:, None] <= _LEAVING_SHARE * whole)
    return elect(ballot.claims & ~left, ballot.votes_of)


def overdue_movers(
    tracks: Tracks, elapsed_s: float, sight: FloatArray, resolves_m: FloatArray
) -> NDArray[np.bool_]:
    """(T,) movers without recent proof of motion that must have left their place of elapsed_s ago.

    By their velocity they have moved across the line of sight by most of their width, or along it by what
    depth can resolve there, resolves_m (T,). sight (T, 3): unit vectors from the camera to the tracks.
    """
    if elapsed_s <= 0.0:
        return np.zeros(len(tracks), np.bool_)
    asked = tracks.moving & (tracks.unproven_s >= _UNPROVEN_S)
    return _must_have_left(tracks, asked, sight, resolves_m, elapsed_s)


@compiled(Tracks, "boolean[::1], float64[:, ::1], float64[::1], float64")
def _must_have_left(
    tracks: Tracks, asked: NDArray[np.bool_], sight: FloatArray, resolves_m: FloatArray, elapsed_s: float
) -> NDArray[np.bool_]:
    """(T,) of the tracks asked (T,), those that must have left their place of elapsed_s ago."""
    gone = np.zeros(len(asked), np.bool_)
    for t in range(len(asked)):
        along_m, squared = 0.0, 0.0
        for i in range(3):
            displacement_m = elapsed_s * tracks.state[t, 3 + i]
            along_m += displacement_m * sight[t, i]
            squared += displacement_m * displacement_m
        across_m = math.sqrt(max(squared - along_m * along_m, 0.0))
        width_m, depth_m = max(tracks.extent_m[t, 0], tracks.extent_m[t, 2]), tracks.extent_m[t, 2]
        far = across_m >= _LEFT_SHARE * width_m or abs(along_m) >= max(resolves_m[t], _LEFT_SHARE * depth_m)
        gone[t] = asked[t] and far
    return gone


def drop_overdue_movers(
    ballot: Ballot,
    parts: IntGrid,
    predicted: IntGrid,
    stayed: BoolGrid,
    overdue: NDArray[np.bool_],
    mover: NDArray[np.bool_],
) -> tuple[Ballot, NDArray[np.bool_]]:
    """ballot without overdue movers in parts of static surfaces; and (T,) tracks that so lost all parts.

    A mover loses a part that a static track claims as well if most of its votes there are for cells that have
    stayed: it has gone behind the static surface, at about its depth.

    parts, predicted, mover: as for count_votes. stayed (h, w): surfaces that were there before. overdue (T,):
    movers that must have moved on.
    """
    if not overdue.any():
        return ballot, np.zeros(len(mover), np.bool_)
    claims = ballot.claims
    doubtful = claims & overdue & np.any(claims & ~mover, axis=1, keepdims=True)
    if not doubtful.any():
        return ballot, np.zeros(len(mover), np.bool_)
    votes = _votes(parts, np.where(stayed, predicted, np.int32(0)), *claims.shape)
    left = claims & ~(doubtful & (votes >= _STAYED_SHARE * ballot.votes_of))
    hidden: NDArray[np.bool_] = np.any(claims, axis=0) & ~np.any(left, axis=0)
    return elect(left, ballot.votes_of), hidden


def divide(parts: IntGrid, predicted: IntGrid, ballot: Ballot, winner: NDArray[np.int32]) -> IntGrid:
    """(h, w) track index + 1: whole parts go to their winner (P,), cells of shared ones to the nearest."""
    claims, filled = ballot.claims, predicted
    shared = _shared(claims, winner)
    if shared.any():
        seeds, inside = _seeds(parts, predicted, claims, shared)
        filled = spread_labels(seeds, inside)
    return _divided(parts, filled, claims, shared, winner)


@compiled("boolean[:, ::1], int32[::1]")
def _shared(claims: NDArray[np.bool_], winner: NDArray[np.int32]) -> NDArray[np.bool_]:
    """(P,) parts that several tracks claim. A part whose winner is born in this frame is never shared."""
    parts, tracks = claims.shape
    result = np.zeros(parts, np.bool_)
    for p in range(parts):
        result[p] = 0 < winner[p] <= tracks and np.count_nonzero(claims[p]) > 1
    return result


@compiled("int32[:, ::1], int32[:, ::1], boolean[:, ::1], boolean[::1]")
def _seeds(
    parts: IntGrid, predicted: IntGrid, claims: NDArray[np.bool_], shared: NDArray[np.bool_]
) -> tuple[IntGrid, BoolGrid]:
    """(h, w) votes in shared parts (P,) of the tracks that claim them; and (h, w) cells of these parts."""
    height, width = parts.shape
    seeds, inside = np.zeros((height, width), np.int32), np.zeros((height, width), np.bool_)
    for i in range(height):
        for j in range(width):
            part, vote = parts[i, j] - 1, predicted[i, j]
            if part >= 0 and shared[part]:
                inside[i, j] = True
                if vote > 0 and claims[part, vote - 1]:
                    seeds[i, j] = vote
    return seeds, inside


@compiled("int32[:, ::1], int32[:, ::1], boolean[:, ::1], boolean[::1], int32[::1]")
def _divided(
    parts: IntGrid,
    filled: IntGrid,
    claims: NDArray[np.bool_],
    shared: NDArray[np.bool_],
    winner: NDArray[np.int32],
) -> IntGrid:
    """(h, w) the winner of each part; in shared parts (P,) the label in filled, if it claims the part."""
    height, width = parts.shape
    labels = np.zeros((height, width), np.int32)
    for i in range(height):
        for j in range(width):
            part, vote = parts[i, j] - 1, filled[i, j]
            if part < 0:
                continue
            own = shared[part] and vote > 0 and claims[part, vote - 1]
            labels[i, j] = vote if own else winner[part]
    return labels
