"""Merging of two tracks that are one body: merges finds the pairs, join relabels their cells.

Each rule looks at all pairs of a suspect or mover and a larger moving track at once. vision/tracker.py calls
this after grounding and before division. Terms: vision/__init__.py.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray
from vision.bodies.boxes import LEAST_SAMPLES, LOAD_M, THROUGH_M, boxes, cells_between, relations
from vision.bodies.division import LOW_BESIDE, NEARER_INVERSE, SINGLE_WIDTH_M, split
from vision.bodies.grouping import something_nearer_between
from vision.depth.connected import IntGrid
from vision.depth.depth_grid import BoolGrid, DepthGrid
from vision.depth.regions import Regions

BoolArray = NDArray[np.bool_]

# Maximum gaps between two tracks, in space: where depth is missing beside a body; more where one is seen in
# front of the other; where only noise separates the two; and between the edges of a vehicle's plain side, on
# which depth sees nothing.
_CLOSE_M, _CLOSE_OVERLAPPING_M, _TOUCHING_M, _PIECES_M = 0.25, 0.40, 0.1, 0.8
# Maximum gap and difference in depth of pieces one above the other: what hides the middle is not larger.
_PARTED_M, _SAME_DEPTH_M = 1.0, 0.4
_HIDDEN_M = 1.3  # maximum gap between the halves of a vehicle: what hides its middle is not larger
# Maximum difference of the halves' velocities: this, and this share of the slower one's speed.
_HALVES_MPS, _HALVES_SHARE = 0.6, 0.6
# Of two pieces above each other this share of the narrower width has to overlap; of two halves side by side,
# this share of the lower height.
_OVER = 0.5
_SMALL_SHARE = 0.5  # of the larger track's cells: with more, the smaller one is a body of its own
_TINY_SHARE = 0.1  # of the larger track's cells: a dog beside its owner has more
_OVERLAP = 0.5  # of the smaller box: people side by side overlap less
_EXACTLY_MPS, _MUCH_MPS = 0.25, 0.4  # maximum difference in velocity of parts, of surfaces, of a rigid thing
_KNOWN_SIGMA_MPS = 0.35  # with a larger standard deviation no two velocities are surely alike
_ALIKE_SIGMAS = 2.0  # more difference for noise: a shank that stands, or swings, on a body that moves
_GOES_MPS = 0.3  # a slower track moves like anything static


@dataclass(frozen=True, slots=True, eq=False)
class _Pairs:
    """K pairs of a smaller and a larger track, (K,) each.

    small, large: their indices.
    small_px, large_px: their boxes in the image, u0, v0, u1, v1, (K, 4).
    gap_m, stacked, within: see Relations.
    overlapping: at least half of the small box is within the large one in the image.
    fits: by their sizes they could be one body.
    slim: together they are no wider than a single person.
    perhaps_alike: their velocities do not contradict each other.
    much_alike, exactly_alike: their velocities are well known, and differ by _MUCH_MPS or _EXACTLY_MPS at
        most.
    """

    small: NDArray[np.intp]
    large: NDArray[np.intp]
    small_px: FloatArray
    large_px: FloatArray
    gap_m: FloatArray
    stacked: BoolArray
    within: BoolArray
    overlapping: BoolArray
    fits: BoolArray
    slim: BoolArray
    perhaps_alike: BoolArray
    much_alike: BoolArray
    exactly_alike: BoolArray


def merges(
    grid: DepthGrid,
    regions: Regions,
    velocity_mps: FloatArray,
    sigma_mps: FloatArray,
    mover: BoolArray,
    moving: BoolArray,
) -> list[tuple[int, int]]:
    """Pairs (small, large) of tracks that may be one body, the closest pairs first.

    The small one is a suspect or mover (mover (T,)); the large one moves by the verdict (moving (T,)). One
    track may be in several pairs. velocity_mps (T, 3), sigma_mps (T,): of the tracks.
    """
    small, large = _candidates(regions.cells, mover, moving)
    if len(small) == 0:
        return []
    pairs = _paired(regions, velocity_mps, sigma_mps, small, large)
    one = _beside(pairs) | _carried(pairs) | _seen_through(pairs) | _pushed(pairs)
    one |= _tiny(pairs, regions.cells, velocity_mps)
    halves = _halves(pairs, regions, velocity_mps) & ~one
    if halves.any():
        halves &= something_nearer_between(grid, regions, small, large)
    pieces = (_pieces(pairs, regions, velocity_mps) | _above(pairs, regions) | halves) & ~one
    if pieces.any():
        one |= pieces & ~_seen_between(grid, regions, small, large)
    small, large = small[one], large[one]
    away = np.abs(regions.position_m[small, 2] - regions.position_m[large, 2])
    closest_first = np.lexsort((away, pairs.gap_m[one]))
    return list(zip(small[closest_first].tolist(), large[closest_first].tolist(), strict=True))


def _candidates(
    cells: NDArray[np.intp], mover: BoolArray, moving: BoolArray
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """All pairs of a mover (T,) and a larger moving track (T,), both seen, as indices (K,) and (K,)."""
    seen = cells > 0
    # Of two equally large tracks, the later one counts as the smaller.
    smaller = (cells[:, None] < cells) | (
        (cells[:, None] == cells) & np.tri(len(cells), k=-1, dtype=np.bool_)
    )
    small, large = np.nonzero((mover & seen)[:, None] & (moving & seen) & smaller)
    return small, large


def _paired(
    regions: Regions,
    velocity_mps: FloatArray,
    sigma_mps: FloatArray,
    small: NDArray[np.intp],
    large: NDArray[np.intp],
) -> _Pairs:
    box, cells = boxes(regions), regions.cells
    small_px, large_px = regions.bbox_px[small], regions.bbox_px[large]
    difference = np.sqrt(np.square(velocity_mps[small] - velocity_mps[large]).sum(axis=1))
    spread = np.hypot(sigma_mps[small], sigma_mps[large])
    known = np.maximum(sigma_mps[small], sigma_mps[large]) <= _KNOWN_SIGMA_MPS
    right_m = np.maximum(box.high_m[small, 0], box.high_m[large, 0])
    left_m = np.minimum(box.low_m[small, 0], box.low_m[large, 0])
    lie = relations(regions, small, large)
    overlapping = lie.overlap >= _OVERLAP
    slim = right_m - left_m <= SINGLE_WIDTH_M
    return _Pairs(
        small,
        large,
        small_px,
        large_px,
        gap_m=lie.gap_m,
        stacked=lie.stacked,
        within=lie.within,
        overlapping=overlapping,
        fits=(cells[small] <= _SMALL_SHARE * cells[large]) | slim | overlapping,
        slim=slim,
        perhaps_alike=difference <= _MUCH_MPS + _ALIKE_SIGMAS * spread,
        much_alike=known & (difference <= _MUCH_MPS),
        exactly_alike=known & (difference <= _EXACTLY_MPS),
    )


def _beside(pairs: _Pairs) -> BoolArray:
    """(K,) a small track close to a mover, with a velocity that does not contradict."""
    reach_m = np.where(pairs.overlapping, _CLOSE_OVERLAPPING_M, _CLOSE_M)
    return pairs.perhaps_alike & pairs.fits & (pairs.gap_m <= reach_m)


def _carried(pairs: _Pairs) -> BoolArray:
    """(K,) a load on its carrier, even if it is farther back, as the mast of a cart is."""
    return pairs.stacked & pairs.exactly_alike & pairs.fits & (pairs.gap_m <= LOAD_M)


def _seen_through(pairs: _Pairs) -> BoolArray:
    """(K,) the far side of a vehicle, seen through it, with much the same velocity."""
    return pairs.within & pairs.much_alike & (pairs.gap_m <= THROUGH_M)


def _pushed(pairs: _Pairs) -> BoolArray:
    """(K,) a trolley: low beside a mover, touching it, with much the same velocity."""
    rows, rows_beside = (px[:, 3] - px[:, 1] for px in (pairs.small_px, pairs.large_px))
    return pairs.much_alike & (rows <= LOW_BESIDE * rows_beside) & (pairs.gap_m <= _TOUCHING_M)


def _tiny(pairs: _Pairs, cells: NDArray[np.intp], velocity_mps: FloatArray) -> BoolArray:
    """(K,) a wheel of a cart: tiny compared with the mover, close to it, with exactly the same velocity."""
    goes = np.square(velocity_mps[pairs.large]).sum(axis=1) > _GOES_MPS**2
    tiny = cells[pairs.small] <= _TINY_SHARE * cells[pairs.large]
    result: BoolArray = tiny & goes & pairs.exactly_alike & (pairs.gap_m <= _PIECES_M)
    return result


def _pieces(pairs: _Pairs, regions: Regions, velocity_mps: FloatArray) -> BoolArray:
    """(K,) pieces of a vehicle: wider than a person, with exactly the same velocity.

    They are one body if nothing farther is seen between them: of the plain side of a vehicle a depth camera
    sees only the edges.
    """
    goes = np.square(velocity_mps[pairs.large]).sum(axis=1) > _GOES_MPS**2
    result: BoolArray = pairs.exactly_alike & goes & _wide(pairs, regions) & (pairs.gap_m <= _PIECES_M)
    return result


def _halves(pairs: _Pairs, regions: Regions, velocity_mps: FloatArray) -> BoolArray:
    """(K,) halves of a vehicle behind a pillar: wider than a person, side by side at one depth.

    Their velocities do not contradict each other. They are one body if something nearer, and nothing farther,
    is seen between them.
    """
    small_px, large_px = pairs.small_px, pairs.large_px
    shared_px = np.minimum(small_px[:, 3], large_px[:, 3]) - np.maximum(small_px[:, 1], large_px[:, 1])
    lower_px = np.minimum(small_px[:, 3] - small_px[:, 1], large_px[:, 3] - large_px[:, 1])
    differ_mps = np.sqrt(np.square(velocity_mps[pairs.small] - velocity_mps[pairs.large]).sum(axis=1))
    speed_mps = np.sqrt(np.square(velocity_mps).sum(axis=1))
    slower_mps = np.minimum(speed_mps[pairs.small], speed_mps[pairs.large])
    alike = pairs.perhaps_alike & (differ_mps <= np.minimum(_HALVES_MPS, _HALVES_SHARE * slower_mps))
    away_m = np.abs(regions.position_m[pairs.small, 2] - regions.position_m[pairs.large, 2])
    close = (shared_px >= _OVER * lower_px) & (away_m <= _SAME_DEPTH_M) & (pairs.gap_m <= _HIDDEN_M)
    result: BoolArray = alike & close & (slower_mps > _GOES_MPS) & _wide(pairs, regions)
    return result


def _wide(pairs: _Pairs, regions: Regions) -> BoolArray:
    """(K,) whether one of the two is wider than a person."""
    widest_m = np.maximum(regions.extent_m[pairs.small, 0], regions.extent_m[pairs.large, 0])
    result: BoolArray = widest_m > SINGLE_WIDTH_M
    return result


def _above(pairs: _Pairs, regions: Regions) -> BoolArray:
    """(K,) pieces of a person, one above the other, together no wider than a person.

    Their velocities do not contradict each other. They are one body if nothing farther is seen between them.
    """
    small_px, large_px = pairs.small_px, pairs.large_px
    shared_px = np.minimum(small_px[:, 2], large_px[:, 2]) - np.maximum(small_px[:, 0], large_px[:, 0])
    narrower_px = np.minimum(small_px[:, 2] - small_px[:, 0], large_px[:, 2] - large_px[:, 0])
    away_m = np.abs(regions.position_m[pairs.small, 2] - regions.position_m[pairs.large, 2])
    over = (shared_px >= _OVER * narrower_px) & (away_m <= _SAME_DEPTH_M) & (pairs.gap_m <= _PARTED_M)
    result: BoolArray = over & pairs.slim & pairs.perhaps_alike
    return result


def _seen_between(
    grid: DepthGrid, regions: Regions, one: NDArray[np.intp], other: NDArray[np.intp]
) -> NDArray[np.bool_]:
    """(K,) whether something farther is seen between the middles of regions one[k] and other[k]."""
    cells = cells_between(grid, regions, one, other)
    inverse, beyond = grid.inverse_depth.ravel().take(cells), grid.beyond.ravel().take(cells)
    depth = np.maximum(regions.position_m[one, 2], regions.position_m[other, 2])
    farther = (inverse > 0.0) & (inverse < 1.0 / np.maximum(depth, 0.1) - NEARER_INVERSE)
    result: NDArray[np.bool_] = (farther | beyond).sum(axis=0) >= LEAST_SAMPLES
    return result


def join(
    grid: DepthGrid, labels: IntGrid, pairs: list[tuple[int, int]], stayed: BoolGrid, way_m: FloatArray
) -> tuple[IntGrid, list[int]]:
    """labels (h, w), track index + 1, with the small track of each pair joined to the large one.

    Also returns the indices of the small tracks that are gone. Two tracks that split would divide again stay
    two; the small one may still be joined to another track. stayed (h, w), way_m (T,): see split.
    """
    gone: list[int] = []
    for small, large in pairs:
        if small in gone or large in gone:
            continue
        joined = np.where(labels == small + 1, np.int32(large + 1), labels)
        if split(grid, joined, large, stayed, float(way_m[large])) is None:
            labels = joined
            gone.append(small)
    return labels, gone
