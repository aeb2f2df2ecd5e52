"""The depth of anchored ends: its uncertainty, and its running average from frame to frame.

depths_with_sigma gives the depth of each anchor with its standard deviation. static_points makes of this the
points from which the camera's motion is estimated; the residuals use it too (vision/motion/residuals.py).
depth_steps gives the change of depth since the anchor. Once the camera's new pose is known, average_depth
updates the running average of each end's depth, as if the end were static.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise
from hal.compiled import compiled
from hal.records import record
from hal.types import Flags, FloatArray, Pose, Vector
from vision.depth.depth_mask import UNSEEN_M
from vision.depth.depth_noise import depth_sigma_of
from vision.ego_motion.reprojection import Anchors
from vision.fragments.store import AnchorEnds, FragmentStore

# Missing depth is most likely large. With this standard deviation the reprojection error counts across the
# epipolar line only.
_UNSEEN_SIGMA_M = 10.0
_MAX_SAMPLES = 6.0  # length of the running mean in frames; _COMMON_NOISE is why a longer one would not help
# Mean age in frames of the depths in a full running mean: between 2.5 (plain mean of the first 6 frames) and
# 5 (running mean in the long run).
_SETTLED_LATE_FRAMES = 4.0
_COMMON_NOISE = 0.5  # share of the depth noise that successive frames have in common: no mean reduces it
# Gates, each the sum of metres and standard deviations of depth. If near and far differ by less than the
# first, they are one surface. A depth that is off by more than the second is that of another surface.
_MIXED_M, _MIXED_SIGMAS = 0.1, 3.0
_SAME_M, _SAME_SIGMAS = 0.05, 3.0


@record(frozen=True, slots=True, eq=False)
class AnchorDepths:
    """Depths of 2N anchored ends with their uncertainty, (2N,) each.

    near_m: of the near surface; finite everywhere.
    sigma_m: standard deviation of near_m; finite everywhere.
    far_m: of the far surface; finite everywhere.
    known: depth was measured.
    mixed: the surroundings of the end lie on two surfaces.
    """

    near_m: Vector
    sigma_m: Vector
    far_m: Vector
    known: Flags
    mixed: Flags


def depths_with_sigma(anchor: AnchorEnds, noise: DepthNoise) -> AnchorDepths:
    """AnchorDepths of anchor. An end without depth is taken for a distant one whose depth is hardly known."""
    return AnchorDepths(*_with_sigma(anchor, noise))


def static_points(
    anchor: AnchorEnds,
    depths: AnchorDepths,
    pixel_cov: NDArray[np.float32],
    moving: NDArray[np.bool_],
    distant_m: float,
) -> Anchors:
    """The 2N ends as points from which the camera's motion is estimated.

    pixel_cov (N, 2, 3), moving (N,): of the fragments. Ends of moving fragments are not usable. An end on two
    surfaces could be on either, so it is usable only if one of them is farther away than distant_m: then it
    still measures the camera's rotation, across its epipolar line. In a wide hall there may be hardly any
    other ends.
    """
    points_m, sigma_m, definite = _static(anchor, depths, distant_m)
    of_movers = moving.repeat(2)
    return Anchors(
        points_m=points_m,
        range_m=anchor.direction.T,
        depth_sigma_m=sigma_m,
        pixel_cov=pixel_cov.reshape(-1, 3).astype(float),
        usable=definite & ~of_movers,
        left_out=definite & of_movers,
    )


def average_depth(store: FragmentStore, before: AnchorEnds, pose: Pose, noise: DepthNoise) -> None:
    """Predict the depth of every end as if it were static, and average it with the measured depth.

    If the two do not agree, the average begins anew: the end is on another surface, or it moves in depth.
    before: the ends in the frame before. pose: the camera now. Changes depth_m and depth_samples of store.
    """
    store.depth_m, store.depth_samples = _averaged(before, store.near_m, store.depth_samples, pose, noise)


def depth_steps(
    store: FragmentStore, anchor: AnchorEnds, depths: AnchorDepths, static_m: FloatArray, noise: DepthNoise
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """depth_step_m, depth_step_sigma_m and depth_lag_s of EndResiduals (vision/motion/velocities.py).

    static_m (2N, 3): where the ends would be if they were static, in the camera's axes.
    """
    return _steps(anchor, depths, static_m, store.near_m, noise)


@compiled(AnchorEnds, DepthNoise)
def _with_sigma(
    anchor: AnchorEnds, noise: DepthNoise
) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.bool_], NDArray[np.bool_]]:
    """The fields of AnchorDepths."""
    count = len(anchor.depth_m)
    near, sigma, far = np.full(count, UNSEEN_M), np.full(count, _UNSEEN_SIGMA_M), np.full(count, UNSEEN_M)
    known, mixed = np.isfinite(anchor.depth_m), np.zeros(count, np.bool_)
    for k in range(count):
        if known[k]:
            near[k], far[k] = anchor.depth_m[k], anchor.far_m[k]
            single = depth_sigma_of(near[k], noise)
            # The noise of a mean over these frames, part of which they have in common.
            sigma[k] = single * max(1.0 / math.sqrt(max(anchor.depth_samples[k], 1.0)), _COMMON_NOISE)
            mixed[k] = far[k] - near[k] > _MIXED_M + _MIXED_SIGMAS * single
    return near, sigma, far, known, mixed


@compiled(AnchorEnds, AnchorDepths, "float64")
def _static(
    anchor: AnchorEnds, depths: AnchorDepths, distant_m: float
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """points_m and depth_sigma_m of Anchors; (2N,) which ends are on one surface, or measure the rotation."""
    count = len(depths.near_m)
    points_m, sigma_m, definite = np.empty((count, 3)), depths.sigma_m.copy(), np.empty(count, np.bool_)
    for k in range(count):
        near_m, far_m, mixed = depths.near_m[k], depths.far_m[k], depths.mixed[k]
        for i in range(3):
            points_m[k, i] = anchor.direction[i, k] * near_m + anchor.origin[i, k]
        distant = mixed and far_m > distant_m
        if distant:
            sigma_m[k] = max(sigma_m[k], far_m - near_m)
        definite[k] = distant or not mixed
    return points_m, sigma_m, definite


@compiled(AnchorEnds, "float32[:, :], float32[:, :]", Pose, DepthNoise)
def _averaged(
    before: AnchorEnds,
    near_m: NDArray[np.float32],
    depth_samples: NDArray[np.float32],
    pose: Pose,
    noise: DepthNoise,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """depth_m and depth_samples (N, 2) of the store after average_depth."""
    mean_m, new_samples = near_m.copy(), np.ones_like(depth_samples)
    for k in range(len(before.depth_m)):
        predicted_m = 0.0
        for i in range(3):
            there_m = before.direction[i, k] * before.depth_m[k] + before.origin[i, k]
            predicted_m += pose.rotation[i, 2] * (there_m - pose.translation_m[i])
        fragment, end = k // 2, k % 2
        off_m = near_m[fragment, end] - predicted_m
        sigma_m = depth_sigma_of(predicted_m, noise)
        # False where either depth is missing (NaN).
        if abs(off_m) <= _SAME_M + _SAME_SIGMAS * sigma_m:
            new_samples[fragment, end] = min(depth_samples[fragment, end] + 1.0, _MAX_SAMPLES)
            mean_m[fragment, end] = predicted_m + off_m / new_samples[fragment, end]
    return mean_m, new_samples


@compiled(AnchorEnds, AnchorDepths, "float64[:, ::1], float32[:, :]", DepthNoise)
def _steps(
    anchor: AnchorEnds,
    depths: AnchorDepths,
    static_m: FloatArray,
    near_m: NDArray[np.float32],
    noise: DepthNoise,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """depth_step_m, depth_step_sigma_m and depth_lag_s of EndResiduals."""
    count = len(static_m)
    step_m, step_sigma_m, step_lag_s = np.empty(count), np.empty(count), np.empty(count)
    for k in range(count):
        fragment, sigma_m, samples = k // 2, depths.sigma_m[k], anchor.depth_samples[k]
        now_m = np.float64(near_m[fragment, k % 2])
        step_m[k] = now_m - static_m[k, 2]
        known_m = 1.0 if math.isnan(now_m) else now_m
        sigma_now_m = depth_sigma_of(known_m, noise)
        step_sigma_m[k] = math.sqrt(sigma_m * sigma_m + sigma_now_m * sigma_now_m)
        # The averaged depth of the anchor was measured before the anchor's time, on average.
        late_frames = 0.5 * (samples - 1.0) if samples < _MAX_SAMPLES else _SETTLED_LATE_FRAMES
        lag_s = anchor.lag_s[fragment]
        step_lag_s[k] = lag_s + late_frames * (lag_s / anchor.lag_frames[fragment])
    return step_m, step_sigma_m, step_lag_s
