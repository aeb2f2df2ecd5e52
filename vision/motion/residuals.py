"""Residual of every fragment end (end point of a fragment) against the prediction that it is static.

The prediction is where the end would be now, by the camera's own motion, if it had stayed at its anchor. The
residual (innovation) is how far from there it is seen, with its covariance and chi-square (EndResiduals). The
ends that are not known to move also give the scale of the noise (observed_variance_scale).

vision/detector.py calls this after the camera's motion has been estimated. The evidence of tracks, which
rests on these residuals among other things, is in vision/bodies/motion_evidence.py.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise
from hal.compiled import compiled, inlined
from hal.types import FloatArray, Intrinsics, Pose
from vision.depth.depth_noise import depth_sigma_of
from vision.ego_motion.camera_motion import CameraEstimate
from vision.ego_motion.rolling_shutter import straight_rays
from vision.fragments.store import AnchorEnds, FragmentStore
from vision.motion.anchor_depths import AnchorDepths, depth_steps
from vision.motion.velocities import STATIC_END_CHI2, EndResiduals
from vision.numerics.order import variance_ratio
from vision.numerics.pose_axes import inner_point, inner_vector

_SETTLED_FRAMES = 3  # the residuals of younger ends are hardly larger than their noise
_MIN_ENDS = 16  # minimum for a scale: it is taken from the lower third
_SCALE_GAIN = 0.15  # per frame: half of a change of floor or light is taken up in four frames
# Bounds: sigmas of 0.55 to 2.8 times the assumed ones. Anything beyond is not noise.
_MIN_SCALE = 0.3
_MAX_SCALE = 8.0
_STEPS_SHARE = 0.5  # of the sum of the flow variances of all frames: successive errors cancel in part
_MIXED_ALONG_PX = 3.0  # minimum sigma along the fragment of an end where the edges of two surfaces cross
_MIXED_ACROSS_PX = 0.3  # its sigma across the fragment: twice that of a clear end


def residuals(
    store: FragmentStore,
    anchor: AnchorEnds,
    depths: AnchorDepths,
    now: CameraEstimate,
    camera: Intrinsics,
    noise: DepthNoise,
    variance_scale: float,
) -> EndResiduals:
    """Residuals of the 2N ends in store, from their anchors and the camera's pose now.

    variance_scale: ratio of the observed variance of static ends to the assumed one.
    """
    variance = now.covariance.diagonal().tolist()
    static_m, ray, residual_m, covariance, depth_effect, static_chi2, usable = _residuals(
        anchor,
        depths,
        straight_rays(store.ends_px.reshape(-1, 2), camera, now.sweep_rad),
        store.ends_px,
        store.pixel_cov,
        now.pose,
        max(variance[:3]),
        max(variance[3:6]),
        camera,
        noise,
        variance_scale,
    )
    step_m, step_sigma_m, step_lag_s = depth_steps(store, anchor, depths, static_m, noise)
    return EndResiduals(
        static_m=static_m,
        ray=ray,
        lag_s=anchor.lag_s.repeat(2),
        residual_m=residual_m,
        covariance=covariance,
        depth_effect=depth_effect,
        depth_step_m=step_m,
        depth_step_sigma_m=step_sigma_m,
        depth_lag_s=step_lag_s,
        static_chi2=static_chi2,
        usable=depths.known & usable,
    )


def observed_variance_scale(
    motion: EndResiduals,
    age_frames: NDArray[np.intp],
    moving: NDArray[np.bool_],
    used: float,
    before: float,
) -> float:
    """The variance scale for the next frame, from the scatter of static ends in this one.

    It covers errors that are not modelled, such as blur, a rolling shutter, or depth not aligned with colour.
    moving (N,): fragments known to move. used: the scale used for motion. before: that of earlier frames.
    """
    settled = motion.usable & ((age_frames >= _SETTLED_FRAMES) & ~moving).repeat(2)
    chi2 = motion.static_chi2[settled]
    if len(chi2) < _MIN_ENDS:
        return before
    seen = used * variance_ratio(chi2)
    return min(max(before + _SCALE_GAIN * (seen - before), _MIN_SCALE), _MAX_SCALE)


@inlined
def _squared_sigmas(
    residual: tuple[float, float], covariance: tuple[float, float, float], effect: tuple[float, float]
) -> float:
    """Squared Mahalanobis length of residual under covariance (xx, xy, yy) plus effect * effect'."""
    a, b = residual
    xx = covariance[0] + effect[0] * effect[0]
    xy = covariance[1] + effect[0] * effect[1]
    yy = covariance[2] + effect[1] * effect[1]
    result: float = (yy * a * a - 2.0 * xy * a * b + xx * b * b) / max(xx * yy - xy * xy, 1e-18)
    return result


