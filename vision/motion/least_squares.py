"""Least-squares velocities over ground: of each fragment by its two ends, of each body by all of its ends.

Both sum the linear equations of vision/motion/velocities.py over ends and solve for one velocity. That of a
body is robust (iteratively reweighted), since some of its ends slide along edges or are on limbs.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled, inlined
from hal.records import record
from hal.types import FloatArray, Integers, Matrices, Matrix, Vector
from vision.motion.velocities import EndResiduals, normal_equations

ROBUST_CHI2 = 9.0  # 99 % of ends that move with the body, 2 degrees of freedom; others lose their weight
_MEDIAN_CHI2 = 1.386  # median for 2 degrees of freedom
_SPREAD_ENDS = 6  # minimum number of ends to estimate their scatter
MOVED_CHI2 = 13.8  # 99.9 % of static ends, 2 degrees of freedom; ends above contradict standing still
# Scale of the robust weights: from plain least squares to robust, so that a mover is not held at the start
# velocity of 0.
_ANNEAL = (64.0, 16.0, 4.0, 1.0)
_INDEPENDENT_DEPTHS = 10.0  # neighbours share depth noise: a body has no more independent depths than this


@record(frozen=True, slots=True, eq=False)
class BodyVelocities:
    """Velocities of G bodies.

    velocity_mps: over ground, (G, 3).
    covariance: (G, 3, 3).
    ends: number of usable ends, (G,).
    agreement: share of them that agree with the velocity, (G,).
    contradicts_static: share of them that contradict a static body, (G,).
    """

    velocity_mps: Matrix
    covariance: Matrices
    ends: Integers
    agreement: Vector
    contradicts_static: Vector


@record(frozen=True, slots=True, eq=False)
class FragmentVelocities:
    """Velocities of N fragments, each from its two ends alone.

    per_end (14, 2N): the equations of every end. Rows 0 to 11 as of normal_equations; row 12: information on
    the velocity along z from the change of depth; row 13: the same times that velocity. Zero where an end is
    not usable. velocity_mps (N, 3): over ground. covariance (N, 3, 3).
    """

    per_end: Matrix
    velocity_mps: Matrix
    covariance: Matrices


def fragment_velocities(motion: EndResiduals, max_speed_mps: float) -> FragmentVelocities:
    """Weighted least squares over the two ends of each fragment."""
    equations = normal_equations(motion, motion.usable.astype(float))
    per_end, velocity_mps, covariance = _fragments(motion, equations, max_speed_mps)
    return FragmentVelocities(per_end, velocity_mps, covariance)


def body_velocities(
    motion: EndResiduals,
    per_end: FloatArray,
    owner: NDArray[np.intp],
    bodies: int,
    start_mps: FloatArray,
    max_speed_mps: float,
) -> BodyVelocities:
    """Robust weighted least squares for one velocity per body; some ends may slide or be on limbs.

    per_end (14, 2N): as in FragmentVelocities. owner (2N,): body of each end, -1 for none. bodies: G.
    start_mps (G, 3): velocities at which the first weights are computed.
    """
    first, members = _grouped(
        np.ascontiguousarray(owner, np.int64), np.ascontiguousarray(motion.usable), bodies
    )
    velocity_mps, covariance, agreement, contradicts_static = _bodies(
        first, members, motion, per_end, start_mps, max_speed_mps
    )
    return BodyVelocities(velocity_mps, covariance, first[1:] - first[:-1], agreement, contradicts_static)


@inlined
def _solve(sums: FloatArray, max_speed_mps: float, velocity_mps: FloatArray, covariance: FloatArray) -> None:
    """Solve for a velocity and put it and its covariance into velocity_mps (3,) and covariance (3, 3).

    sums (14,): per_end of FragmentVelocities, summed over ends. Directions that the equations do not
    determine get a standard deviation of max_speed_mps (the paper's V_omax), not 0.
    """
    least = 1.0 / max_speed_mps**2
    xx, xy, xz = sums[0] + least, sums[1], sums[2]
    yy, yz, zz = sums[3] + least, sums[4], sums[5] + sums[12] + least
    # The inverse, by its cofactors.
    c00, c01, c02 = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    c11, c12, c22 = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    scale = 1.0 / (xx * c00 + xy * c01 + xz * c02)
    c00, c01, c02 = c00 * scale, c01 * scale, c02 * scale
    c11, c12, c22 = c11 * scale, c12 * scale, c22 * scale
    x, y, z = sums[6], sums[7], sums[8] + sums[13]
    velocity_mps[0] = c00 * x + c01 * y + c02 * z
    velocity_mps[1] = c01 * x + c11 * y + c12 * z
    velocity_mps[2] = c02 * x + c12 * y + c22 * z
    # The effect of one sigma of a depth error that all ends share.
    x, y, z = sums[9], sums[10], sums[11]
    x, y, z = c00 * x + c01 * y + c02 * z, c01 * x + c11 * y + c12 * z, c02 * x + c12 * y + c22 * z
    covariance[0, 0], covariance[1, 1], covariance[2, 2] = c00 + x * x, c11 + y * y, c22 + z * z
    covariance[0, 1] = covariance[1, 0] = c01 + x * y
    covariance[0, 2] = covariance[2, 0] = c02 + x * z
    covariance[1, 2] = covariance[2, 1] = c12 + y * z


@compiled(EndResiduals, "float64[:, ::1], float64")
def _fragments(
    motion: EndResiduals, equations: FloatArray, max_speed_mps: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The fields of FragmentVelocities. equations (12, 2N): see normal_equations."""
    ends = len(motion.usable)
    per_end = np.zeros((14, ends))
    per_end[:12] = equations
    for k in range(ends):
        step_m, sigma_m = motion.depth_step_m[k], motion.depth_step_sigma_m[k]
        if motion.usable[k] and not np.isnan(step_m):
            root = motion.depth_lag_s[k] / sigma_m
            per_end[12, k] = root * root
            per_end[13, k] = root * (step_m / sigma_m)
    velocity_mps, covariance = np.empty((ends // 2, 3)), np.empty((ends // 2, 3, 3))
    sums = np.empty(14)
    for k in range(ends // 2):
        for row in range(14):
            sums[row] = per_end[row, 2 * k] + per_end[row, 2 * k + 1]
        _solve(sums, max_speed_mps, velocity_mps[k], covariance[k])
    return per_end, velocity_mps, covariance


@compiled("int64[::1], bool[::1], int64")
def _grouped(
    owner: NDArray[np.int64], usable: NDArray[np.bool_], bodies: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """first (G + 1,), members (M,): the usable ends of body g are members[first[g] : first[g + 1]]."""
    first = np.zeros(bodies + 1, np.intp)
    for k in range(len(owner)):
        if usable[k] and 0 <= owner[k] < bodies:
            first[owner[k] + 1] += 1
    for g in range(bodies):
        first[g + 1] += first[g]
    members, filled = np.empty(first[bodies], np.intp), first.copy()
    for k in range(len(owner)):
        if usable[k] and 0 <= owner[k] < bodies:
            members[filled[owner[k]]] = k
            filled[owner[k]] += 1
    return first, members


@inlined
def _upper_median(values: FloatArray) -> float:
    """The value that would be at M // 2 if values (M,) were sorted (quickselect)."""
    values, middle = values.copy(), len(values) // 2
    low, high = 0, len(values) - 1
    while low < high:
        pivot, left, right = values[middle], low, high
        while left <= right:
            while values[left] < pivot:
                left += 1
            while pivot < values[right]:
                right -= 1
            if left <= right:
                values[left], values[right] = values[right], values[left]
                left += 1
                right -= 1
        if right < middle:
            low = left
        if left > middle:
            high = right
    result: float = values[middle]
    return result


@inlined
def _spread(chi2: FloatArray) -> float:
    """Ratio of the scatter of a body's ends, by the median of their chi2 (M,), to that of their noise: >= 1.

    Ends on limbs are not outliers of a rigid body. Where half of the ends do not fit, the robust weights have
    to widen until they do, or the velocity becomes that of an arbitrary limb.
    """
    if len(chi2) < _SPREAD_ENDS:
        return 1.0
    result: float = max(1.0, _upper_median(chi2) / _MEDIAN_CHI2)
    return result


@inlined
def end_information(covariance: FloatArray, effect: FloatArray, result: FloatArray) -> None:
    """Put the inverse of covariance + effect * effect' into result (3,): its entries xx, xy, yy.

    covariance (3,): xx, xy, yy. effect (2,): change by one sigma of depth.
    """
    xx = covariance[0] + effect[0] * effect[0]
    xy = covariance[1] + effect[0] * effect[1]
    yy = covariance[2] + effect[1] * effect[1]
    determinant = max(xx * yy - xy * xy, 1e-18)
    result[0], result[1], result[2] = yy / determinant, -xy / determinant, xx / determinant


@inlined
def end_chi2(motion: EndResiduals, k: int, velocity_mps: FloatArray, information: FloatArray) -> float:
    """Chi-square of end k with this information (3,) under the hypothesis of velocity (3,)."""
    ray, residual_m, lag_s = motion.ray[k], motion.residual_m[k], motion.lag_s[k]
    a = residual_m[0] - lag_s * (velocity_mps[0] - ray[0] * velocity_mps[2])
    b = residual_m[1] - lag_s * (velocity_mps[1] - ray[1] * velocity_mps[2])
    result: float = (information[0] * a + information[1] * b) * a + (
        information[1] * a + information[2] * b
    ) * b
    return result


@compiled("int64[::1], int64[::1]", EndResiduals, "float64[:, :], float64[:, :], float64")
def _bodies(
    first: NDArray[np.intp],
    members: NDArray[np.intp],
    motion: EndResiduals,
    per_end: FloatArray,
    start_mps: FloatArray,
    max_speed_mps: float,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """velocity_mps, covariance, agreement and contradicts_static of BodyVelocities.

    first, members: see _grouped. per_end, start_mps, max_speed_mps: see body_velocities.
    """
    bodies = len(first) - 1
    velocity_mps, spread_out = start_mps.copy(), np.empty((bodies, 3, 3))
    agreement, contradicts_static = np.zeros(bodies), np.zeros(bodies)
    information, sums = np.empty((len(motion.lag_s), 3)), np.empty(14)
    for k in members:
        end_information(motion.covariance[k], motion.depth_effect[k], information[k])
    for g in range(bodies):
        own = members[first[g] : first[g + 1]]
        ends = len(own)
        chi2 = np.empty(ends)
        share = min(1.0, _INDEPENDENT_DEPTHS / max(ends, 1))
        for scale in _ANNEAL:
            for j in range(ends):
                k = own[j]
                chi2[j] = end_chi2(motion, k, velocity_mps[g], information[k])
            admitted = scale * ROBUST_CHI2 * _spread(chi2)
            sums[:] = 0.0
            for j in range(ends):
                weight = 1.0 / (1.0 + chi2[j] / admitted) ** 2
                for row in range(14):
                    sums[row] += weight * per_end[row, own[j]]
            sums[12:] *= share
            _solve(sums, max_speed_mps, velocity_mps[g], spread_out[g])
        for j in range(ends):
            k = own[j]
            chi2[j] = end_chi2(motion, k, velocity_mps[g], information[k])
            agreement[g] += chi2[j] <= ROBUST_CHI2
            contradicts_static[g] += motion.static_chi2[k] > MOVED_CHI2
        agreement[g] /= max(ends, 1)
        contradicts_static[g] /= max(ends, 1)
        # Motion that the model does not explain (limbs, rotation, sliding) increases the covariance.
        excess = np.minimum(chi2, ROBUST_CHI2 * _spread(chi2)).sum() / max(2.0 * ends - 3.0, 1.0)
        spread_out[g] *= max(1.0, excess)
    return velocity_mps, spread_out, agreement, contradicts_static
