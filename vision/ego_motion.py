"""The camera's own motion from static fragments and depth; a prior holds when most of the view moves.

Gauss-Newton on the reprojection of points anchored some frames ago. A point's error has a pixel part
and a depth part: depth moves the prediction along its epipolar line only, so a point with uncertain
depth still measures across it. Points that even the prior's uncertainty cannot explain never enter,
therefore a person who fills half of the view cannot outvote the odometry. How far the camera turned while the
rows of the image were read, its sweep, is found with it (vision/rolling_shutter.py).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray, Intrinsics, Pose
from vision.lens import rotation_from_vector, row_delays, vector_from_rotation
from vision.motion_prior import MotionPrior
from vision.order import median

_ITERATIONS = 6
_GATE_CHI2 = 9.21  # 99 % of static points, 2 degrees of freedom
_ANNEAL = (32.0, 4.0)  # robust scale of the first iterations, falling to 1
_MIN_POINTS = 8
_MIN_INLIER_RATIO = 0.25
_MIN_BACKGROUND_RATIO = 0.10
_CONFLICT_CHI2 = 13.3  # 99 %, 4 degrees of freedom
_TRUSTED_SHARE = np.array([1.0, 0.3, 1.0, 0.2, 0.2, 0.2, 1.0, 1.0])  # of the prior's sigma, where it decides
_CONVERGED_SIGMAS = 0.2  # a step of less is nothing beside what the pose may be off anyway
_UNKNOWNS = 8  # rotation and translation (3 each), sweep about x and y
_IDENTITY = np.eye(_UNKNOWNS)
_OF_MOTION = np.array([1.0] * 6 + [0.0] * 2)
_STRAIGHT = 1e-3  # for no longer a way (rad, m) the image moves as its derivatives say, to 0.01 px


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
    """pose: the camera in the fixed frame, when the middle row was read. sweep_rad (2,): how far it turned
    about x and y from the first row to the last. covariance (8, 8) of a small motion of it and of
    sweep_rad. bend_rad, bend_variance (2,): the sweep as the image alone tells it, inf where it tells
    nothing. inlier_ratio: NaN where not estimated. visual: False where only the prior speaks."""

    pose: Pose
    sweep_rad: FloatArray
    bend_rad: FloatArray
    bend_variance: FloatArray
    covariance: FloatArray
    inlier_ratio: float
    visual: bool


def estimate(
    anchors: Anchors,
    pixels: FloatArray,
    before: Pose,
    prior: MotionPrior,
    sweep_sigma_rad: FloatArray,
    camera: Intrinsics,
) -> CameraEstimate:
    """The camera now, from where anchored points are seen now (pixels (N, 2)).

    before: the camera of the frame before, in the fixed frame. sweep_sigma_rad (2,): one sigma of sweep_rad.
    """
    start, sigma = before @ prior.motion, np.concatenate((prior.sigma, sweep_sigma_rad))
    use = np.flatnonzero(anchors.usable)
    if len(use) < _MIN_POINTS:
        return _unseen(start, sigma, float("nan"))
    view = _view(anchors, pixels, use, camera)
    found = _solve(view, start, sigma)
    least = max(_MIN_POINTS, _MIN_INLIER_RATIO * len(use))
    torn = prior.binding and _conflict(found.pose, start, prior.sigma)
    if torn:
        # Something large moves, and the data follow it. What agrees with the prior is the ground.
        found = _solve(view, start, sigma * _TRUSTED_SHARE)
        least = max(_MIN_POINTS, _MIN_BACKGROUND_RATIO * len(use))
        # Still far from a prior that is trusted: too little of the ground is seen to overrule it.
        torn = _conflict(found.pose, start, prior.sigma)
    ratio = found.inliers / len(use)
    # OpenCV answers zeros where there is no inverse: the least that is known would seem the most.
    regular, covariance = cv2.invert(found.information, flags=cv2.DECOMP_CHOLESKY)
    if found.inliers < least or torn or not regular:
        return _unseen(start, sigma, ratio)
    bend_rad, bend_variance = _bend(found)
    spread = np.asarray(covariance, np.float64)
    return CameraEstimate(found.pose, found.sweep_rad, bend_rad, bend_variance, spread, ratio, True)


def _unseen(start: Pose, sigma: FloatArray, inlier_ratio: float) -> CameraEstimate:
    """Only the prior speaks."""
    nothing, unknown = np.zeros(2), np.full(2, np.inf)
    return CameraEstimate(start, nothing, nothing, unknown, np.diag(np.square(sigma)), inlier_ratio, False)


def _bend(found: _Solution) -> tuple[FloatArray, FloatArray]:
    """The sweep and its variance, (2,) each, had nothing been assumed of it: one more step from the last."""
    regular, covariance = cv2.invert(found.free, flags=cv2.DECOMP_CHOLESKY)
    if not regular:
        return np.zeros(2), np.full(2, np.inf)
    spread = np.asarray(covariance, np.float64)[6:]
    return found.free_from_rad + spread @ found.free_side, spread[:, 6:].diagonal()


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """The N points that count, coordinate by coordinate: at this size a NumPy call costs more than what it
    computes, so everything of one kind lies in one array. lines (3, 2N): points, then their derivatives
    by depth. seen (2, N): on the plane z = 1; delays (N,) of their rows. whitening (3, N): turns an error
    (a, b) on that plane into (w0 a, w1 a + w2 b), of unit variance."""

    lines: FloatArray
    seen: FloatArray
    delays: FloatArray
    depth_variance: FloatArray
    whitening: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class _Solution:
    """information (8, 8). free (8, 8), free_side (8,): normal equations of the last step, from a sweep of
    free_from_rad (2,) on, without the prior of the sweep."""

    pose: Pose
    sweep_rad: FloatArray
    information: FloatArray
    inliers: int
    free: FloatArray
    free_side: FloatArray
    free_from_rad: FloatArray


def _view(anchors: Anchors, pixels: FloatArray, use: NDArray[np.intp], camera: Intrinsics) -> _View:
    """Of the points use (M,)."""
    count = len(use)
    lines = np.empty((3, 2 * count))
    lines[:, :count] = anchors.points_m.T.take(use, axis=1)
    lines[:, count:] = anchors.range_m.T.take(use, axis=1)
    seen = np.empty((2, count))
    u, v = pixels.T.take(use, axis=1)
    seen[0] = (u - camera.cx) / camera.fx
    seen[1] = (v - camera.cy) / camera.fy
    # The inverse of Cholesky's factor.
    xx, xy, yy = anchors.pixel_cov.T.take(use, axis=1)
    first = np.sqrt(xx)
    low = xy / first
    second = np.sqrt(np.maximum(yy - low * low, 1e-6))
    whitening = np.empty((3, count))
    whitening[0] = camera.fx / first
    whitening[1] = -camera.fx * low / (first * second)
    whitening[2] = camera.fy / second
    return _View(lines, seen, row_delays(v, camera), np.square(anchors.depth_sigma_m[use]), whitening)


def _solve(view: _View, start: Pose, sigma: FloatArray) -> _Solution:
    """Iteratively reweighted Gauss-Newton from start, which is known to sigma (8,)."""
    prior = 1.0 / np.square(sigma)
    information = prior_information = _IDENTITY * prior
    pose, sweep_rad = _shift(view, start, sigma), np.zeros(2)
    count = view.seen.shape[1]
    table, weights = np.empty((10, 3, count)), np.empty((3, count))
    flat = table[:9].reshape(9, 3 * count)
    in_front, shrink = _linearise(view, pose, table)
    missing = np.concatenate((_difference(pose, start), sweep_rad))
    allowed = np.ones(count)
    gone = np.zeros(_UNKNOWNS)  # since the image was linearised
    for iteration in range(_ITERATIONS):
        a, b, along = table[8]
        chi2 = a * a + b * b - shrink * along * along
        if iteration == 0:
            doubt = np.square(table[:8, :2] * sigma[:, None, None]).reshape(16, count).sum(axis=0)
            allowed = (in_front & (chi2 <= _GATE_CHI2 * (1.0 + doubt))).astype(np.float64)
        scale = _ANNEAL[iteration] if iteration < len(_ANNEAL) else 1.0
        weight = allowed * in_front / (scale * np.square(1.0 + chi2 * (1.0 / (_GATE_CHI2 * scale))))
        weights[:2] = weight
        weights[2] = weight * -shrink
        # Eight rows of the normal matrix, and in the last column the right side.
        normal = (table[:9] * weights).reshape(9, 3 * count) @ flat.T
        information = normal[:8, :8] + prior_information
        side, assumed = normal[:8, 8] + prior * missing, missing
        _, solved = cv2.solve(information, side[:, None])
        step = np.asarray(solved, np.float64)[:, 0]
        gone = gone + step
        # The step in standard deviations, squared.
        if iteration >= len(_ANNEAL) and float(step @ side) < _CONVERGED_SIGMAS**2:
            break
        if max(map(abs, gone.tolist())) > _STRAIGHT:
            pose, sweep_rad, gone = _moved(pose, gone[:6]), sweep_rad + gone[6:], np.zeros(_UNKNOWNS)
            in_front, shrink = _linearise(view, pose, table)
            table[8] -= (sweep_rad @ flat[6:8]).reshape(3, count)
            missing = np.concatenate((_difference(pose, start), -sweep_rad))
        else:
            missing = missing - step
            table[8] -= (step @ flat[:8]).reshape(3, count)
    inliers = int(np.count_nonzero(allowed * (chi2 <= _GATE_CHI2)))
    free, free_side = (
        normal[:8, :8] + prior_information * _OF_MOTION,
        normal[:8, 8] + prior * assumed * _OF_MOTION,
    )
    return _Solution(
        _moved(pose, gone[:6]), sweep_rad + gone[6:], information, inliers, free, free_side, -assumed[6:]
    )


def _moved(pose: Pose, step: FloatArray) -> Pose:
    """After a small motion (6,) of its own."""
    return pose @ Pose(rotation_from_vector(step[:3]), step[3:])


def _conflict(pose: Pose, start: Pose, sigma: FloatArray) -> bool:
    """Whether yaw and translation of pose are farther from start than sigma (6,) admits."""
    off = (_difference(pose, start) / sigma)[[1, 3, 4, 5]]
    return float(off @ off) > _CONFLICT_CHI2


def _linearise(view: _View, pose: Pose, table: FloatArray) -> tuple[NDArray[np.bool_], FloatArray]:
    """Fill table (10, 3, N). Returns which points lie in front of the camera and what the variance of their
    depth takes off the square of an error along the derivative by depth: (N,), (N,).

    Rows 0 to 5: derivative of the image by a small motion of the camera (rotation, translation); rows 6
    and 7: by its sweep; row 8: seen minus predicted, without sweep; row 9: derivative by depth. First and
    second layer: across and down the image, in sigmas. Third layer: the part along the derivative by depth,
    times its length.
    """
    count = view.seen.shape[1]
    turned = pose.rotation.T @ view.lines
    x, y, z = turned[:, :count] - (pose.rotation.T @ pose.translation_m)[:, None]
    direction = turned[:, count:]
    in_front: NDArray[np.bool_] = z > 0.1
    inverse = 1.0 / np.maximum(z, 0.1)
    x *= inverse
    y *= inverse
    # The camera turns by w and goes by v: a point goes by -(w x p) - v in its frame.
    across, down, along = table[:, 0], table[:, 1], table[:, 2]
    np.multiply(x, y, out=across[0])
    np.negative(across[0], out=down[1])
    np.subtract(-1.0, x * x, out=across[1])
    np.add(1.0, y * y, out=down[0])
    across[2] = y
    np.negative(x, out=down[2])
    np.negative(inverse, out=across[3])
    across[4] = 0.0
    down[3] = 0.0
    down[4] = across[3]
    np.multiply(x, inverse, out=across[5])
    np.multiply(y, inverse, out=down[5])
    np.subtract(view.seen[0], x, out=across[8])
    np.subtract(view.seen[1], y, out=down[8])
    np.multiply(inverse, direction[0] - x * direction[2], out=across[9])
    np.multiply(inverse, direction[1] - y * direction[2], out=down[9])
    np.multiply(across[:2], view.delays, out=across[6:8])
    np.multiply(down[:2], view.delays, out=down[6:8])
    own, mixed, other = view.whitening
    down *= other
    down += across * mixed
    across *= own
    np.multiply(across, across[9], out=along)
    along += down * down[9]
    # Depth's share of the covariance, by Sherman and Morrison: only along the epipolar line.
    shrink = view.depth_variance / (1.0 + view.depth_variance * along[9])
    return in_front, shrink


def _shift(view: _View, start: Pose, sigma: FloatArray) -> Pose:
    """A better start: turn by the median miss of all points, as far as sigma (8,) admits."""
    count = view.seen.shape[1]
    local = start.rotation.T @ view.lines[:, :count] - (start.rotation.T @ start.translation_m)[:, None]
    across, down = median(view.seen - local[:2] / np.maximum(local[2], 0.1))
    turn = np.array([down, -across, 0.0])
    limit = 3.0 * sigma[:3]
    return start @ Pose(rotation_from_vector(np.minimum(np.maximum(turn, -limit), limit)), np.zeros(3))


def _difference(pose: Pose, start: Pose) -> FloatArray:
    """(6,) the small motion of pose that leads back to start."""
    back = pose.rotation.T
    result = np.empty(6)
    result[:3] = vector_from_rotation(back @ start.rotation)
    result[3:] = back @ (start.translation_m - pose.translation_m)
    return result
