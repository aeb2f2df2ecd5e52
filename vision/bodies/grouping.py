"""Correction of which whole parts belong to which track, where connected depth says too little.

* expected_in: something nearer, a post for example, may divide a mover in the image. The piece on the other
  side of it is still part of the mover, if it is where the body is expected (expected_bodies).
* detach: a part far from the main part of its track leaves the track, unless it is expected there or is a
  load that stands on the main part.
* attach: a hole in the depth image may separate a shoe, an arm or a load from its body. A small new part
  close to a track that moves, or has moved before, becomes part of that track.

It takes the winners of vision/bodies/votes.py and returns them corrected. Two tracks that are one body are
joined later, by vision/bodies/merging.py. Terms: vision/__init__.py.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise
from hal.compiled import compiled, inlined
from hal.records import record
from hal.types import FloatArray, Matrix, Pose, Vector
from vision.bodies.boxes import gap_between_m, lies, nearer_between
from vision.bodies.tracks import Tracks
from vision.depth.depth_grid import DepthGrid
from vision.depth.depth_noise import depth_sigma_of
from vision.depth.regions import Regions
from vision.numerics.pose_axes import inner_point

_APART_M = 0.40  # parts farther than this from the main part belong to something else
_CLOSE_M = 0.25  # gap that missing depth at a shoe or under an arm leaves: about the length of a hand
_LOAD_GAP_M = 0.8  # maximum gap between a load and its carrier: the load may begin farther back
_SEEN_THROUGH_GAP_M = 1.5  # maximum gap between a vehicle and its own far side, seen through it
_SAME_DEPTH_M = 0.30  # besides the noise, the visible surface may lie this far from the centre in depth
_SMALL_SHARE = 0.5  # of the larger part's cells: a new part with more is a body of its own
# Share of a part's cells that voted for the track: from here on it stays, as a load does.
_OWN_VOTE_SHARE = 0.7


@record(frozen=True, slots=True, eq=False)
class ExpectedBodies:
    """Where T bodies are expected, in the camera frame.

    centre_m: predicted centre, (T, 3).
    extent_m: size of the surface that was seen last, (T, 3).
    box_m: left, upper, right, lower edge of the whole body from its centre, (T, 4).
    sigma_m: standard deviation of measured depth there, (T,).
    """

    centre_m: Matrix
    extent_m: Matrix
    box_m: Matrix
    sigma_m: Vector


def expected_bodies(tracks: Tracks, pose: Pose, noise: DepthNoise) -> ExpectedBodies:
    """Where the bodies of tracks are expected in the axes of a camera at pose."""
    centre_m, sigma_m = _expected(tracks, pose, noise)
    return ExpectedBodies(centre_m, tracks.extent_m, tracks.box_m, sigma_m)


@compiled(Tracks, Pose, DepthNoise)
def _expected(tracks: Tracks, pose: Pose, noise: DepthNoise) -> tuple[FloatArray, FloatArray]:
    """centre_m and sigma_m of ExpectedBodies."""
    count = len(tracks.state)
    centre_m, sigma_m = np.empty((count, 3)), np.empty(count)
    for t in range(count):
        centre_m[t] = inner_point(pose, tracks.state[t, :3])
        depth_m = max(centre_m[t, 2], 0.0)
        sigma_m[t] = depth_sigma_of(depth_m, noise)
    return centre_m, sigma_m


def expected_in(
    grid: DepthGrid,
    parts: Regions,
    winner: NDArray[np.int32],
    votes: NDArray[np.intp],
    bodies: ExpectedBodies,
    mover: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """(P, T) which parts belong to a mover that something nearer divides in the image.

    The part of the track with the most votes surely belongs to the body. Another part is expected if it lies
    within the whole body's box around the predicted centre, at about its depth, and something nearer stands
    between the two. winner (P,), votes (P,): as in a Ballot. mover (T,): only for these parts are expected.
    """
    result = np.zeros((len(parts.cells), len(mover)), np.bool_)
    if not mover.any():
        return result
    result, main = _within_expected_box(parts, bodies, winner, votes, mover)
    part, track = np.nonzero(result)
    if len(part):
        result[part, track] = nearer_between(grid, parts, part, main[track])
    return result


@compiled(Regions, ExpectedBodies, "int32[::1], int64[:], boolean[::1]")
def _within_expected_box(
    parts: Regions,
    bodies: ExpectedBodies,
    winner: NDArray[np.int32],
    votes: NDArray[np.intp],
    mover: NDArray[np.bool_],
) -> tuple[NDArray[np.bool_], NDArray[np.intp]]:
    """(P, T) parts within the box and depth of a mover; and (T,) its main part, the one with the most votes.

    A mover without a main part (-1) gets no others.
    """
    result, main = np.zeros((len(parts.cells), len(mover)), np.bool_), np.full(len(mover), -1, np.intp)
    for p in range(len(winner)):
        t = winner[p] - 1
        if 0 <= t < len(mover) and (main[t] < 0 or votes[p] >= votes[main[t]]):
            main[t] = p
    for t in range(len(mover)):
        if not mover[t] or main[t] < 0:
            continue
        left_m, upper_m, right_m, lower_m = bodies.box_m[t]
        half_x, half_y = 0.5 * bodies.extent_m[t, 0], 0.5 * bodies.extent_m[t, 1]
        room_x = max(right_m - left_m - half_x, half_x) + _CLOSE_M
        room_y = max(lower_m - upper_m - half_y, half_y) + _CLOSE_M
        room_z = _SAME_DEPTH_M + bodies.sigma_m[t]
        for p in range(len(parts.cells)):
            result[p, t] = (
                parts.cells[p] > 0
                and abs(parts.position_m[p, 0] - bodies.centre_m[t, 0]) <= room_x
                and abs(parts.position_m[p, 1] - bodies.centre_m[t, 1]) <= room_y
                and abs(parts.position_m[p, 2] - bodies.centre_m[t, 2]) <= room_z
            )
    return result, main


@inlined
def _main_part(winner: NDArray[np.int32], votes: NDArray[np.intp], part: int) -> int:
    """Main part of a part's winner: of the parts with that winner the first with the most votes.

    A part without a winner is its own main part.
    """
    if winner[part] == 0:
        return part
    main = -1
    for other in range(len(winner)):
        if winner[other] == winner[part] and (main < 0 or votes[other] > votes[main]):
            main = other
    return main


@compiled("int32[::1]", Regions, "int64[:], boolean[:, :]")
def detach(
    winner: NDArray[np.int32], parts: Regions, votes: NDArray[np.intp], expected: NDArray[np.bool_]
) -> NDArray[np.int32]:
    """winner (P,), track index + 1 of each part or 0, without the parts far from their track's main part.

    A part stays all the same if it is expected (P, T), or if it stands on the main part in the image, or is
    seen through it, and most of its cells voted for the track. votes (P,): of the winner.
    """
    result = winner.copy()
    for p in range(len(winner)):
        main = _main_part(winner, votes, p)
        if main == p or expected[p, winner[p] - 1]:
            continue
        gap_m = gap_between_m(parts, p, main)
        _, stacked, within = lies(parts, p, main)
        carried = (gap_m <= _LOAD_GAP_M and stacked) or (gap_m <= _SEEN_THROUGH_GAP_M and within)
        carried = carried and votes[p] >= _OWN_VOTE_SHARE * parts.cells[p]
        if gap_m > _APART_M and not carried:
            result[p] = 0
    return result


@compiled("int64[::1]", Regions, "int32[::1], boolean[:], boolean[:, :]")
def attach(
    new_parts: NDArray[np.intp],
    parts: Regions,
    winner: NDArray[np.int32],
    alive: NDArray[np.bool_],
    expected: NDArray[np.bool_],
) -> NDArray[np.int32]:
    """winner (P,) with each new part given to the track of the closest part that is twice as large or more.

    A part that is expected (P, T) at a track counts as touching it. new_parts: indices. alive (T,): tracks
    that may get parts, which are those that move or have moved.
    """
    result = winner.copy()
    for part in new_parts:
        closest_m = np.inf
        for other in range(len(winner)):
            track = winner[other] - 1
            if track < 0 or not alive[track] or parts.cells[part] > _SMALL_SHARE * parts.cells[other]:
                continue
            gap_m = 0.0 if expected[part, track] else gap_between_m(parts, part, other)
            if gap_m <= _CLOSE_M and gap_m < closest_m:
                closest_m, result[part] = gap_m, winner[other]
    return result
