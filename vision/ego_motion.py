"""The camera's own motion from static fragments and depth; a prior holds when most of the view moves.

Gauss-Newton on the reprojection of points anchored some frames ago. A point's error has a pixel part
and a depth part: depth moves the prediction along its epipolar line only, so a point with uncertain
depth still measures across it. Points that even the prior's uncertainty cannot explain never enter,
therefore a person who fills half of the view cannot outvote the odometry.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.perception import EgoMotionSettings
from hal.types import FloatArray, GyroSamples, Intrinsics, Pose
from vision.lens import project, rotation_from_vector, vector_from_rotation

NS_PER_S = 1e9
_ITERATIONS = 6
_GATE_CHI2 = 9.21  # 99 % of static points, 2 degrees of freedom
_ANNEAL = (32.0, 4.0)  # robust scale of the first iterations, falling to 1
_MIN_POINTS = 8
_MIN_INLIER_RATIO = 0.25
_MIN_BACKGROUND_RATIO = 0.10
_CONFLICT_CHI2 = 13.3  # 99 %, 4 degrees of freedom
_TRUSTED_SHARE = np.array([1.0, 0.3, 1.0, 0.2, 0.2, 0.2])  # of the prior's sigma, where it decides
_CONVERGED = 2e-5


@dataclass(frozen=True, slots=True, eq=False)
class MotionPrior:
    """What is known before looking: motion (the camera now in the camera before) and the standard
    deviation (6,) of a small motion of the camera now: rotation about, translation along x, y, z."""

    motion: Pose
    sigma: FloatArray
    source: str


@dataclass(frozen=True, slots=True, eq=False)
class Anchors:
    """Points seen some frames ago: points_m (N, 3) in the fixed frame, range_m (N, 3) their derivative
    with respect to depth, depth_sigma_m (N,), pixel_cov (N, 3): xx, xy, yy of where they are seen now,
    usable (N,) bool."""

    points_m: FloatArray
    range_m: FloatArray
    depth_sigma_m: FloatArray
    pixel_cov: FloatArray
    usable: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class CameraEstimate:
    """pose: the camera in the fixed frame. covariance (6, 6) of a small motion of it. inlier_ratio: NaN
    where not estimated. visual: False where only the prior speaks."""

    pose: Pose
    covariance: FloatArray
    inlier_ratio: float
    visual: bool


def odometry_prior(motion: Pose, dt_s: float, settings: EgoMotionSettings) -> MotionPrior:
    """A prior from dead reckoning: good in translation, slipping in yaw, blind to vibration."""
    turn_rad = float(np.linalg.norm(vector_from_rotation(motion.rotation)))
    way_m = float(np.linalg.norm(motion.translation_m))
    yaw = settings.odometry_yaw_ratio * turn_rad + settings.odometry_rotation_radps * dt_s
    tilt = settings.vibration_radps * dt_s + 0.1 * turn_rad
    way = settings.odometry_speed_ratio * way_m + settings.odometry_speed_mps * dt_s
    return MotionPrior(motion, np.array([tilt, yaw, tilt, way, way, way]), "odometry")


def steady_prior(last: Pose, last_dt_s: float, dt_s: float, settings: EgoMotionSettings) -> MotionPrior:
    """A prior where nothing else is known: the camera goes on as it did. last_dt_s 0: not even that."""
    known = last_dt_s > 0
    share = dt_s / last_dt_s if known else 0.0
    turn = rotation_from_vector(vector_from_rotation(last.rotation) * share)
    sigma = np.array([settings.steady_rotation_radps] * 3 + [settings.steady_speed_mps] * 3) * dt_s
    sigma *= 1.0 if known else settings.unknown_factor
    return MotionPrior(Pose(turn, last.translation_m * share), sigma, "none")


def with_gyro(
    prior: MotionPrior, gyro: GyroSamples, from_ns: int, to_ns: int, settings: EgoMotionSettings
) -> MotionPrior:
    """The prior with its rotation taken from the gyro's mean rate over the interval."""
    inside = (gyro.stamps_ns > from_ns) & (gyro.stamps_ns <= to_ns)
    if not inside.any() or not np.isfinite(gyro.rates_radps[inside]).all():
        return prior
    dt_s = (to_ns - from_ns) / NS_PER_S
    turn = rotation_from_vector(gyro.rates_radps[inside].mean(axis=0) * dt_s)
    sigma = prior.sigma.copy()
    sigma[:3] = settings.gyro_radps * dt_s
    return MotionPrior(Pose(turn, prior.motion.translation_m), sigma, prior.source)


