"""Residual of every fragment end (end point of a fragment) against the prediction that it is static.

The prediction: where the end would be now if it had stayed at its anchor, by the camera's own motion. The
residual (innovation): how far from there it is seen, with its covariance and chi-square (PointMotion). The
ends that are not known to move also give the points that the camera's motion is found by (static_points) and
the scale of the noise (observed_variance_scale). The evidence of tracks, which rests on these residuals among
other things, is in vision/motion/motion_evidence.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise
from hal.types import FloatArray, Intrinsics, Pose
from vision.depth.depth_mask import UNSEEN_M, depth_sigma_m
from vision.ego_motion.camera_motion import CameraEstimate
from vision.ego_motion.reprojection import Anchors
from vision.ego_motion.rolling_shutter import straight_rays
from vision.fragments.store import AnchorEnds, FragmentStore
from vision.motion.velocities import PointMotion, chi2_2d
from vision.numerics.order import quantile

# Where depth is missing it is most likely great; the reprojection then counts across the epipolar line only.
_UNSEEN_SIGMA_M = 10.0
_SETTLED_FRAMES = 3  # younger ends are hardly farther from their anchors than the noise
_LEAST_ENDS = 16  # a third of fewer tells no scale
_CHI2_THIRD = 0.811  # a third of static ends, 2 degrees of freedom, lies below
_SCALE_GAIN = 0.15  # of what is new in each frame: half of it in four, as the floor or the light changes
# Sigmas of 0.55 to 2.8 times the assumed ones: beyond that it is something else than noise.
_LEAST_SCALE = 0.3
_MOST_SCALE = 8.0
_STEPS_SHARE = 0.5  # flow errors of successive frames cancel in part
_MOST_LOOKS = 6.0  # a running mean over so many; what they share does not average out, see below
_SETTLED_LATE_FRAMES = 4.0  # between the plain mean of the first looks and the running one: 2.5 to 5
_COMMON_NOISE = 0.5  # of depth: what neighbouring frames share, and no mean takes off
_MIXED_SIGMAS = 3.0  # of depth, and 0.1 m: less is one surface
_STATIC_CHI2 = 6.0  # 95 % of static ends, 2 degrees of freedom, lie below
_MIXED_ALONG_PX = 3.0  # how far an end slides along a fragment at least, where two surfaces cross
_MIXED_ACROSS_PX = 0.3  # across it: twice what a clear end is known to


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
    known = np.isfinite(anchor.depth_m)
    near_m = np.where(known, anchor.depth_m, UNSEEN_M)
    far_m = np.where(known, anchor.far_m, UNSEEN_M)
    single = depth_sigma_m(near_m, noise)
    sigma_m = np.where(known, single * _averaged(anchor.looks), _UNSEEN_SIGMA_M)
    return AnchorDepths(
        near_m=near_m,
        sigma_m=sigma_m,
        far_m=far_m,
        known=known,
        mixed=far_m - near_m > 0.1 + _MIXED_SIGMAS * single,
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
    distant = depths.mixed & (depths.far_m > distant_m)
    between_m = np.where(distant, depths.far_m - depths.near_m, 0.0)
    return Anchors(
        points_m=(anchor.direction * depths.near_m + anchor.origin).T,
        range_m=anchor.direction.T,
        depth_sigma_m=np.maximum(depths.sigma_m, between_m),
        pixel_cov=pixel_cov.reshape(-1, 3).astype(float),
        usable=~((depths.mixed & ~distant) | moving.repeat(2)),
    )


def residuals(
    store: FragmentStore,
    anchor: AnchorEnds,
    depths: AnchorDepths,
    now: CameraEstimate,
    camera: Intrinsics,
    noise: DepthNoise,
    variance_scale: float,
) -> PointMotion:
    """Of the 2N ends in store, from their anchors and the camera's pose now.

    variance_scale: how much larger the variance of static ends has been found than it was assumed.
    """
    turn = now.pose.rotation.T
    direction = turn @ anchor.direction
    origin = turn @ (anchor.origin - now.pose.translation_m[:, None])
    ray = straight_rays(store.ends_px.reshape(-1, 2), camera, now.sweep_rad).T[:2]
    # Near and far surface at once, in the middle index: (3, 2, 2N), (2, 2, 2N).
    surfaces = np.empty((2, len(depths.near_m)))
    surfaces[0], surfaces[1] = depths.near_m, depths.far_m
    static = direction[:, None] * surfaces + origin[:, None]
    miss = ray[:, None] * static[2] - static[:2]
    sigma = np.empty((2, len(depths.near_m)))
    sigma[0], sigma[1] = depths.sigma_m, depth_sigma_m(depths.far_m, noise)
    effect = (ray * direction[2] - direction[:2])[:, None] * (sigma * math.sqrt(variance_scale))
    depth = static[2, 0]
    in_front = depth > 0.1
    squared = np.square(depth)
    per_pixel = np.array([[1.0 / camera.fx**2], [1.0 / (camera.fx * camera.fy)], [1.0 / camera.fy**2]])
    passing = static[:2, 1] / np.maximum(static[2, 1], 0.1) - static[:2, 0] / np.maximum(depth, 0.1)
    passing *= np.array([[camera.fx], [camera.fy]])
    covariance = _pixel_covariance(store, anchor, depths.mixed, passing)
    covariance *= per_pixel * (variance_scale * squared)
    covariance[::2] += _pose_variance(now.covariance, squared)
    doubt = np.empty((3, 2, len(depth)))
    doubt[:, 0], doubt[:, 1] = covariance, covariance * np.square(static[2, 1] / np.maximum(depth, 0.1))
    chi2 = chi2_2d(miss.reshape(2, -1).T, doubt.reshape(3, -1).T, effect.reshape(2, -1).T).reshape(2, -1)
    # What is where the far one of two surfaces would have it says nothing of how the near one moves.
    behind = (chi2[0] > _STATIC_CHI2) & (chi2[1] <= _STATIC_CHI2)
    depth_now = store.near_m.ravel().astype(float)
    sigma_now = depth_sigma_m(np.where(np.isnan(depth_now), 1.0, depth_now), noise)
    return PointMotion(
        static_m=static[:, 0].T,
        ray=ray.T,
        lag_s=anchor.lag_s.repeat(2),
        miss_m=miss[:, 0].T,
        covariance=covariance.T,
        depth_effect=effect[:, 0].T,
        depth_step_m=depth_now - depth,
        depth_step_sigma_m=np.hypot(depths.sigma_m, sigma_now),
        depth_lag_s=_depth_lag_s(anchor),
        static_chi2=chi2.min(axis=0),
        usable=depths.known & in_front & ~behind & np.isfinite(miss[0, 0] + miss[1, 0]),
    )


def observed_variance_scale(
    motion: PointMotion, age_frames: NDArray[np.intp], moving: NDArray[np.bool_], before: float
) -> float:
    """The scale for the next frame, after one in which before was used: what static ends really scatter.

    Blur, a rolling shutter, depth beside its colour: no table knows them, the background shows them. The
    lower third of the ends decides, so that movers not yet known as such have no say.
    """
    settled = motion.usable & ((age_frames >= _SETTLED_FRAMES) & ~moving).repeat(2)
    chi2 = motion.static_chi2[settled]
    if len(chi2) < _LEAST_ENDS:
        return before
    seen = before * quantile(chi2, 1.0 / 3.0) / _CHI2_THIRD
    return min(max(before + _SCALE_GAIN * (seen - before), _LEAST_SCALE), _MOST_SCALE)


def _averaged(looks: FloatArray) -> FloatArray:
    """(N,) what is left of the noise of depth after looks (N,) frames, whose noise is alike in part."""
    result: FloatArray = np.maximum(1.0 / np.sqrt(np.maximum(looks, 1.0)), _COMMON_NOISE)
    return result


def average_depth(store: FragmentStore, before: AnchorEnds, pose: Pose, noise: DepthNoise) -> None:
    """Carry the depth of every end on as if it were static, and average it with what is measured now.

    A measurement that does not fit begins anew: another surface, or something that moves in depth.
    before: the ends in the frame before. pose: the camera now.
    """
    forward = pose.rotation[:, 2]
    way = forward @ (before.origin - pose.translation_m[:, None])
    carried = ((forward @ before.direction) * before.depth_m + way).reshape(-1, 2)
    off = store.near_m - carried
    fits = np.abs(off) <= 0.05 + 3.0 * depth_sigma_m(carried, noise)  # not where either is missing
    looks = np.where(fits, np.minimum(store.looks + 1.0, _MOST_LOOKS), 1.0)
    store.looks = looks.astype(np.float32)
    store.depth_m = np.where(fits, carried + off / looks, store.near_m).astype(np.float32)


def _depth_lag_s(anchor: AnchorEnds) -> FloatArray:
    """(2N,) how long before now the averaged depth of the anchors was measured, on average."""
    looks = anchor.looks
    late_frames = np.where(looks < _MOST_LOOKS, 0.5 * (looks - 1.0), _SETTLED_LATE_FRAMES)
    frame_s = (anchor.lag_s / anchor.lag_frames).repeat(2)
    return anchor.lag_s.repeat(2) + late_frames * frame_s


def _pixel_covariance(
    store: FragmentStore, anchor: AnchorEnds, mixed: NDArray[np.bool_], passing_px: FloatArray
) -> FloatArray:
    """(3, 2N) covariance xx, xy, yy of the ends in the image, px^2, since their anchors.

    An end whose surroundings lie on two surfaces (mixed (2N,)) is often no corner of a body but the place
    where the outline of one crosses a line of another: it slides along the fragment when either moves, by as
    much as they pass each other in the image, passing_px (2, 2N). Across the fragment it is held as well as
    any.
    """
    steps = np.maximum(1.0, _STEPS_SHARE * anchor.lag_frames).repeat(2)
    result: FloatArray = store.pixel_cov.reshape(-1, 3).T * steps
    ends = mixed.nonzero()[0]
    both = store.ends_px[ends // 2].astype(float)
    du, dv = (both[:, 1] - both[:, 0]).T
    squared = np.maximum(du * du + dv * dv, 1e-12)
    along = (passing_px[0, ends] * du + passing_px[1, ends] * dv) ** 2 / squared
    slide, rest = np.maximum(along, _MIXED_ALONG_PX**2) / squared, _MIXED_ACROSS_PX**2
    result[0, ends] += slide * du * du + rest
    result[1, ends] += slide * du * dv
    result[2, ends] += slide * dv * dv + rest
    return result


def _pose_variance(covariance: FloatArray, squared_depth: FloatArray) -> FloatArray:
    """(N,) variance in metres across the view that the camera's own uncertainty makes at a depth."""
    variance = covariance.diagonal().tolist()
    result: FloatArray = max(variance[3:6]) + max(variance[:3]) * squared_depth
    return result
