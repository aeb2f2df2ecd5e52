"""The camera's own motion, from static fragments, depth and a prior.

* Unknowns, 8: the pose of the camera now (rotation 3, translation 3) and its sweep (2), which is how far it
  turned about x and y while the rows of the image were read (vision/ego_motion/rolling_shutter.py).
* Measurements: where anchored points are seen now. A point is anchored if its position in the fixed frame is
  known from some frames ago (vision/fragments/store.py).
* Prior: mean and standard deviation of the motion, and of the sweep (vision/ego_motion/motion_prior.py).

Method: robust Gauss-Newton on the reprojection error (vision/ego_motion/robust_fit.py). A point's error has
a pixel part and a depth part. Depth moves the prediction along its epipolar line only, so a point with
uncertain depth still measures across it.

Gate: a point is used only if its error at the start has a chi-square of at most 9.21 (99 % of static points),
widened by the uncertainty of the prior. Therefore a person who fills half of the view cannot outvote the
odometry.

Conflict with a trusted prior (from odometry, or from the kinematics of a tracked robot):

* If nearly all points agree on a motion that contradicts the prior, the estimate is theirs, but it is marked
  as disputed: the robot's tracks may slip, or everything in view may move. Points of fragments that seemed
  to move have no vote for that motion, but count against it if they are where the prior expects them. A
  vehicle that filled the view was taken for static in the frames before; then what is static seems to move.
* If one body alone tells that motion, it has no say: it may move itself (vision/ego_motion/lone_body.py).
  This holds where odometry or a gyro tells the turn, and also for a turn that differs from it by more than
  slip explains.
* Otherwise the fit is repeated with a tighter prior. If the result still contradicts it, or too few points
  agree, the prior alone is the answer.

Without odometry, a frame in which few points fit is tried again with the pixel noise that its own points show
(_noise_scale). A hand-held camera that turns fast blurs some images, and depth and colour are not exposed at
the same time. The points still tell the motion then, but with twice the assumed error.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from hal.records import record
from hal.types import FloatArray, Intrinsics, Pose
from vision.ego_motion.lone_body import without_lone_body
from vision.ego_motion.motion_prior import MotionPrior, SweepPrior
from vision.ego_motion.reprojection import Anchors, View, view_of
from vision.ego_motion.robust_fit import Fit, fit, misfits
from vision.numerics.order import variance_ratio
from vision.scene import Obstacle

# Without odometry, at least this share of the fragments must fit one motion of the camera.
MIN_AGREEMENT = 0.45
_MIN_POINTS = 8  # with two equations each: twice as many as unknowns
_MIN_INLIER_RATIO = 0.25  # with fewer inliers, something other than the static world may have been followed
_MIN_BACKGROUND_RATIO = 0.10  # the same with a tightened prior: the ground that agrees may be a small rest
_UNANIMOUS_RATIO = 0.9  # inliers for a disputed estimate: a large mover leaves more than 10 % of the ground
_LOOSE_SHARE = np.array([5.0] * 6 + [1.0] * 2)  # of the prior's sigma, for a fit that may contradict it
_YAW_AND_TRANSLATION = np.array([1, 3, 4, 5])  # the unknowns that are compared with the prior
_CONFLICT_CHI2 = 13.3  # 99 %, 4 degrees of freedom
_TRUSTED_SHARE = np.array([1.0, 0.3, 1.0, 0.2, 0.2, 0.2, 1.0, 1.0])  # of the prior's sigma, tightened
_BENT_CHI2 = 16.0  # four sigmas: the image alone shows another sweep than the fit
# Sigmas of more than twice the assumed ones are not noise: something is wrong, such as depth that does not
# lie where the colour is.
_MAX_NOISE_SCALE = 4.0
_CERTAIN_CHI2 = 9.0  # three sigmas
_STRAIGHTENED_SHARE = 0.05  # of the points: minimum of additional inliers to accept the larger sweep


@record(frozen=True, slots=True, eq=False)
class CameraEstimate:
    """The camera's pose and sweep in one frame.

    pose: the camera in the fixed frame, when the middle row was read.
    sweep_rad: how far it turned about x and y from the first row to the last, (2,).
    bend_rad, bend_variance: the sweep as measured by the image alone, without a prior, (2,); the variance is
        inf where it tells nothing.
    covariance: of a small motion of the camera and of sweep_rad, (8, 8).
    inlier_ratio: share of the usable points that agree under the assumed noise; NaN where not estimated.
    visual: the pose is estimated from the images; False: it is the prior, or disputed.
    disputed: nearly all points contradict the prior. The pose is theirs; neither of the two can be relied on.
    noise_scale: variance of the pixels with which the motion is estimated, as a ratio to the assumed one.
    """

    pose: Pose
    sweep_rad: FloatArray
    bend_rad: FloatArray
    bend_variance: FloatArray
    covariance: FloatArray
    inlier_ratio: float
    visual: bool
    disputed: bool = False
    noise_scale: float = 1.0

    @property
    def noisy(self) -> bool:
        """Whether only more noise than assumed explains the points."""
        return self.noise_scale > 1.0


@record(frozen=True, slots=True, eq=False)
class _Points:
    """Anchored points, and where the camera sees them now, pixels (N, 2)."""

    anchors: Anchors
    pixels: FloatArray
    camera: Intrinsics

    def usable(self) -> View:
        """The points from which the motion is estimated."""
        return view_of(self.anchors, self.pixels, self.anchors.usable.nonzero()[0], self.camera)

    def left_out_that_fit(self, start: Pose, sigma: FloatArray) -> int:
        """Number of points of seeming movers that are where the prior expects what is static."""
        left_out = self.anchors.left_out.nonzero()[0]
        if not len(left_out):
            return 0
        return fit(view_of(self.anchors, self.pixels, left_out, self.camera), start, sigma).inliers


@record(frozen=True, slots=True, eq=False)
class _Fitted:
    """A fit to the points of view; the sigma (8,) of its prior; its _bend."""

    view: View
    fit: Fit
    sigma: FloatArray
    bend: tuple[FloatArray, FloatArray]


def estimate(
    anchors: Anchors,
    pixels: FloatArray,
    before: Pose,
    prior: MotionPrior,
    sweep: SweepPrior,
    camera: Intrinsics,
    obstacles: tuple[Obstacle, ...] = (),
) -> CameraEstimate:
    """The camera now, from where anchored points are seen now, pixels (N, 2).

    before: pose of the camera in the frame before, in the fixed frame. sweep: prior of the sweep.
    obstacles: of the frame before.
    """
    start, points = before @ prior.motion, _Points(anchors, pixels, camera)
    first = _fit_with_sweep(points.usable(), start, prior, sweep)
    if first is not None and prior.knows_turn and _implausible(first.fit, prior):
        others = without_lone_body(first.view, start, obstacles, camera)
        if len(others.seen) < len(first.view.seen):
            first = _fit_with_sweep(others, start, prior, sweep)
    if first is None:
        return _prior_only(start, np.concatenate((prior.sigma, sweep.sigma_rad)), float("nan"))
    found = _checked(points, first, start, prior)
    if prior.source != "none" or found.disputed or found.inlier_ratio >= MIN_AGREEMENT:
        return found
    scale = _noise_scale(first)
    noisier = _fit_with_sweep(first.view.with_pixel_variance(scale), start, prior, sweep) or first
    again = _checked(points, noisier, start, prior)
    if again.visual and again.inlier_ratio >= MIN_AGREEMENT:
        return replace(again, inlier_ratio=found.inlier_ratio, noise_scale=scale)
    return found


def _noise_scale(first: _Fitted) -> float:
    """Variance of the pixels in this frame, as a ratio to the assumed one, from 1 to _MAX_NOISE_SCALE."""
    return min(max(variance_ratio(misfits(first.view, first.fit)), 1.0), _MAX_NOISE_SCALE)


def _checked(points: _Points, fitted: _Fitted, start: Pose, prior: MotionPrior) -> CameraEstimate:
    """The estimate from a fit, if it does not contradict a trusted prior."""
    view, found, sigma, bend = fitted.view, fitted.fit, fitted.sigma, fitted.bend
    count = len(view.seen)
    least = max(_MIN_POINTS, _MIN_INLIER_RATIO * count)
    conflicts = prior.trusted and _conflict(found, prior.sigma)
    disputed = False
    if conflicts:
        # If the prior is far off, its gate excludes the points that contradict it. Fit with a wide one.
        freely = fit(view, start, sigma * _LOOSE_SHARE)
        disputed = _is_unanimous(freely.inliers, count, points, start, sigma)
        if disputed:
            found = freely
        else:
            # The fit has followed something large that moves. The ground is what agrees with the prior.
            found = fit(view, start, sigma * _TRUSTED_SHARE)
            least = max(_MIN_POINTS, _MIN_BACKGROUND_RATIO * count)
            # If it is still far from the prior, too little of the ground is in view to correct the prior.
            conflicts = _conflict(found, prior.sigma)
        bend = _bend(found)
    ratio = found.inliers / count
    covariance = _inverse(found.information)
    if found.inliers < least or (conflicts and not disputed) or covariance is None:
        return _prior_only(start, sigma, ratio)
    return CameraEstimate(
        pose=found.pose,
        sweep_rad=found.sweep_rad,
        bend_rad=bend[0],
        bend_variance=bend[1],
        covariance=covariance,
        inlier_ratio=ratio,
        visual=not disputed,
        disputed=disputed,
    )


def _is_unanimous(agree: int, count: int, points: _Points, start: Pose, sigma: FloatArray) -> bool:
    """Whether nearly all agree, of count usable points and of those left out which fit the prior."""
    if agree < _UNANIMOUS_RATIO * count:
        return False
    return agree >= _UNANIMOUS_RATIO * (count + points.left_out_that_fit(start, sigma))


def _implausible(found: Fit, prior: MotionPrior) -> bool:
    """Whether the camera turns in another way than slip explains, or contradicts its prior as a whole."""
    beyond_rad = abs(found.back[1]) - prior.slip_rad
    if beyond_rad > 0.0:
        covariance = _inverse(found.information)
        if covariance is not None and beyond_rad**2 > _CERTAIN_CHI2 * covariance[1, 1]:
            return True
    return _conflict(found, prior.sigma)


def _fit_with_sweep(view: View, start: Pose, prior: MotionPrior, sweep: SweepPrior) -> _Fitted | None:
    """The fit with the prior of the sweep that explains more; None if there are too few points.

    Before the read-out time is known, the sweep may be larger than its prior admits, which then shows in the
    image.
    """
    if len(view.seen) < _MIN_POINTS:
        return None
    sigma = np.concatenate((prior.sigma, sweep.sigma_rad))
    found = fit(view, start, sigma)
    bend = bend_rad, bend_variance = _bend(found)
    if (np.square(bend_rad - found.sweep_rad) > _BENT_CHI2 * bend_variance).any():
        possible = np.concatenate((prior.sigma, sweep.max_rad))
        straightened = fit(view, start, possible)
        if straightened.inliers >= found.inliers + _STRAIGHTENED_SHARE * len(view.seen):
            return _Fitted(view, straightened, possible, _bend(straightened))
    return _Fitted(view, found, sigma, bend)


def _prior_only(start: Pose, sigma: FloatArray, inlier_ratio: float) -> CameraEstimate:
    """The estimate from the prior alone."""
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
    """The sweep and its variance, (2,) each, without its prior: one more Gauss-Newton step."""
    covariance = _inverse(found.free)
    if covariance is None:
        return np.zeros(2), np.full(2, np.inf)
    spread = covariance[6:]
    return found.free_from_rad + spread @ found.free_side, spread[:, 6:].diagonal()


def _inverse(information: FloatArray) -> FloatArray | None:
    """The covariance (8, 8) that information gives; None if it is singular.

    OpenCV returns zeros then, which would mean perfect knowledge.
    """
    regular, covariance = cv2.invert(information, flags=cv2.DECOMP_CHOLESKY)
    return np.asarray(covariance, np.float64) if regular else None


def _conflict(found: Fit, sigma: FloatArray) -> bool:
    """Whether yaw and translation differ from the prior by more than its sigma (6,) allows."""
    off = (found.back / sigma)[_YAW_AND_TRANSLATION]
    return float(off @ off) > _CONFLICT_CHI2
