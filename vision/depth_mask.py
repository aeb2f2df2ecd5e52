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
from vision.lens import RealArray

Depths = TypeVar("Depths", NDArray[np.float32], NDArray[np.float64])

_REACH_PX = (-6, -3, 0, 3, 6)
_OFFSETS_U = np.tile(np.array(_REACH_PX), len(_REACH_PX))
_OFFSETS_V = np.repeat(np.array(_REACH_PX), len(_REACH_PX))
_NEAR_RANK = 4  # the 5th nearest of 25 samples: a corner of a body still covers a fifth of them
_MIN_SUPPORT = 4


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceDepth:
    """near_m (N,): depth of the nearest supported surface around each point, NaN where there is none.

    far_m (N,): depth of what lies behind it, equal to near_m where there is one surface only.
    """

    near_m: FloatArray
    far_m: FloatArray


def depth_sigma_m(depth_m: Depths, noise: DepthNoise) -> Depths:
    """One standard deviation of depth (Khoshelham's model, sigma_z ~ z^2, with a floor); float32 stays so."""
    return np.asarray(noise.floor_m + noise.quadratic_per_m * depth_m * depth_m, dtype=depth_m.dtype)


def surface_depth(
    depth: DepthImage,
    scale_m: float,
    pixels: RealArray,
    min_m: float,
    max_m: float,
    noise: DepthNoise,
) -> SurfaceDepth:
    """Near and far surface around pixels (N, 2), within [min_m, max_m] (the paper's 10 m)."""
    height, width = depth.shape
    column = np.rint(pixels[:, 0]).astype(np.intp)[:, None] + _OFFSETS_U
    row = np.rint(pixels[:, 1]).astype(np.intp)[:, None] + _OFFSETS_V
    np.clip(column, 0, width - 1, out=column)
    np.clip(row, 0, height - 1, out=row)
    sample_m = depth.ravel()[row * width + column] * np.float32(scale_m)
    valid = (sample_m >= min_m) & (sample_m <= max_m)
    sample_m[~valid] = np.inf
    ordered = np.sort(sample_m, axis=1)
    count = valid.sum(axis=1)
    # With holes around, the same share of what is valid decides.
    rank = np.minimum(_NEAR_RANK, count // 3)
    anchor_m = ordered[np.arange(len(ordered)), rank]
    with np.errstate(invalid="ignore"):
        gate_m = 0.06 + 3.0 * depth_sigma_m(anchor_m.astype(float), noise)
        is_near = np.abs(ordered - anchor_m[:, None]) <= gate_m[:, None]
    is_far = np.isfinite(ordered) & ~is_near & (ordered > anchor_m[:, None])
    values = np.where(np.isfinite(ordered), ordered, 0.0)
    near_count = is_near.sum(axis=1)
    far_count = is_far.sum(axis=1)
    enough = (count >= _MIN_SUPPORT) & (near_count >= 2)
    near_m = np.where(enough, (values * is_near).sum(axis=1) / np.maximum(near_count, 1), np.nan)
    far_m = np.where(far_count >= 2, (values * is_far).sum(axis=1) / np.maximum(far_count, 1), near_m)
    return SurfaceDepth(near_m, np.where(enough, far_m, np.nan))
