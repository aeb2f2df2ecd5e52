"""Segments found in an image become new fragments: their ends must be trackable, their depth on one surface.

Used by vision/fragments/renewal.py and attention.py.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise, FragmentSettings, PerceptionConfig
from hal.compiled import compiled, inlined
from hal.records import record
from hal.types import FloatArray, RgbdFrame
from vision.depth.depth_mask import SurfaceDepth, surface_depth
from vision.depth.depth_noise import depth_sigma_of
from vision.fragments.edges import GreyImage
from vision.fragments.segments import SNAP_PX, smaller_eigenvalue, snap_to_corners

_TAKEN_PX = 6  # size of a place: about half a search window, since closer ends would track the same pixels
# Image noise of 3 grey levels adds this to both eigenvalues of the structure tensor over 7x7 px.
_NOISE_STRUCTURE = np.float32(220.0)
_MIN_STRUCTURE = np.float32(3.0)  # minimum of either eigenvalue, at which an end is known to 3.5 px
_STAIRS = np.float32(0.05)  # share of the larger eigenvalue that a coarsely sampled edge adds to the smaller
_MATCH_VARIANCE = np.float32(6.0**2)  # of grey levels between two images of the same patch
_HALF = np.float32(0.5)
_SAME_M, _SAME_SIGMAS = 0.05, 3.0  # added, the gate on depth: the surface is uneven, and depth is noisy
_PLACES = 5  # number of points along a segment, evenly from end to end, at which its depth is read


@record(frozen=True, slots=True, eq=False)
class NewFragments:
    """N new fragments.

    ends_px: (N, 2, 2).
    near_m, far_m: depth at the ends, (N, 2).
    pixel_cov: xx, xy, yy of one flow step at each end, px^2, (N, 2, 3).
    """

    ends_px: NDArray[np.float32]
    near_m: NDArray[np.float32]
    far_m: NDArray[np.float32]
    pixel_cov: NDArray[np.float32]

    def select(self, wanted: NDArray[np.bool_]) -> NewFragments:
        """The fragments that are wanted (N,)."""
        if wanted.all():
            return self
        return NewFragments(
            self.ends_px[wanted], self.near_m[wanted], self.far_m[wanted], self.pixel_cov[wanted]
        )


NOTHING_NEW = NewFragments(
    np.empty((0, 2, 2), np.float32),
    np.empty((0, 2), np.float32),
    np.empty((0, 2), np.float32),
    np.empty((0, 2, 3), np.float32),
)


def joined(first: NewFragments, second: NewFragments) -> NewFragments:
    """The fragments of both."""
    return NewFragments(
        np.concatenate((first.ends_px, second.ends_px)),
        np.concatenate((first.near_m, second.near_m)),
        np.concatenate((first.far_m, second.far_m)),
        np.concatenate((first.pixel_cov, second.pixel_cov)),
    )


def trackable_segments(
    grey: GreyImage,
    segments_px: NDArray[np.float32],
    ends_px: NDArray[np.float32],
    min_distance_px: float,
    min_eigenvalue: float = 0.0,
    reach_px: int = SNAP_PX,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The trackable segments among segments_px (N, 2, 2), with their ends moved to corners within reach_px.

    A segment is kept if its ends are at least min_distance_px apart, if no present fragment, ends_px
    (K, 2, 2), and no better segment has an end in the same place, and if the smaller eigenvalue of the
    structure tensor is at least min_eigenvalue at both ends. Returns the segments (M, 2, 2), those with the
    largest such eigenvalue first, and the structure tensor at their ends (M, 2, 3).
    """
    snapped, tensor = snap_to_corners(grey, segments_px, reach_px)
    height, width = grey.shape
    present = np.ascontiguousarray(ends_px)
    return _best_trackable(snapped, tensor, present, height, width, min_distance_px, min_eigenvalue)


