"""The depth of anchored ends: what it is good for, and how it is averaged from frame to frame.

Depth is averaged over the frames as if an end stood still (average_depth), and told with what is known of its
doubt (appraise): from this follow the points that the camera's motion is found by (static_points) and the
residuals (vision/motion/evidence.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise
from hal.compiled import compiled
from hal.types import FloatArray, Pose
from vision.depth.depth_mask import UNSEEN_M
from vision.depth.depth_noise import depth_sigma_of
from vision.ego_motion.reprojection import Anchors
from vision.fragments.store import AnchorEnds, FragmentStore

# Where depth is missing it is most likely great; the reprojection then counts across the epipolar line only.
_UNSEEN_SIGMA_M = 10.0
_MOST_LOOKS = 6.0  # a running mean over so many; what they share does not average out, see below
_SETTLED_LATE_FRAMES = 4.0  # between the plain mean of the first looks and the running one: 2.5 to 5
_COMMON_NOISE = 0.5  # of depth: what neighbouring frames share, and no mean takes off
_MIXED_SIGMAS = 3.0  # of depth, and 0.1 m: less is one surface


@dataclass(frozen=True, slots=True, eq=False)
class AnchorDepths:
    """What the depths (2N,) of anchored ends are good for: near_m, sigma_m and far_m are finite throughout,
    known tells where they were measured; mixed, where the end lies on two surfaces."""

    near_m: FloatArray
    sigma_m: FloatArray
    far_m: FloatArray
    known: NDArray[np.bool_]
    mixed: NDArray[np.bool_]


def appraise(anchor: AnchorEnds, noise: DepthNoise) -> AnchorDepths:
    """Where depth is missing, the end is taken for a distant one whose depth is hardly known."""
    return AnchorDepths(
        *_appraised(
            np.ascontiguousarray(anchor.depth_m),
            np.ascontiguousarray(anchor.far_m),
            np.ascontiguousarray(anchor.looks),
            UNSEEN_M,
            noise.floor_m,
            noise.quadratic_per_m,
        )
    )


def static_points(
    anchor: AnchorEnds,
    depths: AnchorDepths,
    pixel_cov: NDArray[np.float32],
    moving: NDArray[np.bool_],
    distant_m: float,
) -> Anchors:
    """The 2N ends as points to find the camera by. pixel_cov (N, 2, 3) and moving (N,) of the fragments.

    An end on two surfaces could be on either. Where one of them is farther than distant_m away, it tells of
    the camera's turn all the same: across its epipolar line. In a wide hall hardly any others may be left.
    """
    points_m, sigma_m, usable = _static(
        np.ascontiguousarray(anchor.direction),
        np.ascontiguousarray(anchor.origin),
        depths.near_m,
        depths.sigma_m,
        depths.far_m,
        depths.mixed,
        np.ascontiguousarray(moving),
        distant_m,
    )
    return Anchors(
        points_m=points_m,
        range_m=anchor.direction.T,
        depth_sigma_m=sigma_m,
        pixel_cov=pixel_cov.reshape(-1, 3).astype(float),
        usable=usable,
    )


def average_depth(store: FragmentStore, before: AnchorEnds, pose: Pose, noise: DepthNoise) -> None:
    """Carry the depth of every end on as if it were static, and average it with what is measured now.

    A measurement that does not fit begins anew: another surface, or something that moves in depth.
    before: the ends in the frame before. pose: the camera now.
    """
    store.depth_m, store.looks = _averaged(
        np.ascontiguousarray(before.direction),
        np.ascontiguousarray(before.origin),
        np.ascontiguousarray(before.depth_m),
        np.ascontiguousarray(store.near_m),
        np.ascontiguousarray(store.looks),
        np.ascontiguousarray(pose.rotation),
        np.ascontiguousarray(pose.translation_m),
        noise.floor_m,
        noise.quadratic_per_m,
    )


def depth_steps(
    store: FragmentStore, anchor: AnchorEnds, depths: AnchorDepths, static_m: FloatArray, noise: DepthNoise
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """depth_step_m, depth_step_sigma_m and depth_lag_s of PointMotion (vision/motion/velocities.py), from
    where the ends would be if they were static, static_m (2N, 3), in the camera's axes."""
    return _steps(
        static_m,
        depths.sigma_m,
        np.ascontiguousarray(store.near_m),
        np.ascontiguousarray(anchor.looks),
        anchor.lag_frames,
        np.ascontiguousarray(anchor.lag_s),
        noise.floor_m,
        noise.quadratic_per_m,
    )


