"""Parts to bodies, where connected depth says too little. Terms: vision/__init__.py.

* attach: a hole in the depth image may part a shoe, an arm or a load from its body. A small new part close to
  somebody who moves, or has moved before, becomes part of it.
* expected_in: something nearer, a post for example, may divide a mover in the image. The piece on the other
  side of it is still part of the mover.
* detach: a part far from the main part of its track leaves the track, unless it is expected there or is a
  load that stands on the main part.
* merges, join: two tracks that may be one body are joined: a small one beside a mover whose velocity does not
  contradict; a load on its carrier; pieces of a vehicle, of whose plain sides a depth camera sees only the
  edges, if they move exactly alike and nothing is seen between them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray
from vision.depth_grid import BoolGrid, DepthGrid
from vision.division import LOW, LOW_BESIDE, NEARER_INVERSE, SINGLE_WIDTH_M, WITHIN, split
from vision.regions import IntGrid, Regions

_CLOSE_M = 0.25
_APART_M = 0.40
_SAME_DEPTH_M = 0.30
_ALONG = np.linspace(0.0, 1.0, 24)[:, None]  # from one part to another
_LEAST_SAMPLES = 3
_SMALL_SHARE = 0.5
_SAME_VELOCITY_MPS = 0.4
_ALIKE_SIGMAS = 2.0  # a shank that stands, or swings, on a body that goes
_CARRIED_M = 0.8
_CARRIED_MPS = 0.25
_CARRIED_SIGMA_MPS = 0.35
_GOES_MPS = 0.3  # what goes more slowly goes like whatever stands
_MOSTLY = 0.7
_TOUCHING_PX = 16.0
_TOUCHING_M = 0.1
_OVERLAP = 0.5  # of the smaller box: side by side people overlap less
_THROUGH_M = 1.5  # by so much farther back a vehicle may be seen through itself


@dataclass(frozen=True, slots=True, eq=False)
class Boxes:
    """Axis-parallel boxes of R surfaces in the camera frame: low_m (R, 3), high_m (R, 3)."""

    low_m: FloatArray
    high_m: FloatArray


def boxes(regions: Regions) -> Boxes:
    """The boxes that regions fill."""
    half = 0.5 * regions.extent_m
    return Boxes(regions.position_m - half, regions.position_m + half)


def gaps_m(a: Boxes, first: NDArray[np.intp], b: Boxes, second: NDArray[np.intp]) -> FloatArray:
    """(K,) distance between box first[k] of a and box second[k] of b, 0 where they touch; or of any shape
    that first and second are broadcast to."""
    gap = np.maximum(a.low_m[first] - b.high_m[second], b.low_m[second] - a.high_m[first])
    result: FloatArray = np.sqrt(np.square(np.maximum(gap, 0.0)).sum(axis=-1))
    return result


@dataclass(frozen=True, slots=True, eq=False)
class Bodies:
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
    bodies: Bodies,
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
    result[part, track] = _parted(grid, parts, part, main[track + 1])
    return result


def _parted(
    grid: DepthGrid, parts: Regions, one: NDArray[np.intp], other: NDArray[np.intp]
) -> NDArray[np.bool_]:
    """(K,) whether something nearer stands between the middles of parts one[k] and other[k] in the image."""
    inverse = grid.inverse_depth.ravel().take(_cells_between(grid, parts, one, other))
    depth = np.minimum(parts.position_m[one, 2], parts.position_m[other, 2])
    nearer = inverse > 1.0 / np.maximum(depth, 0.1) + NEARER_INVERSE
    result: NDArray[np.bool_] = nearer.sum(axis=0) >= _LEAST_SAMPLES
    return result


def detach(
    winner: NDArray[np.int32], parts: Regions, votes: NDArray[np.intp], expected: NDArray[np.bool_]
) -> NDArray[np.int32]:
    """winner (P,), track index + 1 of each part or 0, without the parts far from the track's main one.

    votes (P,): how many cells spoke for the winner. expected (P, T): parts that stay with it all the same, as
    those do that stand on the main one in the image, or are seen through it, and were its own before.
    """
    owned = np.flatnonzero(winner > 0)
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
    carried = (gap <= _CARRIED_M) & _stacked(own, of)
    carried |= (gap <= _THROUGH_M) & _seen_through(own, of)
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
    of_mover = np.flatnonzero((winner > 0) & np.concatenate(([False], alive))[winner])
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


def merges(
    grid: DepthGrid,
    regions: Regions,
    velocity: FloatArray,
    velocity_sigma: FloatArray,
    mover: NDArray[np.bool_],
    moving: NDArray[np.bool_],
) -> list[tuple[int, int]]:
    """Pairs (small, large) of tracks that may be one body: a suspect or mover beside a larger mover, the
    closest pairs first. A track may be beside several. What begins where another one ends in the image and
    surely goes exactly as that does is carried by it, even if it is farther back: the mast of a cart. What is
    seen through it and surely goes much as it does is its own far side; what is low beside it and does so is
    what it pushes. Pieces of something wider than anybody, that surely go
    exactly alike, are one where nothing is seen between them.

    velocity (T, 3) and velocity_sigma (T,) of the tracks.
    """
    cells, seen = regions.cells, regions.cells > 0
    # Of two that are as large, the later one counts as the smaller.
    smaller = (cells[:, None] < cells) | (
        (cells[:, None] == cells) & np.tri(len(cells), k=-1, dtype=np.bool_)
    )
    a, b = np.nonzero((mover & seen)[:, None] & (moving & seen) & smaller)
    if len(a) == 0:
        return []
    box = boxes(regions)
    difference = np.sqrt(np.square(velocity[a] - velocity[b]).sum(axis=1))
    alike = difference <= _SAME_VELOCITY_MPS + _ALIKE_SIGMAS * np.hypot(velocity_sigma[a], velocity_sigma[b])
    width = np.maximum(box.high_m[a, 0], box.high_m[b, 0]) - np.minimum(box.low_m[a, 0], box.low_m[b, 0])
    overlap = _overlaps(regions.bbox_px[a], regions.bbox_px[b])
    fits = (cells[a] <= _SMALL_SHARE * cells[b]) | (width <= SINGLE_WIDTH_M) | (overlap >= _OVERLAP)
    reach = np.where(overlap >= _OVERLAP, _APART_M, _CLOSE_M)
    known = np.maximum(velocity_sigma[a], velocity_sigma[b]) <= _CARRIED_SIGMA_MPS
    like = known & (difference <= _CARRIED_MPS)
    near = known & (difference <= _SAME_VELOCITY_MPS)
    carried = like & _stacked(regions.bbox_px[a], regions.bbox_px[b])
    through = near & _seen_through(regions.bbox_px[a], regions.bbox_px[b])
    reach = np.where(carried, _CARRIED_M, np.where(through, _THROUGH_M, reach))
    gap = gaps_m(box, a, box, b)
    rows = regions.bbox_px[:, 3] - regions.bbox_px[:, 1]
    fits |= near & (rows[a] <= LOW_BESIDE * rows[b]) & (gap <= _TOUCHING_M)
    one = (gap <= reach) & alike & fits
    wide = np.maximum(regions.extent_m[a, 0], regions.extent_m[b, 0]) > SINGLE_WIDTH_M
    goes = np.square(velocity[b]).sum(axis=1) > _GOES_MPS**2
    pieces = like & goes & wide & (gap <= _CARRIED_M) & ~one
    if pieces.any():
        one |= pieces & ~_seen_between(grid, regions, a, b)
    a, b = a[one], b[one]
    away = np.abs(regions.position_m[a, 2] - regions.position_m[b, 2])
    closest_first = np.lexsort((away, gap[one]))
    return list(zip(a[closest_first].tolist(), b[closest_first].tolist(), strict=True))


def _seen_between(
    grid: DepthGrid, regions: Regions, one: NDArray[np.intp], other: NDArray[np.intp]
) -> NDArray[np.bool_]:
    """(K,) whether something farther is seen between the middles of regions one[k] and other[k]."""
    cells = _cells_between(grid, regions, one, other)
    inverse, beyond = grid.inverse_depth.ravel().take(cells), grid.beyond.ravel().take(cells)
    depth = np.maximum(regions.position_m[one, 2], regions.position_m[other, 2])
    farther = (inverse > 0.0) & (inverse < 1.0 / np.maximum(depth, 0.1) - NEARER_INVERSE)
    result: NDArray[np.bool_] = (farther | beyond).sum(axis=0) >= _LEAST_SAMPLES
    return result


def _cells_between(
    grid: DepthGrid, regions: Regions, one: NDArray[np.intp], other: NDArray[np.intp]
) -> NDArray[np.intp]:
    """(24, K) cells in the image on the way from the middle of region one[k] to that of other[k]."""
    middle = 0.5 * (regions.bbox_px[:, :2] + regions.bbox_px[:, 2:])
    u, v = (k[one] + (k[other] - k[one]) * _ALONG for k in middle.T)
    return grid.cells(u, v)


def join(
    grid: DepthGrid, labels: IntGrid, pairs: list[tuple[int, int]], stayed: BoolGrid, way_m: FloatArray
) -> tuple[IntGrid, list[int]]:
    """labels (h, w), track index + 1, with the small track of a pair given to the large one, and which small
    ones have gone so. Two that would be divided again, for which see split, stay two, and the small one may
    be part of another. way_m (T,) of the tracks since stayed (h, w)."""
    gone: list[int] = []
    for small, large in pairs:
        if small in gone or large in gone:
            continue
        joined = np.where(labels == small + 1, np.int32(large + 1), labels)
        if split(grid, joined, large, stayed, float(way_m[large])) is None:
            labels = joined
            gone.append(small)
    return labels, gone


def _stacked(a: FloatArray, b: FloatArray) -> NDArray[np.bool_]:
    """(K,) whether the lower end of box a[k] is the upper end of box b[k] in the image, for most of the
    width of a[k]; (K, 4) each: u0, v0, u1, v1."""
    shared = np.minimum(a[:, 2], b[:, 2]) - np.maximum(a[:, 0], b[:, 0])
    apart = np.abs(a[:, 3] - b[:, 1])
    result: NDArray[np.bool_] = (shared >= _MOSTLY * (a[:, 2] - a[:, 0])) & (apart <= _TOUCHING_PX)
    return result


def _seen_through(a: FloatArray, b: FloatArray) -> NDArray[np.bool_]:
    """(K,) whether box a[k] lies within box b[k] in the image and is at most half as tall, as nobody behind
    somebody else is; (K, 4) each: u0, v0, u1, v1."""
    low = a[:, 3] - a[:, 1] <= LOW * (b[:, 3] - b[:, 1])
    result: NDArray[np.bool_] = low & (_overlaps(a, b) >= WITHIN)
    return result


def _overlaps(a: FloatArray, b: FloatArray) -> FloatArray:
    """(K,) share of box a[k] that box b[k] covers in the image; (K, 4) each: u0, v0, u1, v1."""
    size = np.minimum(a[:, 2:], b[:, 2:]) - np.maximum(a[:, :2], b[:, :2])
    shared = np.maximum(size, 0.0).prod(axis=1)
    result: FloatArray = shared / np.maximum((a[:, 2:] - a[:, :2]).prod(axis=1), 1.0)
    return result