def estimate(
    anchors: Anchors,
    pixels: FloatArray,
    before: Pose,
    prior: MotionPrior,
    camera: Intrinsics,
) -> CameraEstimate:
    """The camera now, from where anchored points are seen now (pixels (N, 2)).

    before: the camera of the frame before, in the fixed frame.
    """
    start = before @ prior.motion
    unseen = CameraEstimate(start, np.diag(np.square(prior.sigma)), float("nan"), False)
    use = np.flatnonzero(anchors.usable)
    if len(use) < _MIN_POINTS:
        return unseen
    view = _View(
        anchors.points_m[use],
        anchors.range_m[use],
        np.square(anchors.depth_sigma_m[use]),
        _whitening(anchors.pixel_cov[use]),
        pixels[use],
        camera,
    )
    found = _solve(view, start, prior.sigma)
    least = max(_MIN_POINTS, _MIN_INLIER_RATIO * len(use))
    if prior.source == "odometry" and _conflict(found.pose, start, prior.sigma):
        # Something large moves, and the data follow it. What agrees with the odometry is the ground.
        found = _solve(view, start, prior.sigma * _TRUSTED_SHARE)
        least = max(_MIN_POINTS, _MIN_BACKGROUND_RATIO * len(use))
    ratio = found.inliers / len(use)
    # Still far from a prior that is trusted: too little of the ground is seen to overrule it.
    torn = prior.source == "odometry" and _conflict(found.pose, start, prior.sigma)
    if found.inliers < least or torn:
        return CameraEstimate(start, unseen.covariance, ratio, False)
    covariance = np.linalg.inv(found.information).astype(np.float64, copy=False)
    return CameraEstimate(found.pose, covariance, ratio, True)


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    points: FloatArray
    towards: FloatArray
    depth_variance: FloatArray
    whitening: FloatArray
    seen: FloatArray
    camera: Intrinsics


@dataclass(frozen=True, slots=True, eq=False)
class _Solution:
    pose: Pose
    information: FloatArray
    inliers: int


def _solve(view: _View, start: Pose, sigma: FloatArray) -> _Solution:
    """Iteratively reweighted Gauss-Newton from start, which is known to sigma (6,)."""
    prior_information = np.diag(1.0 / np.square(sigma))
    information, inliers = prior_information, 0
    pose = _shift(view, start, sigma)
    allowed = np.ones(len(view.seen), np.bool_)
    for iteration in range(_ITERATIONS):
        jacobian, residual, derivative, in_front = _linearise(view, pose)
        # Depth's share of the covariance, by Sherman and Morrison: only along the epipolar line.
        squared = np.square(derivative).sum(axis=1)
        shrink = view.depth_variance / (1.0 + view.depth_variance * squared)
        along = (derivative * residual).sum(axis=1)
        chi2 = np.square(residual).sum(axis=1) - shrink * along**2
        if iteration == 0:
            doubt = np.square(jacobian * sigma).sum(axis=(1, 2))
            allowed = in_front & (chi2 <= _GATE_CHI2 * (1.0 + doubt))
        inliers = int(np.count_nonzero(allowed & (chi2 <= _GATE_CHI2)))
        scale = _ANNEAL[iteration] if iteration < len(_ANNEAL) else 1.0
        weight = np.where(allowed & in_front, np.square(1.0 / (1.0 + chi2 / (_GATE_CHI2 * scale))), 0.0)
        weight = weight / scale
        projected = (jacobian * derivative[:, :, None]).sum(axis=1)
        flat = jacobian.reshape(-1, 6)
        weighted = flat * np.repeat(weight, 2)[:, None]
        normal = weighted.T @ flat - (projected * (weight * shrink)[:, None]).T @ projected
        rhs = weighted.T @ residual.ravel() - projected.T @ (weight * shrink * along)
        information = normal + prior_information
        step = np.linalg.solve(information, rhs + prior_information @ _difference(pose, start))
        pose = pose @ Pose(rotation_from_vector(step[:3]), step[3:])
        if iteration >= len(_ANNEAL) and float(np.abs(step).max()) < _CONVERGED:
            break
    return _Solution(pose, information, inliers)