@inlined
def _sliding_covariance(
    ends_px: NDArray[np.float32], passing: tuple[float, float]
) -> tuple[float, float, float]:
    """Additional covariance uu, uv, vv (px^2) of a mixed end of the fragment with ends_px (2, 2).

    An end whose surroundings lie on two surfaces is often not a corner of a body, but the place where the
    outline of one crosses a line of another. It slides along the fragment when either moves, by as much as
    they move relative to each other in the image, passing (px). Across the fragment it is held as well as any
    other end.
    """
    du = np.float64(ends_px[1, 0]) - np.float64(ends_px[0, 0])
    dv = np.float64(ends_px[1, 1]) - np.float64(ends_px[0, 1])
    squared = max(du * du + dv * dv, 1e-12)
    along = (passing[0] * du + passing[1] * dv) ** 2 / squared
    slide, rest = max(along, _MIXED_ALONG_PX**2) / squared, _MIXED_ACROSS_PX**2
    return slide * du * du + rest, slide * du * dv, slide * dv * dv + rest


@compiled(
    AnchorEnds,
    AnchorDepths,
    "float64[:, :], float32[:, :, :], float32[:, :, :]",
    Pose,
    "float64, float64",
    Intrinsics,
    DepthNoise,
    "float64",
)
def _residuals(
    anchor: AnchorEnds,
    depths: AnchorDepths,
    straight: FloatArray,
    ends_px: NDArray[np.float32],
    pixel_cov: NDArray[np.float32],
    pose: Pose,
    turn_variance: float,
    way_variance: float,
    camera: Intrinsics,
    noise: DepthNoise,
    variance_scale: float,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, NDArray[np.bool_]]:
    """static_m, ray, residual_m, covariance, depth_effect and static_chi2 of EndResiduals, and which are
    usable.

    straight (2N, 3): rays to the ends as seen now. pose: of the camera. turn_variance, way_variance: of its
    rotation (rad^2) and translation (m^2).
    """
    count, fx, fy = len(depths.near_m), camera.fx, camera.fy
    static_m, ray, residual_m = np.empty((count, 3)), np.empty((count, 2)), np.empty((count, 2))
    covariance, effect, chi2 = np.empty((count, 3)), np.empty((count, 2)), np.empty(count)
    usable, noise_scale = np.empty(count, np.bool_), math.sqrt(variance_scale)
    for k in range(count):
        dx, dy, dz = inner_vector(pose, anchor.direction[:, k])
        x0, y0, z0 = inner_point(pose, anchor.origin[:, k])
        u, v = straight[k, 0], straight[k, 1]
        near_m, far_m = depths.near_m[k], depths.far_m[k]
        # Where a static end would be now if it is on the near surface, and if it is on the far one.
        x, y, z = dx * near_m + x0, dy * near_m + y0, dz * near_m + z0
        far_x, far_y, far_z = dx * far_m + x0, dy * far_m + y0, dz * far_m + z0
        ahead, far_ahead = max(z, 0.1), max(far_z, 0.1)
        uu, uv, vv = pixel_cov[k // 2, k % 2]
        steps = max(1.0, _STEPS_SHARE * anchor.lag_frames[k // 2])
        uu, uv, vv = uu * steps, uv * steps, vv * steps
        if depths.mixed[k]:
            passing = (far_x / far_ahead - x / ahead) * fx, (far_y / far_ahead - y / ahead) * fy
            more_uu, more_uv, more_vv = _sliding_covariance(ends_px[k // 2], passing)
            uu, uv, vv = uu + more_uu, uv + more_uv, vv + more_vv
        scaled = variance_scale * z * z
        pose_variance = way_variance + turn_variance * z * z
        xx, xy, yy = (
            uu * scaled / (fx * fx) + pose_variance,
            uv * scaled / (fx * fy),
            vv * scaled / (fy * fy) + pose_variance,
        )
        turn_u, turn_v = (u * dz - dx) * noise_scale, (v * dz - dy) * noise_scale
        near_effect = turn_u * depths.sigma_m[k], turn_v * depths.sigma_m[k]
        near_residual = u * z - x, v * z - y
        near_chi2 = _squared_sigmas(near_residual, (xx, xy, yy), near_effect)
        far_sigma_m = depth_sigma_of(far_m, noise.floor_m, noise.quadratic_per_m)
        more = (far_z / ahead) ** 2
        far_chi2 = _squared_sigmas(
            (u * far_z - far_x, v * far_z - far_y),
            (xx * more, xy * more, yy * more),
            (turn_u * far_sigma_m, turn_v * far_sigma_m),
        )
        static_m[k, 0], static_m[k, 1], static_m[k, 2] = x, y, z
        ray[k, 0], ray[k, 1] = u, v
        residual_m[k, 0], residual_m[k, 1] = near_residual
        covariance[k, 0], covariance[k, 1], covariance[k, 2] = xx, xy, yy
        effect[k, 0], effect[k, 1] = near_effect
        chi2[k] = min(near_chi2, far_chi2)
        # An end that is where a static far surface would have it tells nothing about the near surface.
        behind = near_chi2 > STATIC_END_CHI2 and far_chi2 <= STATIC_END_CHI2
        usable[k] = z > 0.1 and not behind and math.isfinite(near_residual[0] + near_residual[1])
    return static_m, ray, residual_m, covariance, effect, chi2, usable