def depth_along(segments_px: NDArray[np.float32], frame: RgbdFrame, config: PerceptionConfig) -> SurfaceDepth:
    """Near and far surface at 5 points along each of segments (N, 2, 2), from end to end: (N, 5) each."""
    points_px = _points_along(np.ascontiguousarray(segments_px))
    found = surface_depth(frame.depth, frame.depth_scale_m, points_px, config)
    return SurfaceDepth(*(part.reshape(-1, _PLACES) for part in (found.near_m, found.far_m, found.holes)))


def on_one_surface(near_m: FloatArray, config: PerceptionConfig) -> NDArray[np.bool_]:
    """(N,) whether segments with near_m (N, 5), as from depth_along, lie on one surface.

    Inverse depth is linear along a segment on one plane; across a depth edge it jumps.
    """
    return _on_one_surface(np.ascontiguousarray(near_m), config.depth_noise)


def new_fragments(
    picked: NDArray[np.intp],
    segments_px: NDArray[np.float32],
    tensor: NDArray[np.float32],
    surface: SurfaceDepth,
    settings: FragmentSettings,
) -> NewFragments:
    """The fragments of the segments picked (M,), from the results of trackable_segments and depth_along."""
    floor_px2 = np.float32(settings.pixel_sigma_px**2)
    return NewFragments(*_fragments(picked, segments_px, tensor, surface.near_m, surface.far_m, floor_px2))


@inlined
def _eigenvalues(uu: np.float32, uv: np.float32, vv: np.float32) -> tuple[np.float32, np.float32]:
    """Mean of the two eigenvalues of a structure tensor, and half of their difference."""
    half_difference = _HALF * (uu - vv)
    return _HALF * (uu + vv), np.sqrt(half_difference * half_difference + uv * uv)


@inlined
def _take(taken: NDArray[np.bool_], end_px: NDArray[np.float32]) -> bool:
    """Whether the place of an end (2,) was free; marks it as taken. Places are clamped to the image."""
    share = np.float32(1.0 / _TAKEN_PX)
    row = min(max(int(end_px[1] * share), 0), taken.shape[0] - 1)
    column = min(max(int(end_px[0] * share), 0), taken.shape[1] - 1)
    free = not taken[row, column]
    taken[row, column] = True
    return free


