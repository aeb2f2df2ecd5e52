"""Residual of every fragment end (end point of a fragment) against the prediction that it is static.

The prediction is where the end would be now, by the camera's own motion, if it had stayed at its anchor. The
residual (innovation) is how far from there it is seen, with its covariance and chi-square (EndResiduals). The
ends that are not known to move also give the scale of the noise (observed_variance_scale).

vision/detector.py calls this after the camera's motion has been estimated. The evidence of tracks, which
rests on these residuals among other things, is in vision/bodies/motion_evidence.py.
"""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise
from hal.compiled import compiled, inlined
from hal.records import record
from hal.types import FloatArray, Intrinsics, Matrix, Pose
from vision.camera.lens import MIN_AHEAD_M
from vision.depth.depth_noise import depth_sigma_of
from vision.ego_motion.camera_motion import CameraEstimate
from vision.ego_motion.rolling_shutter import straight_rays
from vision.fragments.store import AnchorEnds, FragmentStore
from vision.motion.anchor_depths import AnchorDepths, depth_steps
from vision.motion.velocities import STATIC_END_CHI2, EndResiduals
from vision.numerics.order import variance_ratio
from vision.numerics.pose_axes import Coordinates, inner_point, inner_vector

_SETTLED_FRAMES = 3  # the residuals of younger ends are hardly larger than their noise
_MIN_ENDS = 16  # minimum for a scale: it is taken from the lower third
_SCALE_GAIN = 0.15  # per frame: half of a change of floor or light is taken up in four frames
# Bounds: sigmas of 0.55 to 2.8 times the assumed ones. Anything beyond is not noise.
_MIN_SCALE = 0.3
_MAX_SCALE = 8.0
_STEPS_SHARE = 0.5  # of the sum of the flow variances of all frames: successive errors cancel in part
_MIXED_ALONG_PX = 3.0  # minimum sigma along the fragment of an end where the edges of two surfaces cross
_MIXED_ACROSS_PX = 0.3  # its sigma across the fragment: twice that of a clear end
_MIN_DETERMINANT = 1e-18  # m^4, of a covariance: a lower bound that avoids a division by 0

_Covariance = tuple[float, float, float]  # xx, xy, yy
_Pixels = Annotated[NDArray[np.float32], "float32[:, :, :]"]


@record(frozen=True, slots=True, eq=False)
class _EndsNow:
    """The 2N ends of N fragments as they are seen now.

    straight: rays to them, as if all rows of the image had been read with the middle one, (2N, 3).
    ends_px: (N, 2, 2).
    pixel_cov: of one flow step, as in FragmentStore, (N, 2, 3).
    """

    straight: Matrix
    ends_px: _Pixels
    pixel_cov: _Pixels


@record(frozen=True, slots=True, eq=False)
class _Uncertainty:
    """Of all ends alike.

    turn_variance, way_variance: of the camera's rotation (rad^2) and translation (m^2).
    variance_scale: ratio of the observed variance of static ends to the assumed one.
    """

    turn_variance: float
    way_variance: float
    variance_scale: float


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
    straight = straight_rays(store.ends_px.reshape(-1, 2), camera, now.sweep_rad)
    static_m, ray, residual_m, covariance, depth_effect, static_chi2, usable = _residuals(
        anchor,
        depths,
        _EndsNow(straight, store.ends_px, store.pixel_cov),
        now.pose,
        _Uncertainty(max(variance[:3]), max(variance[3:6]), variance_scale),
        camera,
        noise,
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
    residual: tuple[float, float], covariance: _Covariance, effect: tuple[float, float]
) -> float:
    """Squared Mahalanobis length of residual under covariance (xx, xy, yy) plus effect * effect'."""
    a, b = residual
    xx = covariance[0] + effect[0] * effect[0]
    xy = covariance[1] + effect[0] * effect[1]
    yy = covariance[2] + effect[1] * effect[1]
    result: float = (yy * a * a - 2.0 * xy * a * b + xx * b * b) / max(xx * yy - xy * xy, _MIN_DETERMINANT)
    return result


@inlined
def _at_depth(direction: Coordinates, origin: Coordinates, depth_m: float) -> Coordinates:
    """Where a static end of this depth would be now.

    direction, origin: of its anchor; all in the camera's axes.
    """
    return (
        direction[0] * depth_m + origin[0],
        direction[1] * depth_m + origin[1],
        direction[2] * depth_m + origin[2],
    )


@inlined
def _passing_px(near: Coordinates, far: Coordinates, camera: Intrinsics) -> tuple[float, float]:
    """How far apart in the image the same point of the anchor's image is now on the two surfaces."""
    ahead, far_ahead = max(near[2], MIN_AHEAD_M), max(far[2], MIN_AHEAD_M)
    return (
        (far[0] / far_ahead - near[0] / ahead) * camera.fx,
        (far[1] / far_ahead - near[1] / ahead) * camera.fy,
    )


