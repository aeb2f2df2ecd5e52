"""The camera's own motion, from static fragments, depth and a prior.

* Unknowns, 8: the pose of the camera now (rotation 3, translation 3) and its sweep (2), that is how far it
  turned about x and y while the rows of the image were read (vision/ego_motion/rolling_shutter.py).
* Measurements: where anchored points are seen now. A point is anchored if its place in the fixed frame is
  known from some frames ago (vision/fragments/store.py).
* Prior: mean and standard deviation of the motion, and of the sweep (vision/ego_motion/motion_prior.py).

Method: robust Gauss-Newton on the reprojection error (vision/ego_motion/robust_fit.py). A point's error has
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
from vision.ego_motion.motion_prior import MotionPrior, SweepPrior
from vision.ego_motion.reprojection import Anchors, view_of
from vision.ego_motion.robust_fit import Fit, fit

_MIN_POINTS = 8  # two equations each: twice as many as unknowns
_MIN_INLIER_RATIO = 0.25  # where fewer agree, something else than the ground may have been followed
_MIN_BACKGROUND_RATIO = 0.10  # the same where the prior binds: what agrees with it may be a small rest
_UNANIMOUS_RATIO = 0.9  # somebody large leaves more than a tenth of the ground in view
_LOOSE_SHARE = np.array([5.0] * 6 + [1.0] * 2)  # of the prior's sigma
_YAW_AND_WAY = np.array([1, 3, 4, 5])
_CONFLICT_CHI2 = 13.3  # 99 %, 4 degrees of freedom
_TRUSTED_SHARE = np.array([1.0, 0.3, 1.0, 0.2, 0.2, 0.2, 1.0, 1.0])  # of the prior's sigma, where it decides
_BENT_CHI2 = 16.0  # four sigmas
_STRAIGHTENED_SHARE = 0.05  # of the points: so many more have to agree once the image is straightened


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
    found = fit(view, start, sigma)
    bend_rad, bend_variance = _bend(found)
    if (np.square(bend_rad - found.sweep_rad) > _BENT_CHI2 * bend_variance).any():
        # Before the read-out is known, what is not certain may all the same be plain to see.
        possible = np.concatenate((prior.sigma, sweep.most_rad))
        straightened = fit(view, start, possible)
        if straightened.inliers >= found.inliers + _STRAIGHTENED_SHARE * len(use):
            found, sigma = straightened, possible
            bend_rad, bend_variance = _bend(found)
    least = max(_MIN_POINTS, _MIN_INLIER_RATIO * len(use))
    torn = prior.binding and _conflict(found, prior.sigma)
    disputed = False
    if torn:
        # Where the prior is far off, its gate shuts out what denies it.
        freely = fit(view, start, sigma * _LOOSE_SHARE)
        disputed = freely.inliers >= _UNANIMOUS_RATIO * len(use)
        if disputed:
            found = freely
        else:
            # Something large moves, and the data follow it. What agrees with the prior is the ground.
            found = fit(view, start, sigma * _TRUSTED_SHARE)
            least = max(_MIN_POINTS, _MIN_BACKGROUND_RATIO * len(use))
            # Still far from a prior that is trusted: too little of the ground is seen to overrule it.
            torn = _conflict(found, prior.sigma)
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


def _bend(found: Fit) -> tuple[FloatArray, FloatArray]:
    """The sweep and its variance, (2,) each, had nothing been assumed of it: one more step from the last."""
    regular, covariance = cv2.invert(found.free, flags=cv2.DECOMP_CHOLESKY)
    if not regular:
        return np.zeros(2), np.full(2, np.inf)
    spread = np.asarray(covariance, np.float64)[6:]
    return found.free_from_rad + spread @ found.free_side, spread[:, 6:].diagonal()


def _conflict(found: Fit, sigma: FloatArray) -> bool:
    """Whether yaw and translation are farther from where the fit began than sigma (6,) admits."""
    off = (found.back / sigma)[_YAW_AND_WAY]
    return float(off @ off) > _CONFLICT_CHI2
