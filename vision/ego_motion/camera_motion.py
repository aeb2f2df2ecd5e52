"""The camera's own motion, from static fragments, depth and a prior.

* Unknowns, 8: the pose of the camera now (rotation 3, translation 3) and its sweep (2), that is how far it
  turned about x and y while the rows of the image were read (vision/ego_motion/rolling_shutter.py).
* Measurements: where anchored points are seen now. A point is anchored if its place in the fixed frame is
  known from some frames ago (vision/fragments/store.py).
* Prior: mean and standard deviation of the motion, and of the sweep (vision/ego_motion/motion_prior.py).

Method: robust Gauss-Newton on the reprojection error (vision/ego_motion/reprojection.py). A point's error has
a pixel part and a depth part. Depth moves the prediction along its epipolar line only, so a point with
uncertain depth still measures across it.

Gate: a point enters only if its error at the start has a chi-square of 9.21 at most (99 % of static points),
widened by the uncertainty of the prior. Therefore a person who fills half of the view cannot outvote the
odometry. If the result contradicts a binding prior, it is solved again with a tighter one; if that fails or
too few points agree, the prior alone is the answer. But if nearly all points agree on what contradicts the
prior, it is no longer plain which is wrong: the tracks may slip, or all that is seen may move.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from hal.types import FloatArray, Intrinsics, Pose
from vision.camera.lens import rotation_from_vector, vector_from_rotation
from vision.ego_motion.motion_prior import MotionPrior, SweepPrior
from vision.ego_motion.reprojection import Anchors, View, linearise, view_of
from vision.numerics.order import median

_ITERATIONS = 6  # at most: two that anneal, the others until it has converged
_GATE_CHI2 = 9.21  # 99 % of static points, 2 degrees of freedom
_ANNEAL = (32.0, 4.0)  # robust scale of the first iterations, falling to 1
_MIN_POINTS = 8  # two equations each: twice as many as unknowns
_MIN_INLIER_RATIO = 0.25  # where fewer agree, something else than the ground may have been followed
_MIN_BACKGROUND_RATIO = 0.10  # the same where the prior binds: what agrees with it may be a small rest
_UNANIMOUS_RATIO = 0.9  # somebody large leaves more than a tenth of the ground in view
_LOOSE_SHARE = np.array([5.0] * 6 + [1.0] * 2)  # of the prior's sigma
_CONFLICT_CHI2 = 13.3  # 99 %, 4 degrees of freedom
_TRUSTED_SHARE = np.array([1.0, 0.3, 1.0, 0.2, 0.2, 0.2, 1.0, 1.0])  # of the prior's sigma, where it decides
_BENT_CHI2 = 16.0  # four sigmas
_STRAIGHTENED_SHARE = 0.05  # of the points: so many more have to agree once the image is straightened
_CONVERGED_SIGMAS = 0.2  # a step of less is nothing beside what the pose may be off anyway
_UNKNOWNS = 8  # rotation and translation (3 each), sweep about x and y
_IDENTITY = np.eye(_UNKNOWNS)
_OF_MOTION = np.array([1.0] * 6 + [0.0] * 2)
_STRAIGHT = 1e-3  # for no longer a way (rad, m) the image moves as its derivatives say, to 0.01 px


@dataclass(frozen=True, slots=True, eq=False)
class CameraEstimate:
    """pose: the camera in the fixed frame, when the middle row was read. sweep_rad (2,): how far it turned
    about x and y from the first row to the last. covariance (8, 8) of a small motion of it and of
    sweep_rad. bend_rad, bend_variance (2,): the sweep as the image alone tells it, inf where it tells
    nothing. inlier_ratio: NaN where not estimated. visual: False where only the prior speaks. disputed:
    nearly all points contradict the prior; the pose is theirs, and neither is to be relied on."""

    pose: Pose
    sweep_rad: FloatArray
    bend_rad: FloatArray
    bend_variance: FloatArray
    covariance: FloatArray
    inlier_ratio: float
    visual: bool
    disputed: bool = False


def estimate(
    anchors: Anchors,
    pixels: FloatArray,
    before: Pose,
    prior: MotionPrior,
    sweep: SweepPrior,
    camera: Intrinsics,
) -> CameraEstimate:
    """The camera now, from where anchored points are seen now (pixels (N, 2)).

    before: the camera of the frame before, in the fixed frame.
    """
    start, sigma = before @ prior.motion, np.concatenate((prior.sigma, sweep.sigma_rad))
    use = anchors.usable.nonzero()[0]
    if len(use) < _MIN_POINTS:
        return _unseen(start, sigma, float("nan"))
    view = view_of(anchors, pixels, use, camera)
    found = _solve(view, start, sigma)
    bend_rad, bend_variance = _bend(found)
    if (np.square(bend_rad - found.sweep_rad) > _BENT_CHI2 * bend_variance).any():
        # Before the read-out is known, what is not certain may all the same be plain to see.
        possible = np.concatenate((prior.sigma, sweep.most_rad))
        straightened = _solve(view, start, possible)
        if straightened.inliers >= found.inliers + _STRAIGHTENED_SHARE * len(use):
            found, sigma = straightened, possible
            bend_rad, bend_variance = _bend(found)
    least = max(_MIN_POINTS, _MIN_INLIER_RATIO * len(use))
    torn = prior.binding and _conflict(found.pose, start, prior.sigma)
    disputed = False
    if torn:
        # Where the prior is far off, its gate shuts out what denies it.
        freely = _solve(view, start, sigma * _LOOSE_SHARE)
        disputed = freely.inliers >= _UNANIMOUS_RATIO * len(use)
        if disputed:
            found = freely
        else:
            # Something large moves, and the data follow it. What agrees with the prior is the ground.
            found = _solve(view, start, sigma * _TRUSTED_SHARE)
            least = max(_MIN_POINTS, _MIN_BACKGROUND_RATIO * len(use))
            # Still far from a prior that is trusted: too little of the ground is seen to overrule it.
            torn = _conflict(found.pose, start, prior.sigma)
        bend_rad, bend_variance = _bend(found)
    ratio = found.inliers / len(use)
    # OpenCV answers zeros where there is no inverse: the least that is known would seem the most.
    regular, covariance = cv2.invert(found.information, flags=cv2.DECOMP_CHOLESKY)
    if found.inliers < least or (torn and not disputed) or not regular:
        return _unseen(start, sigma, ratio)
    spread = np.asarray(covariance, np.float64)
    return CameraEstimate(
        pose=found.pose,
        sweep_rad=found.sweep_rad,
        bend_rad=bend_rad,
        bend_variance=bend_variance,
        covariance=spread,
        inlier_ratio=ratio,
        visual=not disputed,
        disputed=disputed,
    )


def _unseen(start: Pose, sigma: FloatArray, inlier_ratio: float) -> CameraEstimate:
    """Only the prior speaks."""
    nothing, unknown = np.zeros(2), np.full(2, np.inf)
    return CameraEstimate(
        pose=start,
        sweep_rad=nothing,
        bend_rad=nothing,
        bend_variance=unknown,
        covariance=np.diag(np.square(sigma)),
        inlier_ratio=inlier_ratio,
        visual=False,
    )


def _bend(found: _Solution) -> tuple[FloatArray, FloatArray]:
    """The sweep and its variance, (2,) each, had nothing been assumed of it: one more step from the last."""
    regular, covariance = cv2.invert(found.free, flags=cv2.DECOMP_CHOLESKY)
    if not regular:
        return np.zeros(2), np.full(2, np.inf)
    spread = np.asarray(covariance, np.float64)[6:]
    return found.free_from_rad + spread @ found.free_side, spread[:, 6:].diagonal()


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


def _solve(view: View, start: Pose, sigma: FloatArray) -> _Solution:
    """Iteratively reweighted Gauss-Newton from start, which is known to sigma (8,)."""
    prior = 1.0 / np.square(sigma)
    information = prior_information = _IDENTITY * prior
    pose, sweep_rad = _shift(view, start, sigma), np.zeros(2)
    count = view.seen.shape[1]
    table, weights = np.empty((10, 3, count)), np.empty((3, count))
    flat = table[:9].reshape(9, 3 * count)
    in_front, shrink = linearise(view, pose, table)
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
            in_front, shrink = linearise(view, pose, table)
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
        pose=_moved(pose, gone[:6]),
        sweep_rad=sweep_rad + gone[6:],
        information=information,
        inliers=inliers,
        free=free,
        free_side=free_side,
        free_from_rad=-assumed[6:],
    )


def _moved(pose: Pose, step: FloatArray) -> Pose:
    """After a small motion (6,) of its own."""
    return pose @ Pose(rotation_from_vector(step[:3]), step[3:])


def _conflict(pose: Pose, start: Pose, sigma: FloatArray) -> bool:
    """Whether yaw and translation of pose are farther from start than sigma (6,) admits."""
    off = (_difference(pose, start) / sigma)[[1, 3, 4, 5]]
    return float(off @ off) > _CONFLICT_CHI2


def _shift(view: View, start: Pose, sigma: FloatArray) -> Pose:
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