def _conflict(pose: Pose, start: Pose, sigma: FloatArray) -> bool:
    """Whether yaw and translation of pose are farther from start than sigma (6,) admits."""
    off = (_difference(pose, start) / sigma)[[1, 3, 4, 5]]
    return float(off @ off) > _CONFLICT_CHI2


def _linearise(view: _View, pose: Pose) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.bool_]]:
    """Jacobian (N, 2, 6) of the pixel by a small motion of the camera, residual (N, 2) seen minus
    predicted, derivative (N, 2) of the pixel by depth, all in sigmas of the pixel, and which points lie
    in front."""
    camera = view.camera
    local = (view.points - pose.translation_m) @ pose.rotation
    direction = view.towards @ pose.rotation
    in_front = local[:, 2] > 0.1
    inverse = 1.0 / np.where(in_front, local[:, 2], 1.0)
    x, y = local[:, 0] * inverse, local[:, 1] * inverse
    residual = np.empty((len(x), 2))
    residual[:, 0] = view.seen[:, 0] - (x * camera.fx + camera.cx)
    residual[:, 1] = view.seen[:, 1] - (y * camera.fy + camera.cy)
    # The camera turns by w and goes by v: a point goes by -(w x p) - v in its frame.
    jacobian = np.zeros((len(x), 2, 6))
    jacobian[:, 0, 0] = camera.fx * x * y
    jacobian[:, 0, 1] = -camera.fx * (1.0 + x * x)
    jacobian[:, 0, 2] = camera.fx * y
    jacobian[:, 0, 3] = -camera.fx * inverse
    jacobian[:, 0, 5] = camera.fx * x * inverse
    jacobian[:, 1, 0] = camera.fy * (1.0 + y * y)
    jacobian[:, 1, 1] = -camera.fy * x * y
    jacobian[:, 1, 2] = -camera.fy * x
    jacobian[:, 1, 4] = -camera.fy * inverse
    jacobian[:, 1, 5] = camera.fy * y * inverse
    derivative = np.empty((len(x), 2))
    derivative[:, 0] = camera.fx * inverse * (direction[:, 0] - x * direction[:, 2])
    derivative[:, 1] = camera.fy * inverse * (direction[:, 1] - y * direction[:, 2])
    white = view.whitening
    return (
        white @ jacobian,
        (white @ residual[:, :, None])[:, :, 0],
        (white @ derivative[:, :, None])[:, :, 0],
        in_front,
    )


def _whitening(covariance: FloatArray) -> FloatArray:
    """(N, 2, 2) that turns residuals of covariance (N, 3) into ones of unit variance (inverse Cholesky)."""
    first = np.sqrt(covariance[:, 0])
    low = covariance[:, 1] / first
    second = np.sqrt(np.maximum(covariance[:, 2] - low * low, 1e-6))
    result = np.zeros((len(covariance), 2, 2))
    result[:, 0, 0] = 1.0 / first
    result[:, 1, 0] = -low / (first * second)
    result[:, 1, 1] = 1.0 / second
    return result


def _shift(view: _View, start: Pose, sigma: FloatArray) -> Pose:
    """A better start: turn by the median miss of all points, as far as sigma (6,) admits."""
    local = (view.points - start.translation_m) @ start.rotation
    local[:, 2] = np.maximum(local[:, 2], 0.1)
    miss = np.median(view.seen - project(local, view.camera), axis=0)
    turn = np.array([miss[1] / view.camera.fy, -miss[0] / view.camera.fx, 0.0])
    limit = 3.0 * sigma[:3]
    return start @ Pose(rotation_from_vector(np.clip(turn, -limit, limit)), np.zeros(3))


def _difference(pose: Pose, start: Pose) -> FloatArray:
    """(6,) the small motion of pose that leads back to start."""
    back = pose.inverse() @ start
    return np.concatenate((vector_from_rotation(back.rotation), back.translation_m))