@compiled("float32[:, :, ::1], float32[:, :, ::1], float32[:, :, ::1], int64, int64, float64, float64")
def _best_trackable(
    segments_px: NDArray[np.float32],
    tensor: NDArray[np.float32],
    ends_px: NDArray[np.float32],
    height: int,
    width: int,
    min_distance_px: float,
    min_eigenvalue: float,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """As trackable_segments, for segments whose ends have been moved to corners already."""
    taken = np.zeros((height // _TAKEN_PX + 1, width // _TAKEN_PX + 1), np.bool_)
    for n in range(len(ends_px)):
        _take(taken, ends_px[n, 0])
        _take(taken, ends_px[n, 1])
    eigenvalue = np.full(len(segments_px), np.float32(np.inf))
    for n in range(len(segments_px)):
        for end in range(2):
            uu, uv, vv = tensor[n, end, 0], tensor[n, end, 1], tensor[n, end, 2]
            eigenvalue[n] = min(eigenvalue[n], smaller_eigenvalue(uu, uv, vv))
    wanted, count = np.empty(len(segments_px), np.intp), 0
    for n in np.argsort(-eigenvalue, kind="mergesort"):  # mergesort is stable
        first, second = _take(taken, segments_px[n, 0]), _take(taken, segments_px[n, 1])
        du = segments_px[n, 0, 0] - segments_px[n, 1, 0]
        dv = segments_px[n, 0, 1] - segments_px[n, 1, 1]
        apart = np.sqrt(du * du + dv * dv) >= min_distance_px
        if first and second and apart and eigenvalue[n] >= min_eigenvalue:
            wanted[count] = n
            count += 1
    return segments_px[wanted[:count]], tensor[wanted[:count]]


@compiled("float32[:, :, ::1]")
def _points_along(segments_px: NDArray[np.float32]) -> NDArray[np.float32]:
    """(5N, 2) pixels along segments (N, 2, 2), from end to end."""
    result = np.empty((len(segments_px) * _PLACES, 2), np.float32)
    for n in range(len(segments_px)):
        for k in range(2):
            begin, end = segments_px[n, 0, k], segments_px[n, 1, k]
            for place in range(_PLACES):
                result[n * _PLACES + place, k] = begin + (end - begin) * np.float32(place / (_PLACES - 1))
    return result


@compiled("float64[:, ::1]", DepthNoise)
def _on_one_surface(near_m: FloatArray, noise: DepthNoise) -> NDArray[np.bool_]:
    """As on_one_surface."""
    result = np.empty(len(near_m), np.bool_)
    for n in range(len(near_m)):
        begin, end = 1.0 / near_m[n, 0], 1.0 / near_m[n, -1]
        missing, jumps = 0, np.isnan(begin) or np.isnan(end)
        for place in range(1, _PLACES - 1):
            expected_m = 1.0 / (begin + (end - begin) * (place / (_PLACES - 1)))
            gate_m = _SAME_M + _SAME_SIGMAS * depth_sigma_of(expected_m, noise)
            if np.isnan(near_m[n, place]):
                missing += 1
            elif not abs(near_m[n, place] - expected_m) <= gate_m:
                jumps = True
        # One of the three inner points may have no depth.
        result[n] = not jumps and missing <= 1
    return result


@inlined
def _flow_covariance(
    uu: np.float32, uv: np.float32, vv: np.float32, floor_px2: np.float32
) -> tuple[np.float32, np.float32, np.float32]:
    """Covariance xx, xy, yy of one flow step from the structure tensor; large along an edge.

    Image noise adds to both eigenvalues. The stair steps of a strong, coarsely sampled edge add to the
    smaller one, but they wander along the edge as it turns. Both contributions are subtracted first, or an
    end on a straight edge would seem as well held along the edge as across it.
    """
    middle, radius = _eigenvalues(uu, uv, vv)
    larger = max(middle + radius - _NOISE_STRUCTURE, _MIN_STRUCTURE)
    smaller = max(middle - radius - _NOISE_STRUCTURE - _STAIRS * larger, _MIN_STRUCTURE)
    # The inverse has the same axes and the inverse eigenvalues.
    across, along = _MATCH_VARIANCE / larger, _MATCH_VARIANCE / smaller
    mean, spread = _HALF * (across + along), _HALF * (across - along)
    scale = spread / max(radius, np.float32(1e-6))
    half_difference = _HALF * (uu - vv)
    return mean + scale * half_difference + floor_px2, scale * uv, mean - scale * half_difference + floor_px2


@compiled(
    "int64[:], float32[:, :, ::1], float32[:, :, ::1], float64[:, ::1], float64[:, ::1], float32",
)
def _fragments(
    picked: NDArray[np.intp],
    segments_px: NDArray[np.float32],
    tensor: NDArray[np.float32],
    near_m: FloatArray,
    far_m: FloatArray,
    floor_px2: np.float32,
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """ends_px, near_m, far_m, pixel_cov of NewFragments."""
    count = len(picked)
    ends_px, covariance = np.empty((count, 2, 2), np.float32), np.empty((count, 2, 3), np.float32)
    near, far = np.empty((count, 2), np.float32), np.empty((count, 2), np.float32)
    for n in range(count):
        one = picked[n]
        for end in range(2):
            place = end * (_PLACES - 1)
            near[n, end], far[n, end] = near_m[one, place], far_m[one, place]
            ends_px[n, end, 0], ends_px[n, end, 1] = segments_px[one, end, 0], segments_px[one, end, 1]
            uu, uv, vv = tensor[one, end, 0], tensor[one, end, 1], tensor[one, end, 2]
            xx, xy, yy = _flow_covariance(uu, uv, vv, floor_px2)
            covariance[n, end, 0], covariance[n, end, 1], covariance[n, end, 2] = xx, xy, yy
    return ends_px, near, far, covariance
