"""Robust Gauss-Newton on the reprojection error: the camera pose that fits where anchored points are seen.

For a pose of the camera, the points of a View (vision/ego_motion/reprojection.py) are predicted in the image.
The residual of a point is how far from there it is seen. Residuals and their derivatives by the unknowns are
in standard deviations of the pixel noise. The unknowns are a small motion of the camera (rotation 3,
translation 3) and its sweep (2). The variance of a point's depth acts along its epipolar line only; it is
included by the Sherman-Morrison formula.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled, in_place, inlined
from hal.records import record
from hal.types import FloatArray, Pose
from vision.camera.lens import MIN_AHEAD_M
from vision.ego_motion.pose_arrays import as_array, back_to, in_camera, moved, turned_back
from vision.ego_motion.reprojection import View

_GATE_CHI2 = 9.21  # 99 % of static points, 2 degrees of freedom
_ITERATIONS = 6  # maximum: two that anneal, the others until convergence
_ANNEAL = (32.0, 4.0)  # scale of the robust weights in the first iterations; 1 after them
_CONVERGED_SIGMAS = 0.2  # a smaller step is negligible beside the uncertainty of the pose
_STRAIGHT = 1e-3  # maximum motion (rad, m) for which the linearisation is exact to 0.01 px
_UNKNOWNS = 8  # rotation and translation (3 each), sweep about x and y
_SWEEP = 6  # index of the first unknown of the sweep
_RESIDUAL = _UNKNOWNS  # column of the residual, after those of the derivatives


@record(frozen=True, slots=True, eq=False)
class Fit:
    """Result of a fit.

    pose: the camera in the fixed frame.
    sweep_rad: about x and y, (2,).
    back: the small motion of pose that leads back to the start of the fit, (6,).
    information: of a small motion and the sweep, (8, 8).
    inliers: number of points that fit.
    free, free_side: normal equations of the last step without the prior of the sweep, (8, 8) and (8,).
    free_from_rad: the sweep at which these were linearised, (2,).
    """

    pose: Pose
    sweep_rad: FloatArray
    back: FloatArray
    information: FloatArray
    inliers: int
    free: FloatArray
    free_side: FloatArray
    free_from_rad: FloatArray


def fit(view: View, start: Pose, sigma: FloatArray) -> Fit:
    """Iteratively reweighted Gauss-Newton from start. sigma (8,): prior of the motion and the sweep."""
    pose, sweep_rad, back, information, inliers, free, free_side, free_from_rad = _fitted(
        view, as_array(start), np.ascontiguousarray(sigma)
    )
    return Fit(
        pose=Pose(pose[:, :3].copy(), pose[:, 3].copy()),
        sweep_rad=sweep_rad,
        back=back,
        information=information,
        inliers=inliers,
        free=free,
        free_side=free_side,
        free_from_rad=free_from_rad,
    )


def misfits(view: View, found: Fit) -> FloatArray:
    """(N,) chi-square of each point at the pose and sweep of a fit; inf if it is behind the camera."""
    return _misfits(view, as_array(found.pose), found.sweep_rad)


@inlined
def _shifted(view: View, start: FloatArray, sigma: FloatArray) -> FloatArray:
    """A better start pose: start rotated by the median residual of all points, by 3 sigma (8,) at most."""
    count, seen = len(view.seen), view.seen
    across, down, turn = np.empty(count), np.empty(count), np.zeros(6)
    for k in range(count):
        x, y, z = in_camera(start, view.lines[k, 0])
        ahead = max(z, MIN_AHEAD_M)
        across[k], down[k] = seen[k, 0] - x / ahead, seen[k, 1] - y / ahead
    turn[0] = min(max(np.median(down), -3.0 * sigma[0]), 3.0 * sigma[0])
    turn[1] = min(max(-np.median(across), -3.0 * sigma[1]), 3.0 * sigma[1])
    return moved(start, turn)


@inlined
def _linearised(
    view: View, pose: FloatArray, sweep_rad: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.bool_]]:
    """Linearise the residuals at a pose and sweep.

    table (N, 2, 9): derivatives by the unknowns, then the residual; across and down the image, in sigmas.
    by_depth (N, 2): derivative by depth.
    depth_downweight (N,): the factor by which the variance of depth reduces the weight of an error along
        by_depth (Sherman-Morrison).
    in_front (N,): in front of the camera.
    """
    lines, seen, whitening = view.lines, view.seen, view.whitening
    count = len(seen)
    table, by_depth = np.empty((count, 2, _UNKNOWNS + 1)), np.empty((count, 2))
    depth_downweight, in_front = np.empty(count), np.empty(count, np.bool_)
    for k in range(count):
        x, y, z = in_camera(pose, lines[k, 0])
        dx, dy, dz = turned_back(pose, lines[k, 1, 0], lines[k, 1, 1], lines[k, 1, 2])
        in_front[k] = z > MIN_AHEAD_M
        inverse = 1.0 / max(z, MIN_AHEAD_M)
        x, y = x * inverse, y * inverse
        # If the camera turns by w and moves by v, a point p moves by -(w x p) - v in its frame.
        across, down = table[k, 0], table[k, 1]
        across[0], down[0] = x * y, 1.0 + y * y
        across[1], down[1] = -1.0 - x * x, -x * y
        across[2], down[2] = y, -x
        across[3], down[3] = -inverse, 0.0
        across[4], down[4] = 0.0, -inverse
        across[5], down[5] = x * inverse, y * inverse
        across[_RESIDUAL], down[_RESIDUAL] = seen[k, 0] - x, seen[k, 1] - y
        for i in range(2):
            across[_SWEEP + i], down[_SWEEP + i] = across[i] * seen[k, 2], down[i] * seen[k, 2]
            across[_RESIDUAL] -= across[_SWEEP + i] * sweep_rad[i]
            down[_RESIDUAL] -= down[_SWEEP + i] * sweep_rad[i]
        own, mixed, other = whitening[k, 0], whitening[k, 1], whitening[k, 2]
        for i in range(_UNKNOWNS + 1):
            down[i] = down[i] * other + across[i] * mixed
            across[i] *= own
        dx, dy = inverse * (dx - x * dz), inverse * (dy - y * dz)
        dx, dy = dx * own, dy * other + dx * mixed
        by_depth[k, 0], by_depth[k, 1] = dx, dy
        # Depth's share of the covariance: only along the epipolar line.
        depth_downweight[k] = whitening[k, 3] / (1.0 + whitening[k, 3] * (dx * dx + dy * dy))
    return table, by_depth, depth_downweight, in_front


@in_place
def _chi2(rows: FloatArray, by_depth: FloatArray, depth_downweight: float) -> float:
    """Chi-square of a point with rows (2, 9) of table."""
    a, b = rows[0, _RESIDUAL], rows[1, _RESIDUAL]
    along = a * by_depth[0] + b * by_depth[1]
    result: float = a * a + b * b - depth_downweight * along * along
    return result


@in_place
def _assumed_variance(rows: FloatArray, sigma: FloatArray) -> float:
    """Variance of a point's predicted position by the prior sigma (8,) alone, in pixel variances."""
    result = 0.0
    for i in range(_UNKNOWNS):
        result += sigma[i] * sigma[i] * (rows[0, i] * rows[0, i] + rows[1, i] * rows[1, i])
    return result


