"""Merging of two tracks that are one body: pairs_to_merge finds the pairs, merge_labels relabels their cells.

Each of the four rules looks at all pairs of a suspect or mover and a larger moving track at once. Called by
vision/bodies/regrouping.py, before division. Terms: vision/__init__.py.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled
from hal.records import record
from hal.types import FloatArray
from vision.bodies.boxes import boxes, farther_between, nearer_between, relations
from vision.bodies.division import second_body
from vision.bodies.sizes import SINGLE_WIDTH_M
from vision.depth.connected import IntGrid
from vision.depth.depth_grid import BoolGrid, DepthGrid
from vision.depth.regions import Regions

BoolArray = NDArray[np.bool_]

# Maximum gaps between two tracks, in space.
_CLOSE_M = 0.25  # where depth is missing beside a body
_CLOSE_OVERLAPPING_M = 0.40  # where one is seen in front of the other
_PIECES_M = 0.8  # between the edges of a vehicle's plain side, on which depth sees nothing
_FAR_END_M = 2.0  # between a vehicle's near side and its far end: the width of a van
_HIDDEN_M = 1.3  # between the halves of a vehicle: what hides its middle is not larger
_FAR_END_PX = 32.0  # maximum width of what is seen of that end, which stereo matching widens by 8 to 10 px
_SMALL_SHARE = 0.5  # of the larger track's cells: with more, the smaller one is a body of its own
_TINY_SHARE = 0.1  # of the larger track's cells: a dog beside its owner has more
_OVERLAP = 0.5  # of the smaller box: people side by side overlap less
_SAME_DEPTH_M = 0.4  # maximum difference in depth of two halves
_MIN_OVERLAP_SHARE = 0.5  # of the lower half's height, which the other one has beside it
_HALVES_MPS = 0.6  # maximum difference of the halves' velocities
_HALVES_SHARE = 0.6  # the same, as a share of the slower one's speed
_EQUAL_MPS = 0.25  # maximum difference in velocity of the parts of a rigid thing
_CLOSE_MPS = 0.4  # maximum difference in velocity of two parts of one body, besides noise
_KNOWN_SIGMA_MPS = 0.35  # with a larger standard deviation no two velocities are surely alike
_COMPATIBLE_SIGMAS = 2.0  # more difference for noise: a shank that stands, or swings, on a body that moves
_BY_ITSELF_S = 1.0  # a limb or a piece is seldom a mover of its own for longer
_MIN_MOVING_MPS = 0.3  # a slower track moves like anything static


@record(frozen=True, slots=True, eq=False)
class _Pairs:
    """K pairs of a smaller and a larger track, (K,) each.

    small_px, large_px: their boxes in the image, u0, v0, u1, v1, (K, 4).
    gap_m: see Relations.
    away_m: difference of their depths.
    farther: the small one is farther away.
    overlapping: at least half of the small box is within the large one in the image.
    size_plausible: by their sizes they could be one body.
    tiny: the small one is, compared with the large one.
    wide: one of the two is wider than a person.
    by_itself: the small one has long moved as a track of its own.
    moves: the large one does, faster than anything static seems to.
    slower_mps: speed of the slower one.
    differ_mps: difference of their velocities.
    velocities_compatible: their velocities do not contradict each other.
    velocities_equal: their velocities are well known, and differ by _EQUAL_MPS at most.
    """

    small_px: FloatArray
    large_px: FloatArray
    gap_m: FloatArray
    away_m: FloatArray
    farther: BoolArray
    overlapping: BoolArray
    size_plausible: BoolArray
    tiny: BoolArray
    wide: BoolArray
    by_itself: BoolArray
    moves: BoolArray
    slower_mps: FloatArray
    differ_mps: FloatArray
    velocities_compatible: BoolArray
    velocities_equal: BoolArray


def pairs_to_merge(
    grid: DepthGrid,
    regions: Regions,
    velocity_mps: FloatArray,
    sigma_mps: FloatArray,
    mover: BoolArray,
    moving: BoolArray,
    moving_s: FloatArray,
) -> list[tuple[int, int]]:
    """Pairs (small, large) of tracks that may be one body, the closest pairs first.

    The small one is a suspect or mover (mover (T,)); the large one moves by the verdict (moving (T,)). One
    track may be in several pairs. velocity_mps (T, 3), sigma_mps (T,): of the tracks. moving_s (T,): for how
    long they have been moving by the verdict.
    """
    small, large = _candidates(regions.cells, mover, moving)
    if len(small) == 0:
        return []
    pairs = _paired(regions, velocity_mps, sigma_mps, moving_s >= _BY_ITSELF_S, small, large)
    one = _beside(pairs)
    halves = _halves(pairs) & ~one
    if halves.any():
        halves &= nearer_between(grid, regions, small, large)
    of_vehicle = (_piece(pairs) | _far_end(pairs) | halves) & ~one
    if of_vehicle.any():
        one |= of_vehicle & ~farther_between(grid, regions, small, large)
    small, large = small[one], large[one]
    closest_first = np.lexsort((pairs.away_m[one], pairs.gap_m[one]))
    return list(zip(small[closest_first].tolist(), large[closest_first].tolist(), strict=True))


@compiled("int64[::1], boolean[:], boolean[:]")
def _candidates(
    cells: NDArray[np.intp], mover: BoolArray, moving: BoolArray
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """All pairs of a mover (T,) and a larger moving track (T,), both seen, as indices (K,) and (K,)."""
    count, pairs = len(cells), 0
    small, large = np.empty(count * count, np.intp), np.empty(count * count, np.intp)
    for one in range(count):
        for other in range(count):
            # Of two equally large tracks, the later one counts as the smaller.
            smaller = cells[one] < cells[other] or (cells[one] == cells[other] and other < one)
            if cells[one] > 0 and mover[one] and moving[other] and smaller:
                small[pairs], large[pairs] = one, other
                pairs += 1
    return small[:pairs], large[:pairs]


def _paired(
    regions: Regions,
    velocity_mps: FloatArray,
    sigma_mps: FloatArray,
    by_itself: BoolArray,
    small: NDArray[np.intp],
    large: NDArray[np.intp],
) -> _Pairs:
    box, cells = boxes(regions), regions.cells
    squared_mps = np.square(velocity_mps).sum(axis=1)
    differ_mps = np.sqrt(np.square(velocity_mps[small] - velocity_mps[large]).sum(axis=1))
    spread = np.hypot(sigma_mps[small], sigma_mps[large])
    known = np.maximum(sigma_mps[small], sigma_mps[large]) <= _KNOWN_SIGMA_MPS
    right_m = np.maximum(box.high_m[small, 0], box.high_m[large, 0])
    left_m = np.minimum(box.low_m[small, 0], box.low_m[large, 0])
    relation = relations(regions, small, large)
    behind_m = regions.position_m[small, 2] - regions.position_m[large, 2]
    overlapping = relation.overlap >= _OVERLAP
    person_width = right_m - left_m <= SINGLE_WIDTH_M
    return _Pairs(
        small_px=regions.bbox_px[small],
        large_px=regions.bbox_px[large],
        gap_m=relation.gap_m,
        away_m=np.abs(behind_m),
        farther=behind_m > 0.0,
        overlapping=overlapping,
        size_plausible=(cells[small] <= _SMALL_SHARE * cells[large]) | person_width | overlapping,
        tiny=cells[small] <= _TINY_SHARE * cells[large],
        wide=np.maximum(regions.extent_m[small, 0], regions.extent_m[large, 0]) > SINGLE_WIDTH_M,
        by_itself=by_itself[small],
        moves=squared_mps[large] > _MIN_MOVING_MPS**2,
        slower_mps=np.sqrt(np.minimum(squared_mps[small], squared_mps[large])),
        differ_mps=differ_mps,
        velocities_compatible=differ_mps <= _CLOSE_MPS + _COMPATIBLE_SIGMAS * spread,
        velocities_equal=known & (differ_mps <= _EQUAL_MPS),
    )


def _beside(pairs: _Pairs) -> BoolArray:
    """(K,) a small track close to a mover, with a velocity that does not contradict.

    Noise is no excuse for a small one that has long moved by itself: it is mostly somebody who passes.
    """
    reach_m = np.where(pairs.overlapping, _CLOSE_OVERLAPPING_M, _CLOSE_M)
    alike = pairs.velocities_compatible & (~pairs.by_itself | (pairs.differ_mps <= _CLOSE_MPS))
    return alike & pairs.size_plausible & (pairs.gap_m <= reach_m)


def _piece(pairs: _Pairs) -> BoolArray:
    """(K,) a piece of a vehicle wider than a person, with exactly the same velocity.

    They are one body if nothing farther is seen between them: of the plain side of a vehicle a depth camera
    sees only the edges. Whoever walks beside a low vehicle is taller in the image than it.
    """
    rows, rows_beside = (px[:, 3] - px[:, 1] for px in (pairs.small_px, pairs.large_px))
    rigid = pairs.wide & pairs.moves & pairs.velocities_equal
    return rigid & (rows <= rows_beside) & (pairs.gap_m <= _PIECES_M)


def _far_end(pairs: _Pairs) -> BoolArray:
    """(K,) the far end of a vehicle wider than a person: a tiny strip, farther away, beside its near side.

    The side in between is seen so aslant that depth shows no surface there. Beyond its end stereo matching
    gives the end's depth to some pixels of the background. Their velocities do not contradict each other.
    They are one body if nothing farther is seen between them.
    """
    small_px, large_px = pairs.small_px, pairs.large_px
    strip = small_px[:, 2] - small_px[:, 0] <= _FAR_END_PX
    strip &= (small_px[:, 1] >= large_px[:, 1]) & (small_px[:, 3] <= large_px[:, 3])
    of_vehicle = pairs.tiny & pairs.farther & pairs.wide & pairs.moves
    return strip & of_vehicle & pairs.velocities_compatible & (pairs.gap_m <= _FAR_END_M)


def _halves(pairs: _Pairs) -> BoolArray:
    """(K,) halves of a vehicle behind a pillar: wider than a person, side by side at one depth.

    Their velocities do not contradict each other. They are one body if something nearer, and nothing farther,
    is seen between them.
    """
    most_mps = np.minimum(_HALVES_MPS, _HALVES_SHARE * pairs.slower_mps)
    alike = pairs.velocities_compatible & (pairs.differ_mps <= most_mps)
    close = _side_by_side(pairs) & (pairs.away_m <= _SAME_DEPTH_M) & (pairs.gap_m <= _HIDDEN_M)
    return alike & close & (pairs.slower_mps > _MIN_MOVING_MPS) & pairs.wide


def _side_by_side(pairs: _Pairs) -> BoolArray:
    """(K,) pairs whose boxes share much of the lower one's rows in the image."""
    small, large = pairs.small_px[:, 1::2], pairs.large_px[:, 1::2]
    shared_px = np.minimum(small[:, 1], large[:, 1]) - np.maximum(small[:, 0], large[:, 0])
    lower_px = np.minimum(small[:, 1] - small[:, 0], large[:, 1] - large[:, 0])
    result: BoolArray = shared_px >= _MIN_OVERLAP_SHARE * lower_px
    return result


def merge_labels(
    grid: DepthGrid,
    labels: IntGrid,
    pairs: list[tuple[int, int]],
    stayed: BoolGrid,
    displacement_m: FloatArray,
) -> tuple[IntGrid, list[int]]:
    """labels (h, w), track index + 1, with the small track of each pair joined to the large one.

    Also returns the indices of the small tracks that are gone. Two tracks that second_body would divide again
    stay two; the small one may still be joined to another track. stayed (h, w), displacement_m (T,): see
    second_body.
    """
    gone: list[int] = []
    for small, large in pairs:
        if small in gone or large in gone:
            continue
        joined = np.where(labels == small + 1, np.int32(large + 1), labels)
        if second_body(grid, joined, large, stayed, float(displacement_m[large])) is None:
            labels = joined
            gone.append(small)
    return labels, gone