@inlined
def _sliding_covariance(ends_px: NDArray[np.float32], passing: tuple[float, float]) -> _Covariance:
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


@inlined
def _in_metres(pixels: _Covariance, depth_m: float, of: _Uncertainty, camera: Intrinsics) -> _Covariance:
    """Covariance (m^2) of a residual at depth_m, from that of the pixel (px^2) and of the camera's motion."""
    scaled = of.variance_scale * depth_m * depth_m
    by_motion = of.way_variance + of.turn_variance * depth_m * depth_m
    return (
        pixels[0] * scaled / (camera.fx * camera.fx) + by_motion,
        pixels[1] * scaled / (camera.fx * camera.fy),
        pixels[2] * scaled / (camera.fy * camera.fy) + by_motion,
    )


@inlined
def _residual_m(seen: tuple[float, float], static: Coordinates) -> tuple[float, float]:
    """x' Z - X and y' Z - Y of an end seen on the ray x', y', which would be at X, Y, Z if it were static."""
    return seen[0] * static[2] - static[0], seen[1] * static[2] - static[1]


@compiled(AnchorEnds, AnchorDepths, _EndsNow, Pose, _Uncertainty, Intrinsics, DepthNoise)
def _residuals(
    anchor: AnchorEnds,
    depths: AnchorDepths,
    ends: _EndsNow,
    pose: Pose,
    uncertainty: _Uncertainty,
    camera: Intrinsics,
    noise: DepthNoise,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, NDArray[np.bool_]]:
    """static_m, ray, residual_m, covariance, depth_effect, static_chi2 and usable of EndResiduals.

    pose: of the camera. usable: true also where no depth is known.
    """
    count, noise_scale = len(depths.near_m), math.sqrt(uncertainty.variance_scale)
    static_m, ray, residual_m = np.empty((count, 3)), np.empty((count, 2)), np.empty((count, 2))
    covariance, effect, chi2 = np.empty((count, 3)), np.empty((count, 2)), np.empty(count)
    usable = np.empty(count, np.bool_)
    for k in range(count):
        direction, origin = inner_vector(pose, anchor.direction[:, k]), inner_point(pose, anchor.origin[:, k])
        near = _at_depth(direction, origin, depths.near_m[k])
        far = _at_depth(direction, origin, depths.far_m[k])
        uu, uv, vv = ends.pixel_cov[k // 2, k % 2]
        steps = max(1.0, _STEPS_SHARE * anchor.lag_frames[k // 2])
        uu, uv, vv = uu * steps, uv * steps, vv * steps
        if depths.mixed[k]:
            slide = _sliding_covariance(ends.ends_px[k // 2], _passing_px(near, far, camera))
            uu, uv, vv = uu + slide[0], uv + slide[1], vv + slide[2]
        xx, xy, yy = _in_metres((uu, uv, vv), near[2], uncertainty, camera)
        seen = ends.straight[k, 0], ends.straight[k, 1]
        # How the residual changes with the depth of the anchor, and so by one sigma of it.
        by_depth = _residual_m(seen, direction)
        by_x, by_y = by_depth[0] * noise_scale, by_depth[1] * noise_scale
        near_residual, sigma_m = _residual_m(seen, near), depths.sigma_m[k]
        near_effect = by_x * sigma_m, by_y * sigma_m
        near_chi2 = _squared_sigmas(near_residual, (xx, xy, yy), near_effect)
        # On the far surface the same pixels span more metres.
        wider = (far[2] / max(near[2], MIN_AHEAD_M)) ** 2
        far_sigma_m = depth_sigma_of(depths.far_m[k], noise)
        far_effect = by_x * far_sigma_m, by_y * far_sigma_m
        far_chi2 = _squared_sigmas(_residual_m(seen, far), (xx * wider, xy * wider, yy * wider), far_effect)
        static_m[k, 0], static_m[k, 1], static_m[k, 2] = near
        ray[k, 0], ray[k, 1] = seen
        residual_m[k, 0], residual_m[k, 1] = near_residual
        covariance[k, 0], covariance[k, 1], covariance[k, 2] = xx, xy, yy
        effect[k, 0], effect[k, 1] = near_effect
        chi2[k] = min(near_chi2, far_chi2)
        # An end that is where a static far surface would have it tells nothing about the near surface.
        behind = near_chi2 > STATIC_END_CHI2 and far_chi2 <= STATIC_END_CHI2
        measured = math.isfinite(near_residual[0] + near_residual[1])
        usable[k] = near[2] > MIN_AHEAD_M and measured and not behind
    return static_m, ray, residual_m, covariance, effect, chi2, usable
