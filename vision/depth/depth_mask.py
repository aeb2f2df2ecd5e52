"""Near and far surface around pixels: the depth of fragments (Daeef 2020, "Filtering featured fragments").

Depth is valid up to 10 m. An edge between a body and its background belongs to the body, but the depth image
is least reliable just there. So depth is read from a small neighbourhood, whose samples form a near surface
and, at a silhouette, a far one as well.

Pixels are handled in lanes, side by side, as the processor computes: sample j of a lane is at
j * _LANES + lane of a flat array.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise, PerceptionConfig
from hal.compiled import compiled, in_place
from hal.records import record
from hal.types import DepthImage, FloatArray
from vision.camera.lens import RealArray
from vision.depth.depth_noise import depth_sigma_of

# 5x5 samples over 13 px: wider than the rim of a few pixels at an edge where depth is wrong.
_REACH_PX, _EVERY_PX, _SAMPLES = 6, 3, 25
_NEAR_RANK = 4  # the 5th nearest of 25 samples: a corner of a body still covers a fifth of them
_MIN_SUPPORT = 4  # minimum of valid samples, of 25: fewer are stray ones
# Samples that are behind the near ones by more than this, the sum of both, are of another surface.
_SAME_M, _SAME_SIGMAS = 0.06, 3.0
_HOLES = 0.25  # share of samples without depth from which on there may be another, unseen surface
_LANES = 32  # pixels handled at a time
UNSEEN_M = 12.0  # assumed depth of an unseen surface
_CUT_OFF = np.iinfo(np.uint16).max  # raw depth that stands for this distance and all larger ones


@record(frozen=True, slots=True, eq=False)
class SurfaceDepth:
    """Surfaces around N pixels.

    near_m (N,): depth of the nearest supported surface, NaN where there is none.
    far_m (N,): depth of the surface behind it; equal to near_m where there is one surface only. Where many of
    the samples have no depth, there may be another surface, and it is UNSEEN_M or more.
    holes (N,): share of the samples without depth.
    """

    near_m: FloatArray
    far_m: FloatArray
    holes: FloatArray


def measurable_m(max_m: float, scale_m: float) -> float:
    """Maximum depth that is measured: max_m, or less if 16 bits in units of scale_m do not reach that far."""
    return min(max_m, (_CUT_OFF - 0.5) * scale_m)


def surface_depth(
    depth: DepthImage, scale_m: float, pixels: RealArray, config: PerceptionConfig
) -> SurfaceDepth:
    """Near and far surface around pixels (N, 2) of depth (H, W), in units of scale_m.

    The near one is within [min_depth_m, max_depth_m] (the paper's 10 m). The far one may be beyond: the
    texture of a distant wall disturbs an outline as much as that of a near one.
    """
    near_m, far_m, holes = _surfaces(
        np.ascontiguousarray(depth),
        np.ascontiguousarray(pixels, np.float64),
        np.float32(scale_m),
        np.float32(config.min_depth_m),
        np.float32(measurable_m(config.max_depth_m, scale_m)),
        config.depth_noise,
    )
    return SurfaceDepth(near_m, far_m, holes)


@in_place
def _note_raw(depth: DepthImage, u: float, v: float, lane: int, raw: DepthImage) -> None:
    """Put the samples around a pixel into its lane of raw; shifted inwards at the border of the image."""
    height, width = depth.shape
    column = min(max(int(np.rint(u)), _REACH_PX), width - 1 - _REACH_PX)
    row = min(max(int(np.rint(v)), _REACH_PX), height - 1 - _REACH_PX)
    for i in range(-_REACH_PX, _REACH_PX + 1, _EVERY_PX):
        for j in range(-_REACH_PX, _REACH_PX + 1, _EVERY_PX):
            raw[lane] = depth[row + i, column + j]
            lane += _LANES


@in_place
def _to_metres(
    raw: DepthImage, scale_m: np.float32, min_m: np.float32, sample_m: NDArray[np.float32]
) -> None:
    """Put raw depths in metres into sample_m; NaN where they are not valid."""
    for k in range(len(raw)):
        one_m = np.float32(raw[k]) * scale_m
        sample_m[k] = one_m if one_m >= min_m else np.float32(np.nan)


@in_place
def _count(sample_m: NDArray[np.float32], most_m: np.float32, count: NDArray[np.int32]) -> None:
    """Put the number of samples up to most_m of each lane into count (_LANES,)."""
    count[:] = 0
    for j in range(_SAMPLES):
        for lane in range(_LANES):
            count[lane] += np.int32(sample_m[j * _LANES + lane] <= most_m)


@in_place
def _note_nearest(sample_m: NDArray[np.float32], nearest_m: NDArray[np.float32]) -> None:
    """Put the nearest samples of each lane, in ascending order, into nearest_m (_NEAR_RANK + 1, _LANES)."""
    nearest_m[:] = np.inf
    for j in range(_SAMPLES):
        for lane in range(_LANES):
            # Insertion without a branch.
            farther_m = sample_m[j * _LANES + lane]
            for place in range(lane, (_NEAR_RANK + 1) * _LANES, _LANES):
                held_m = nearest_m[place]
                nearest_m[place] = farther_m if farther_m < held_m else held_m
                farther_m = held_m if farther_m < held_m else farther_m


@in_place
def _add_near(
    sample_m: NDArray[np.float32],
    max_m: np.float32,
    anchor_m: NDArray[np.float32],
    gate_m: NDArray[np.float32],
    total_m: FloatArray,
    count: NDArray[np.int32],
) -> None:
    """Put sum and number of the samples of each lane that lie at anchor_m, (_LANES,) each."""
    total_m[:], count[:] = 0.0, 0
    for j in range(_SAMPLES):
        for lane in range(_LANES):
            one_m = sample_m[j * _LANES + lane]
            near = (abs(one_m - anchor_m[lane]) <= gate_m[lane]) & (one_m <= max_m)
            total_m[lane] += float(one_m) if near else 0.0
            count[lane] += np.int32(near)


@in_place
def _add_far(
    sample_m: NDArray[np.float32],
    anchor_m: NDArray[np.float32],
    gate_m: NDArray[np.float32],
    total_m: FloatArray,
    count: NDArray[np.int32],
) -> None:
    """Put sum and number of the samples of each lane that lie behind anchor_m, (_LANES,) each."""
    total_m[:], count[:] = 0.0, 0
    for j in range(_SAMPLES):
        for lane in range(_LANES):
            one_m = sample_m[j * _LANES + lane]
            far = one_m - anchor_m[lane] > gate_m[lane]
            total_m[lane] += float(one_m) if far else 0.0
            count[lane] += np.int32(far)


@compiled("uint16[:, ::1], float64[:, ::1], float32, float32, float32", DepthNoise)
def _surfaces(
    depth: DepthImage,
    pixels: FloatArray,
    scale_m: np.float32,
    min_m: np.float32,
    max_m: np.float32,
    noise: DepthNoise,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """near_m, far_m and holes of SurfaceDepth. max_m: of the near surface."""
    count = len(pixels)
    near_m, far_m, holes = np.full(count, np.nan), np.full(count, np.nan), np.empty(count)
    raw, sample_m = np.zeros(_SAMPLES * _LANES, np.uint16), np.empty(_SAMPLES * _LANES, np.float32)
    nearest_m = np.empty((_NEAR_RANK + 1) * _LANES, np.float32)
    anchor_m, gate_m = np.empty(_LANES, np.float32), np.empty(_LANES, np.float32)
    near_total_m, far_total_m = np.empty(_LANES), np.empty(_LANES)
    near_count, far_count = np.empty(_LANES, np.int32), np.empty(_LANES, np.int32)
    measured, within = np.empty(_LANES, np.int32), np.empty(_LANES, np.int32)
    for first in range(0, count, _LANES):
        lanes = min(_LANES, count - first)
        for lane in range(lanes):
            k = first + lane
            _note_raw(depth, pixels[k, 0], pixels[k, 1], lane, raw)
        _to_metres(raw, scale_m, min_m, sample_m)
        _count(sample_m, np.float32(np.inf), measured)
        _count(sample_m, max_m, within)
        _note_nearest(sample_m, nearest_m)
        for lane in range(_LANES):
            # With many holes the rank is lowered to a third of the valid samples.
            rank = min(_NEAR_RANK, within[lane] // 3)
            anchor_m[lane] = nearest_m[rank * _LANES + lane]
            gate_m[lane] = _SAME_M + _SAME_SIGMAS * depth_sigma_of(anchor_m[lane], noise)
        _add_near(sample_m, max_m, anchor_m, gate_m, near_total_m, near_count)
        _add_far(sample_m, anchor_m, gate_m, far_total_m, far_count)
        for lane in range(lanes):
            k = first + lane
            holes[k] = 1.0 - measured[lane] / _SAMPLES
            if within[lane] < _MIN_SUPPORT or near_count[lane] < 2:
                continue
            near_m[k] = near_total_m[lane] / near_count[lane]
            far_m[k] = far_total_m[lane] / far_count[lane] if far_count[lane] >= 2 else near_m[k]
            if holes[k] >= _HOLES:
                far_m[k] = max(far_m[k], UNSEEN_M)
    return near_m, far_m, holes
