"""Motion evidence of every end: where it would be if it were static, and how far from there it is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise
from hal.types import FloatArray, Intrinsics, Pose
from vision.depth_mask import depth_sigma_m
from vision.ego_motion import CameraEstimate
from vision.fragments import AnchorEnds, FragmentStore
from vision.lens import rays
from vision.velocities import PointMotion, chi2_2d, static_miss

_SETTLED_FRAMES = 3
_LEAST_ENDS = 16
_CHI2_THIRD = 0.811  # a third of static ends, 2 degrees of freedom, lies below
_SCALE_GAIN = 0.15
_LEAST_SCALE = 0.3
_MOST_SCALE = 8.0
_STEPS_SHARE = 0.5  # flow errors of successive frames cancel in part
_MOST_LOOKS = 6.0
_COMMON_NOISE = 0.5
_MIXED_SIGMAS = 3.0
_MIXED_ALONG_PX = 3.0
_MIXED_ACROSS_PX = 0.3


def gather(
    store: FragmentStore,
    anchor: AnchorEnds,
    now: CameraEstimate,
    camera: Intrinsics,
    noise: DepthNoise,
    variance_scale: float,
) -> PointMotion:
    """The evidence of the 2N ends in store, from their anchors and the camera's pose now.

    variance_scale: how much larger the variance of static ends has been found than it was assumed.
    """
    rotation, translation = store.poses(np.repeat(anchor.slot, 2))
    ray_before = rays(anchor.pixels.reshape(-1, 2), camera)
    direction = (rotation @ ray_before[:, :, None])[:, :, 0] @ now.pose.rotation
    origin = (translation - now.pose.translation_m) @ now.pose.rotation
    near_m = anchor.depth_m.ravel().astype(float)
    far_m = anchor.far_m.ravel().astype(float)
    known = np.isfinite(near_m)
    near_m, far_m = np.where(known, near_m, 1.0), np.where(known, far_m, 1.0)
    ray = rays(store.ends_px.reshape(-1, 2), camera)[:, :2]
    static = direction * near_m[:, None] + origin
    in_front = static[:, 2] > 0.1
    sigma = averaged_sigma_m(near_m, anchor.looks.ravel(), noise)
    mixed = far_m - near_m > 0.1 + _MIXED_SIGMAS * depth_sigma_m(near_m, noise)
    pixel_cov = _pixel_covariance(store, anchor, mixed)
    metres = static[:, 2:3] / np.array([camera.fx, np.sqrt(camera.fx * camera.fy), camera.fy])
    covariance = variance_scale * pixel_cov * metres**2
    covariance[:, [0, 2]] += _pose_variance(now.covariance, static[:, 2])[:, None]
    miss = static_miss(static, ray)
    effect_per_m = ray * direction[:, 2:3] - direction[:, :2]
    depth_scale = np.sqrt(variance_scale)
    effect = effect_per_m * (depth_scale * sigma[:, None])
    static_far = direction * far_m[:, None] + origin
    scale = np.square(static_far[:, 2] / np.where(in_front, static[:, 2], 1.0))[:, None]
    chi2 = np.minimum(
        chi2_2d(miss, covariance, effect),
        chi2_2d(
            static_miss(static_far, ray),
            covariance * scale,
            effect_per_m * (depth_scale * depth_sigma_m(far_m, noise)[:, None]),
        ),
    )
    depth_now = store.near_m.ravel().astype(float)
    step_sigma = np.hypot(sigma, depth_sigma_m(np.nan_to_num(depth_now, nan=1.0), noise))
    return PointMotion(
        static_m=static,
        ray=ray,
        lag_s=np.repeat(anchor.lag_s, 2),
        miss_m=miss,
        covariance=covariance,
        depth_effect=effect,
        depth_step_m=depth_now - static[:, 2],
        depth_step_sigma_m=step_sigma,
        static_chi2=chi2,
        usable=known & in_front & np.isfinite(miss).all(axis=1),
    )


def observed_variance_scale(
    motion: PointMotion, age_frames: NDArray[np.intp], moving: NDArray[np.bool_], before: float
) -> float:
    """The scale for the next frame, after one in which before was used: what static ends really scatter.

    Blur, a rolling shutter, depth beside its colour: no table knows them, the background shows them. The
    lower third of the ends decides, so that movers not yet known as such have no say.
    """
    settled = motion.usable & np.repeat((age_frames >= _SETTLED_FRAMES) & ~moving, 2)
    if np.count_nonzero(settled) < _LEAST_ENDS:
        return before
    third = float(np.quantile(motion.static_chi2[settled], 1.0 / 3.0))
    seen = before * third / _CHI2_THIRD
    return float(np.clip(before + _SCALE_GAIN * (seen - before), _LEAST_SCALE, _MOST_SCALE))


def averaged_sigma_m(depth_m: FloatArray, looks: NDArray[np.float32], noise: DepthNoise) -> FloatArray:
    """(N,) standard deviation of depth averaged over looks (N,) frames, whose noise is alike in part."""
    share = np.maximum(1.0 / np.sqrt(np.maximum(looks, 1.0)), _COMMON_NOISE)
    return depth_sigma_m(depth_m, noise) * share


def average_depth(store: FragmentStore, pose: Pose, camera: Intrinsics, noise: DepthNoise) -> None:
    """Carry the depth of every end on as if it were static, and average it with what is measured now.

    A measurement that does not fit begins anew: another surface, or something that moves in depth.
    """
    pixels, depth, before = store.before()
    relative = pose.inverse() @ before
    points = rays(pixels.reshape(-1, 2), camera) * depth.reshape(-1, 1)
    carried = (points @ relative.rotation[2] + relative.translation_m[2]).reshape(-1, 2)
    with np.errstate(invalid="ignore"):
        limit = 0.05 + 3.0 * depth_sigma_m(carried, noise)
        fits = np.abs(store.near_m - carried) <= limit
    looks = np.where(fits, np.minimum(store.looks + 1.0, _MOST_LOOKS), 1.0)
    store.looks = looks.astype(np.float32)
    blended = carried + (store.near_m - carried) / looks
    store.depth_m = np.where(fits, blended, store.near_m).astype(np.float32)


def _pixel_covariance(store: FragmentStore, anchor: AnchorEnds, mixed: NDArray[np.bool_]) -> FloatArray:
    """(2N, 3) covariance xx, xy, yy of the ends in the image, px^2, since their anchors.

    An end whose surroundings lie on two surfaces (mixed (2N,)) is often no corner of a body but the place
    where the outline of one crosses a line of another: it slides along the fragment when either moves.
    Across the fragment it is held as well as any.
    """
    steps = np.maximum(1.0, _STEPS_SHARE * np.repeat(anchor.lag_frames, 2))
    result: FloatArray = store.pixel_cov.reshape(-1, 3).astype(float) * steps[:, None]
    along = (store.ends_px[:, 1] - store.ends_px[:, 0]).astype(float)
    along /= np.maximum(np.sqrt(np.square(along).sum(axis=1, keepdims=True)), 1e-6)
    tu, tv = np.repeat(along, 2, axis=0)[mixed].T
    slide, rest = _MIXED_ALONG_PX**2, _MIXED_ACROSS_PX**2
    result[mixed] += np.stack((slide * tu * tu + rest, slide * tu * tv, slide * tv * tv + rest), axis=1)
    return result


def _pose_variance(covariance: FloatArray, depth_m: FloatArray) -> FloatArray:
    """(N,) variance in metres across the view that the camera's own uncertainty makes at depth_m (N,)."""
    turn = float(np.max(np.diag(covariance)[:3]))
    way = float(np.max(np.diag(covariance)[3:]))
    return way + turn * np.square(depth_m)