@in_place
def _add(
    rows: FloatArray, by_depth: FloatArray, depth_downweight: float, weight: float, normal: FloatArray
) -> None:
    """Add a point to the upper half of normal (8, 9): normal matrix and, in the last column, right side."""
    for j in range(_UNKNOWNS + 1):
        along = depth_downweight * (rows[0, j] * by_depth[0] + rows[1, j] * by_depth[1])
        a, b = weight * (rows[0, j] - along * by_depth[0]), weight * (rows[1, j] - along * by_depth[1])
        for i in range(min(j + 1, _UNKNOWNS)):
            normal[i, j] += rows[0, i] * a + rows[1, i] * b


@inlined
def _solved(matrix: FloatArray, side: FloatArray) -> FloatArray:
    """Solve matrix x = side for a positive definite matrix (8, 8), by Cholesky factorisation."""
    factor, result = np.zeros_like(matrix), side.copy()
    for i in range(_UNKNOWNS):
        for j in range(i + 1):
            rest = matrix[i, j]
            for k in range(j):
                rest -= factor[i, k] * factor[j, k]
            factor[i, j] = math.sqrt(rest) if i == j else rest / factor[j, j]
        for k in range(i):
            result[i] -= factor[i, k] * result[k]
        result[i] /= factor[i, i]
    for i in range(_UNKNOWNS - 1, -1, -1):
        for k in range(i + 1, _UNKNOWNS):
            result[i] -= factor[k, i] * result[k]
        result[i] /= factor[i, i]
    return result


