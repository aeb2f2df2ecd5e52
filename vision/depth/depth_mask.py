"""The depth of fragments: valid up to 10 m (Daeef 2020, "Filtering featured fragments"), nearer surface.

An edge that separates a body from what is behind it belongs to the body; the depth image is least
trustworthy just there. So depth is read from a small neighbourhood: its samples fall into a near
surface and, at a silhouette, a far one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise
from hal.types import DepthImage, FloatArray
from vision.camera.lens import RealArray

Depths = TypeVar("Depths", NDArray[np.float32], NDArray[np.float64])

_REACH_PX = np.array((-6, -3, 0, 3, 6))  # 13 px across: beyond the rim of some pixels where depth is wrong
_NEAR_RANK = 4  # the 5th nearest of 25 samples: a corner of a body still covers a fifth of them
_MIN_SUPPORT = 4  # of 25 samples: fewer are stray ones
_NO_DATA_M = np.float32(1e6)  # sorts behind everything that is valid
_HOLES = 0.25  # of the surroundings: so much without depth may be another surface
UNSEEN_M = 12.0  # how far that is taken to be
_CUT_OFF = np.iinfo(np.uint16).max  # what is as far as this, or farther


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceDepth:
    """near_m (N,): depth of the nearest supported surface around each point, NaN where there is none.

    far_m (N,): depth of what lies behind it, equal to near_m where there is one surface only. Where much of
    the surroundings has no depth, another surface may be there: then it is UNSEEN_M or more.
    holes (N,): share of the surroundings without any depth, where it is not known what lies there.
    """

    near_m: FloatArray
    far_m: FloatArray
    holes: FloatArray


def depth_sigma_m(depth_m: Depths, noise: DepthNoise) -> Depths:
    """One standard deviation of depth (Khoshelham's model, sigma_z ~ z^2, with a floor); float32 stays so."""
    sigma_m: Depths = noise.floor_m + noise.quadratic_per_m * depth_m * depth_m
    return sigma_m


def measurable_m(max_m: float, scale_m: float) -> float:
    """How far surfaces are measured: up to max_m, or, with a small unit scale_m, as far as 16 bits go."""
    return min(max_m, (_CUT_OFF - 0.5) * scale_m)


def surface_depth(
    depth: DepthImage,
    scale_m: float,
    pixels: RealArray,
    min_m: float,
    max_m: float,
    noise: DepthNoise,
) -> SurfaceDepth:
    """Near and far surface around pixels (N, 2), the near one within [min_m, max_m] (the paper's 10 m).

    The far one may be beyond: the texture of a distant wall mixes with an outline as that of a near one does.
    """
    sample_m = _samples(depth, pixels) * np.float32(scale_m)
    sample_m[sample_m < min_m] = _NO_DATA_M
    # One column per point: sums over the samples then run along the memory.
    ordered = np.ascontiguousarray(np.sort(sample_m, axis=1).T)
    within, measured = ordered <= measurable_m(max_m, scale_m), ordered < _NO_DATA_M
    count = _count(within)
    # With holes around, the same share of what is valid decides.
    rank = np.minimum(_NEAR_RANK, count // 3)
    anchor_m = ordered[rank, np.arange(len(rank))]
    gate_m = (0.06 + 3.0 * depth_sigma_m(anchor_m.astype(float), noise)).astype(np.float32)
    behind_m = ordered - anchor_m
    is_near = (np.abs(behind_m) <= gate_m) & within
    is_far = (behind_m > gate_m) & measured
    near_count, far_count = _count(is_near), _count(is_far)
    near_m = _sum(ordered, is_near) / np.maximum(near_count, 1)
    far_m = _sum(ordered, is_far) / np.maximum(far_count, 1)
    near_m[(count < _MIN_SUPPORT) | (near_count < 2)] = np.nan
    far_m = np.where((far_count >= 2) & (near_m == near_m), far_m, near_m)
    holes = 1.0 - _count(measured) / len(measured)
    far_m = np.where((holes >= _HOLES) & (near_m == near_m), np.maximum(far_m, UNSEEN_M), far_m)
    return SurfaceDepth(near_m, far_m, holes)


def _samples(depth: DepthImage, pixels: RealArray) -> DepthImage:
    """(N, 25) raw depth around pixels (N, 2); close to the border they lie to one side, within the image."""
    height, width = depth.shape
    centre = np.rint(pixels).astype(np.intp)
    reach = int(_REACH_PX[-1])
    column = np.minimum(np.maximum(centre[:, 0], reach), width - 1 - reach)
    row = np.minimum(np.maximum(centre[:, 1], reach), height - 1 - reach)
    around = (_REACH_PX[:, None] * width + _REACH_PX).ravel()
    samples: DepthImage = depth.ravel().take((row * width + column)[:, None] + around)
    return samples


def _count(chosen: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """(N,) how many of the samples (25, N) are chosen."""
    result: NDArray[np.uint8] = np.add.reduce(chosen.view(np.uint8), axis=0, dtype=np.uint8)
    return result


def _sum(depth_m: NDArray[np.float32], chosen: NDArray[np.bool_]) -> FloatArray:
    """(N,) sum of the chosen ones of the samples (25, N)."""
    result: FloatArray = np.add.reduce(depth_m * chosen, axis=0, dtype=np.float64)
    return result
