"""Assignment of fragments to tracks: each to the track on whose visible surface, at whose depth, it lies.

It runs after the cells have been assigned to tracks. Terms (fragment, surface, track): vision/__init__.py.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise
from hal.compiled import compiled
from hal.types import FloatArray
from vision.bodies.tracks import Tracks
from vision.depth.cells import cell_at
from vision.depth.connected import IntGrid
from vision.depth.depth_grid import DepthGrid
from vision.depth.depth_noise import depth_sigma_of
from vision.detection import Detection
from vision.motion.moving_fragments import long_static
from vision.numerics.order import index_of

# Places where the label of a fragment's body is looked up: at these shares of its length; three of them above
# it, since the cells of a lower edge are those of the floor; the last two beside it, since an outline lies on
# the rim, where the cells may be those of the body behind.
_ALONG = np.array([0.5, 0.15, 0.85, 0.5, 0.15, 0.85, 0.5, 0.5])
_ABOVE_PX = np.array([0.0, 0.0, 0.0, 8.0, 8.0, 8.0, 0.0, 0.0])
_BESIDE_PX = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -8.0, 8.0])
_ON_IT = 6  # the first 6 places are on or above the fragment: at least one of these has to agree in depth
_MIN_GATE_M = 0.3  # gate on depth, plus two sigmas: an outline may be as far back as the side of the body
_SAME_DEPTH_M = 0.05  # plus one sigma: smaller differences in depth do not count, since no surface is even
_NEARER = 0.1  # cost per metre of distance, in metres of difference in depth: prefers nearer bodies


@compiled("int64[::1], int64[::1], int64[::1], int64[::1]")
def inherited(
    known: NDArray[np.int64], owner: NDArray[np.int64], ids: NDArray[np.int64], tracks: NDArray[np.int64]
) -> NDArray[np.int64]:
    """(N,) id of the track that each fragment of ids (N,) belonged to in the frame before, -1 for none.

    known (M,), owner (M,): ids of the fragments then, and of their tracks. tracks (T,): ids of the present
    tracks. ids, known and tracks are in ascending order.
    """
    result = np.full(len(ids), -1, np.int64)
    for k in range(len(ids)):
        place = index_of(known, ids[k])
        if place >= 0 and index_of(tracks, owner[place]) >= 0:
            result[k] = owner[place]
    return result


def adopt(
    tracks: Tracks, detection: Detection, labels: IntGrid, owner: NDArray[np.int64], noise: DepthNoise
) -> NDArray[np.int64]:
    """(N,) id of the track that each fragment of detection belongs to, -1 for none.

    labels (h, w): track index + 1 of each cell. owner (N,): ids of the tracks in the frame before. A fragment
    that has been static for a while, on the floor or a wall, is not given to a mover that passes by.
    """
    if len(tracks) == 0 or len(owner) == 0:
        return np.full(len(owner), -1, np.int64)
    age_s: FloatArray = np.multiply(detection.age_frames, detection.dt_s, dtype=np.float64)
    is_long_static = long_static(detection.motion, age_s)
    return _adopted(detection, detection.grid, labels, tracks, is_long_static, owner, noise)


@compiled(Detection, DepthGrid, "int32[:, ::1]", Tracks, "boolean[:], int64[::1]", DepthNoise)
def _adopted(
    detection: Detection,
    grid: DepthGrid,
    labels: IntGrid,
    tracks: Tracks,
    is_long_static: NDArray[np.bool_],
    owner: NDArray[np.int64],
    noise: DepthNoise,
) -> NDArray[np.int64]:
    """As adopt. is_long_static (N,): fragments that have been static for a while."""
    ends_px, near_m = detection.ends_px, detection.near_m
    result = np.full(len(ends_px), -1, np.int64)
    for k in range(len(ends_px)):
        own_m = float(np.fmin(near_m[k, 0], near_m[k, 1]))
        u, v = float(ends_px[k, 0, 0]), float(ends_px[k, 0, 1])
        across, down = float(ends_px[k, 1, 0]) - u, float(ends_px[k, 1, 1]) - v
        sigma_m = depth_sigma_of(own_m, noise)
        track, least, on_it = -1, np.inf, False
        for i in range(len(_ALONG)):
            there_u, there_v = u + across * _ALONG[i] + _BESIDE_PX[i], v + down * _ALONG[i] - _ABOVE_PX[i]
            row, column = cell_at(grid, there_u, there_v)
            there_m = grid.depth_m[row, column]
            gap_m = abs(there_m - own_m)
            if labels[row, column] == 0 or not gap_m <= _MIN_GATE_M + 2.0 * sigma_m:
                continue
            on_it = on_it or i < _ON_IT
            # Of two bodies at one place in the image, take the one at the depth of the fragment. Where noise
            # hides the difference take the nearer one, since an outline belongs to the body in front.
            off = max(gap_m - _SAME_DEPTH_M - sigma_m, 0.0) + np.float32(_NEARER) * there_m
            if off < least:
                track, least = labels[row, column] - 1, off
        if on_it and not (is_long_static[k] and tracks.moving[track] and tracks.ids[track] != owner[k]):
            result[k] = tracks.ids[track]
    return result
