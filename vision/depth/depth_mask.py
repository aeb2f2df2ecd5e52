"""Near and far surface around pixels: the depth of fragments (Daeef 2020, "Filtering featured fragments").

Depth is valid up to 10 m. An edge between a body and its background belongs to the body, but the depth image
is least reliable just there. So depth is read from a small neighbourhood, whose samples form a near surface
and, at a silhouette, a far one as well.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise, PerceptionConfig
from hal.compiled import compiled, inlined
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


@inlined
def _samples(
    depth: DepthImage,
    u: float,
    v: float,
    scale_m: np.float32,
    min_m: np.float32,
    into_m: NDArray[np.float32],
) -> int:
    """Put the valid samples around a pixel at the start of into_m (_SAMPLES,); returns how many there are.

    Close to the border of the image the samples are shifted inwards.
    """
    height, width = depth.shape
    column = min(max(int(np.rint(u)), _REACH_PX), width - 1 - _REACH_PX)
    row = min(max(int(np.rint(v)), _REACH_PX), height - 1 - _REACH_PX)
    count = 0
    for i in range(row - _REACH_PX, row + _REACH_PX + 1, _EVERY_PX):
        for j in range(column - _REACH_PX, column + _REACH_PX + 1, _EVERY_PX):
            into_m[count] = depth[i, j] * scale_m
            count += into_m[count] >= min_m
    return count


@inlined
def _note_nearest(sample_m: NDArray[np.float32], count: int, nearest_m: NDArray[np.float32]) -> None:
    """Put the nearest of the first count samples, in ascending order, into nearest_m (_NEAR_RANK + 1,)."""
    nearest_m[:] = np.inf
    for j in range(count):
        # Insertion without a branch, since mispredicted branches take longer.
        farther_m = sample_m[j]
        for place in range(_NEAR_RANK + 1):
            held_m = nearest_m[place]
            nearest_m[place] = held_m if held_m < farther_m else farther_m
            farther_m = farther_m if held_m < farther_m else held_m


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
    sample_m, nearest_m = np.empty(_SAMPLES, np.float32), np.empty(_NEAR_RANK + 1, np.float32)
    for k in range(count):
        measured = _samples(depth, pixels[k, 0], pixels[k, 1], scale_m, min_m, sample_m)
        holes[k] = 1.0 - measured / _SAMPLES
        within = 0
        for j in range(measured):
            within += sample_m[j] <= max_m
        if within < _MIN_SUPPORT:
            continue
        _note_nearest(sample_m, measured, nearest_m)
        # With many holes the rank is lowered to a third of the valid samples.
        anchor_m = nearest_m[min(_NEAR_RANK, within // 3)]
        gate_m = np.float32(_SAME_M + _SAME_SIGMAS * depth_sigma_of(anchor_m, noise))
        near_sum, near_count, far_sum, far_count = 0.0, 0, 0.0, 0
        for j in range(measured):
            behind_m = sample_m[j] - anchor_m
            far = behind_m > gate_m
            near = (abs(behind_m) <= gate_m) & (sample_m[j] <= max_m)
            far_sum += float(sample_m[j]) if far else 0.0
            near_sum += float(sample_m[j]) if near else 0.0
            far_count += far
            near_count += near
        if near_count < 2:
            continue
        near_m[k] = near_sum / near_count
        far_m[k] = far_sum / far_count if far_count >= 2 else near_m[k]
        if holes[k] >= _HOLES:
            far_m[k] = max(far_m[k], UNSEEN_M)
    return near_m, far_m, holes