@in_place
def _add_prior(
    matrix: FloatArray, side: FloatArray, prior: FloatArray, to_prior: FloatArray, first: int, end: int
) -> None:
    """Add the prior of the unknowns first to end - 1: information (8,), and the way to its mean (8,)."""
    for i in range(first, end):
        matrix[i, i] += prior[i]
        side[i] += prior[i] * to_prior[i]


@in_place
def _reduce_residuals(table: FloatArray, step: FloatArray) -> None:
    """Put the residuals in table (N, 2, 9) to where they are after a step (8,), to first order."""
    for k in range(len(table)):
        for i in range(_UNKNOWNS):
            table[k, 0, _RESIDUAL] -= step[i] * table[k, 0, i]
            table[k, 1, _RESIDUAL] -= step[i] * table[k, 1, i]


@compiled(View, "float64[:, ::1], float64[::1]")
def _fitted(
    view: View, start: FloatArray, sigma: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, int, FloatArray, FloatArray, FloatArray]:
    """The fields of Fit. Poses are (3, 4): rotation and translation."""
    prior, pose, sweep_rad = 1.0 / np.square(sigma), _shifted(view, start, sigma), np.zeros(2)
    table, by_depth, depth_downweight, in_front = _linearised(view, pose, sweep_rad)
    # to_prior: from the present estimate to the prior mean. since_linearised: the sum of steps since the
    # linearisation.
    to_prior, since_linearised = np.zeros(_UNKNOWNS), np.zeros(_UNKNOWNS)
    to_prior[:_SWEEP] = back_to(pose, start)
    count = len(view.seen)
    chi2, allowed = np.empty(count), np.zeros(count, np.bool_)
    for iteration in range(_ITERATIONS):
        scale = _ANNEAL[iteration] if iteration < len(_ANNEAL) else 1.0
        normal = np.zeros((_UNKNOWNS, _UNKNOWNS + 1))
        for k in range(count):
            chi2[k] = _chi2(table[k], by_depth[k], depth_downweight[k])
            if iteration == 0:
                gate = _GATE_CHI2 * (1.0 + _assumed_variance(table[k], sigma))
                allowed[k] = in_front[k] and chi2[k] <= gate
            if allowed[k] and in_front[k]:
                weight = 1.0 / (scale * (1.0 + chi2[k] / (_GATE_CHI2 * scale)) ** 2)
                _add(table[k], by_depth[k], depth_downweight[k], weight, normal)
        for i in range(_UNKNOWNS):
            normal[i:, i] = normal[i, i:_UNKNOWNS]  # the lower half, by symmetry
        # First with the prior of the motion alone (free), then with that of the sweep as well.
        free, free_side = normal[:, :_UNKNOWNS].copy(), normal[:, _RESIDUAL].copy()
        free_from_rad = -to_prior[_SWEEP:]
        _add_prior(free, free_side, prior, to_prior, 0, _SWEEP)
        information, side = free.copy(), free_side.copy()
        _add_prior(information, side, prior, to_prior, _SWEEP, _UNKNOWNS)
        step = _solved(information, side)
        since_linearised += step
        # step * side is the squared length of the step in standard deviations.
        if iteration >= len(_ANNEAL) and (step * side).sum() < _CONVERGED_SIGMAS**2:
            break
        if np.abs(since_linearised).max() > _STRAIGHT:
            pose, sweep_rad = moved(pose, since_linearised), sweep_rad + since_linearised[_SWEEP:]
            since_linearised[:] = 0.0
            table, by_depth, depth_downweight, in_front = _linearised(view, pose, sweep_rad)
            to_prior[:_SWEEP], to_prior[_SWEEP:] = back_to(pose, start), -sweep_rad
        else:
            to_prior -= step
            _reduce_residuals(table, step)
    pose, inliers = moved(pose, since_linearised), 0
    for k in range(count):
        inliers += allowed[k] and chi2[k] <= _GATE_CHI2
    sweep_rad = sweep_rad + since_linearised[_SWEEP:]
    return pose, sweep_rad, back_to(pose, start), information, inliers, free, free_side, free_from_rad


@compiled(View, "float64[:, ::1], float64[::1]")
def _misfits(view: View, pose: FloatArray, sweep_rad: FloatArray) -> FloatArray:
    """As misfits()."""
    table, by_depth, depth_downweight, in_front = _linearised(view, pose, sweep_rad)
    chi2 = np.full(len(view.seen), np.inf)
    for k in range(len(chi2)):
        if in_front[k]:
            chi2[k] = _chi2(table[k], by_depth[k], depth_downweight[k])
    return chi2