@compiled("float64[::1], float64[::1], float64[::1], float64, float64, float64")
def _appraised(
    depth_m: FloatArray,
    far_m: FloatArray,
    looks: FloatArray,
    unseen_m: float,
    floor_m: float,
    quadratic_per_m: float,
) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.bool_], NDArray[np.bool_]]:
    """The fields of AnchorDepths."""
    count = len(depth_m)
    near, sigma, far = np.full(count, unseen_m), np.full(count, _UNSEEN_SIGMA_M), np.full(count, unseen_m)
    known, mixed = np.isfinite(depth_m), np.zeros(count, np.bool_)
    for k in range(count):
        if known[k]:
            near[k], far[k] = depth_m[k], far_m[k]
            single = depth_sigma_of(depth_m[k], floor_m, quadratic_per_m)
            # What is left of the noise, which is alike in part, after so many frames.
            sigma[k] = single * max(1.0 / math.sqrt(max(looks[k], 1.0)), _COMMON_NOISE)
            mixed[k] = far[k] - near[k] > 0.1 + _MIXED_SIGMAS * single
    return near, sigma, far, known, mixed


@compiled(
    "float64[:, ::1], float64[:, ::1], float64[::1], float64[::1], float64[::1], bool[::1], bool[::1],"
    " float64"
)
def _static(
    direction: FloatArray,
    origin: FloatArray,
    near_m: FloatArray,
    sigma_m: FloatArray,
    far_m: FloatArray,
    mixed: NDArray[np.bool_],
    moving: NDArray[np.bool_],
    distant_m: float,
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """points_m, depth_sigma_m and usable of Anchors."""
    count = len(near_m)
    points_m, doubt_m, usable = np.empty((count, 3)), sigma_m.copy(), np.empty(count, np.bool_)
    for k in range(count):
        for i in range(3):
            points_m[k, i] = direction[i, k] * near_m[k] + origin[i, k]
        distant = mixed[k] and far_m[k] > distant_m
        if distant:
            doubt_m[k] = max(sigma_m[k], far_m[k] - near_m[k])
        usable[k] = (distant or not mixed[k]) and not moving[k // 2]
    return points_m, doubt_m, usable


@compiled(
    "float64[:, ::1], float64[:, ::1], float64[::1], float32[:, ::1], float32[:, ::1], float64[:, ::1],"
    " float64[::1], float64, float64"
)
def _averaged(
    direction: FloatArray,
    origin: FloatArray,
    depth_m: FloatArray,
    near_m: NDArray[np.float32],
    looks: NDArray[np.float32],
    rotation: FloatArray,
    translation_m: FloatArray,
    floor_m: float,
    quadratic_per_m: float,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """depth_m and looks (N, 2), as average_depth leaves them."""
    mean_m, new_looks = near_m.copy(), np.ones_like(looks)
    for k in range(len(depth_m)):
        carried_m = 0.0
        for i in range(3):
            carried_m += rotation[i, 2] * (direction[i, k] * depth_m[k] + origin[i, k] - translation_m[i])
        fragment, end = k // 2, k % 2
        off_m = near_m[fragment, end] - carried_m
        # Not where either is missing.
        if abs(off_m) <= 0.05 + 3.0 * depth_sigma_of(carried_m, floor_m, quadratic_per_m):
            new_looks[fragment, end] = min(looks[fragment, end] + 1.0, _MOST_LOOKS)
            mean_m[fragment, end] = carried_m + off_m / new_looks[fragment, end]
    return mean_m, new_looks


@compiled(
    "float64[:, ::1], float64[::1], float32[:, ::1], float64[::1], int64[::1], float64[::1], float64, float64"
)
def _steps(
    static_m: FloatArray,
    sigma_m: FloatArray,
    near_m: NDArray[np.float32],
    looks: FloatArray,
    lag_frames: NDArray[np.intp],
    lag_s: FloatArray,
    floor_m: float,
    quadratic_per_m: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """depth_step_m, depth_step_sigma_m and depth_lag_s of PointMotion."""
    count = len(static_m)
    step_m, step_sigma_m, step_lag_s = np.empty(count), np.empty(count), np.empty(count)
    for k in range(count):
        fragment = k // 2
        now_m = np.float64(near_m[fragment, k % 2])
        step_m[k] = now_m - static_m[k, 2]
        sigma_now_m = depth_sigma_of(1.0 if math.isnan(now_m) else now_m, floor_m, quadratic_per_m)
        step_sigma_m[k] = math.sqrt(sigma_m[k] * sigma_m[k] + sigma_now_m * sigma_now_m)
        # The averaged depth of the anchor was measured before the anchor's time, on average.
        late_frames = 0.5 * (looks[k] - 1.0) if looks[k] < _MOST_LOOKS else _SETTLED_LATE_FRAMES
        step_lag_s[k] = lag_s[fragment] + late_frames * (lag_s[fragment] / lag_frames[fragment])
    return step_m, step_sigma_m, step_lag_s
