"""Least-squares velocities: of each fragment by its two ends, and of each body by all ends that belong to it.

Also which moving fragments are neighbours that move alike (cluster), and which fragments are static or not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray
from vision.motion.velocities import (
    NormalEquations,
    PointMotion,
    end_information,
    normal_equations,
    solve_velocity,
)

_ROBUST_CHI2 = 9.0  # 99 % of ends that go with the body, 2 degrees of freedom; others lose their weight
_MEDIAN_CHI2 = 1.386  # of 2 degrees of freedom
_SPREAD_ENDS = 6  # fewer of them do not show how widely they scatter
_MOVED_CHI2 = 13.8  # 99.9 % of static ends, 2 degrees of freedom
_ANNEAL = (64.0, 16.0, 4.0, 1.0)  # from plain least squares to robust: a start at rest must not pin a mover
_INDEPENDENT_DEPTHS = 10.0  # depth noise is shared by neighbours: a body never has more looks than these
_STATIC_END_CHI2 = 6.0  # 95 % of static ends, 2 degrees of freedom
_STATIC_FRAGMENT_CHI2 = 18.5  # 99.9 % of static fragments, 4 degrees of freedom
_LONG_S = 0.26  # about the window of time in which motion is measured
_NEAR_M = 0.5  # fragments of one body are no farther apart: it is a chain of neighbours that makes a group
_VELOCITY_GATE_MPS = 0.5  # allowed for limbs, which go unlike their body, beside two sigmas


@dataclass(frozen=True, slots=True, eq=False)
class BodyVelocities:
    """Of G bodies: velocity_mps (G, 3) over ground, covariance (G, 3, 3), ends (G,) how many points
    speak, agreement (G,): share of them that agree; unexplained (G,): share of them that would not be
    where they are if the body stood still."""

    velocity_mps: FloatArray
    covariance: FloatArray
    ends: NDArray[np.intp]
    agreement: FloatArray
    unexplained: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class FragmentVelocities:
    """Of N fragments: velocity_mps (N, 3) over ground, covariance (N, 3, 3), each from its two ends alone.
    per_end (14, 2N): what every end says, see NormalEquations; then the information on the velocity along z
    in what depth itself does, and that times the velocity. Zero where an end is not usable."""

    per_end: FloatArray
    velocity_mps: FloatArray
    covariance: FloatArray


def fragment_velocities(motion: PointMotion, max_speed_mps: float) -> FragmentVelocities:
    """Weighted least squares for the two ends of each fragment."""
    per_end = np.empty((14, len(motion.lag_s)))
    per_end[:12] = normal_equations(motion, motion.usable.astype(float)).table
    known = motion.usable & (motion.depth_step_m == motion.depth_step_m)
    root = known * motion.depth_lag_s / motion.depth_step_sigma_m
    per_end[12] = root * root
    per_end[13] = root * (np.where(known, motion.depth_step_m, 0.0) / motion.depth_step_sigma_m)
    summed = per_end[:, 0::2] + per_end[:, 1::2]
    equations = NormalEquations(summed[:12])
    equations.add_depth(summed[12], summed[13])
    return FragmentVelocities(per_end, *solve_velocity(equations, max_speed_mps))


def body_velocities(
    motion: PointMotion,
    per_end: FloatArray,
    owner: NDArray[np.intp],
    bodies: int,
    start_mps: FloatArray,
    max_speed_mps: float,
) -> BodyVelocities:
    """Weighted least squares for one velocity per body, robust against ends that slide or swing.

    per_end (14, 2N): as in FragmentVelocities. owner (2N,): body of each end, -1 for none. start_mps (G, 3):
    velocity to judge outliers by at first.
    """
    use = motion.usable & (owner >= 0)
    member = np.zeros((bodies, len(owner)))
    chosen = use.nonzero()[0]
    member[owner[chosen], chosen] = 1.0
    ends = member.sum(axis=1).astype(np.intp)
    share = np.minimum(1.0, _INDEPENDENT_DEPTHS / np.maximum(ends, 1))
    velocity = start_mps
    safe_owner = np.where(use, owner, 0)
    used, trust = use.astype(float), end_information(motion)
    parties = _parties(chosen, owner, ends)
    for scale in _ANNEAL:
        chi2 = _end_chi2(motion, trust, velocity.T.take(safe_owner, axis=1))
        spread = _spread(chi2, parties)
        weight = used / np.square(1.0 + chi2 / (scale * _ROBUST_CHI2 * spread.take(safe_owner)))
        summed = per_end @ (member * weight).T
        equations = NormalEquations(summed[:12])
        equations.add_depth(summed[12] * share, summed[13] * share)
        velocity, covariance = solve_velocity(equations, max_speed_mps)
    chi2 = _end_chi2(motion, trust, velocity.T.take(safe_owner, axis=1))
    agree = member @ (chi2 <= _ROBUST_CHI2) / np.maximum(ends, 1)
    # What the model does not explain (limbs, turning, sliding) widens the result.
    spread = _spread(chi2, parties)
    bounded = np.minimum(chi2, _ROBUST_CHI2 * spread.take(safe_owner))
    excess = (member * bounded).sum(axis=1) / np.maximum(2.0 * ends - 3.0, 1.0)
    covariance = covariance * np.maximum(1.0, excess)[:, None, None]
    unexplained = member @ (motion.static_chi2 > _MOVED_CHI2) / np.maximum(ends, 1)
    return BodyVelocities(
        velocity_mps=velocity, covariance=covariance, ends=ends, agreement=agree, unexplained=unexplained
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Parties:
    """Who belongs to which of G bodies, the same in every iteration. chosen (M,): the ends that speak, owner
    (M,): body of each. many (K,): the bodies with many ends. middle (K,): where the middle end of each of
    them stands once the ends are sorted by body, then by any value."""

    bodies: int
    chosen: NDArray[np.intp]
    owner: NDArray[np.intp]
    many: NDArray[np.intp]
    middle: NDArray[np.intp]


def _parties(chosen: NDArray[np.intp], owner: NDArray[np.intp], ends: NDArray[np.intp]) -> _Parties:
    """ends (G,): how many of the ends chosen (M,) each body has; owner (2N,): of all ends."""
    many = (ends >= _SPREAD_ENDS).nonzero()[0]
    middle = (np.cumsum(ends) - ends + ends // 2)[many]
    return _Parties(bodies=len(ends), chosen=chosen, owner=owner[chosen], many=many, middle=middle)


def _spread(chi2: FloatArray, parties: _Parties) -> FloatArray:
    """(G,) how much more the ends of each body scatter than their own errors make them, by the median: >= 1.

    Limbs are no outliers of a rigid body: where half of the ends do not fit, the robust weights have to
    widen until they do, or the velocity becomes that of whichever limb comes first.
    """
    result = np.ones(parties.bodies)
    seen = chi2.take(parties.chosen)
    ordered = seen.take(np.lexsort((seen, parties.owner)))
    result[parties.many] = np.maximum(1.0, ordered.take(parties.middle) / _MEDIAN_CHI2)
    return result


def _end_chi2(motion: PointMotion, trust: FloatArray, velocity: FloatArray) -> FloatArray:
    """(2N,) chi-square of each end if it moves with velocity (3, 2N). trust: see end_information."""
    way = velocity * motion.lag_s
    # Both coordinates at once, and both rows of the quadratic form.
    miss = motion.miss_m.T - way[:2] + motion.ray.T * way[2]
    weighted = (trust[:2] * miss[0] + trust[1:] * miss[1]) * miss
    result: FloatArray = weighted[0] + weighted[1]
    return result


def moving_candidates(motion: PointMotion, age_frames: NDArray[np.intp]) -> NDArray[np.bool_]:
    """(N,) fragments that no static surface explains: both ends miss, at either depth of a silhouette."""
    chi2 = np.where(motion.usable, motion.static_chi2, 0.0)
    one, other = chi2[0::2], chi2[1::2]
    both = (one > _STATIC_END_CHI2) & (other > _STATIC_END_CHI2)
    result: NDArray[np.bool_] = both & (one + other > _STATIC_FRAGMENT_CHI2) & (age_frames >= 2)
    return result


def long_static(motion: PointMotion, age_s: FloatArray) -> NDArray[np.bool_]:
    """(N,) fragments seen for a while, age_s (N,), both of whose ends are where something static would be."""
    still = (motion.usable & (motion.static_chi2 <= _STATIC_END_CHI2)).reshape(-1, 2)
    result: NDArray[np.bool_] = still[:, 0] & still[:, 1] & (age_s >= _LONG_S)
    return result


def cluster(
    position_m: FloatArray, velocity: FloatArray, covariance: FloatArray, depth_sigma_m: FloatArray
) -> NDArray[np.intp]:
    """(M,) which group each of M moving fragments belongs to, as the index of its first one: neighbours in
    space that move alike are of one body."""
    count = len(position_m)
    if count == 0:
        return np.empty(0, np.intp)
    gap = np.abs(position_m[:, None] - position_m[None])
    sigma = depth_sigma_m[:, None] + depth_sigma_m[None]
    near = (np.hypot(gap[..., 0], 0.6 * gap[..., 1]) <= _NEAR_M) & (gap[..., 2] <= _NEAR_M + sigma)
    variance = np.diagonal(covariance, axis1=1, axis2=2)[:, :2]
    tolerance = _VELOCITY_GATE_MPS + 2.0 * np.sqrt(variance[:, None] + variance[None])
    alike = (np.abs(velocity[:, None, :2] - velocity[None, :, :2]) <= tolerance).all(axis=2)
    linked = near & alike
    group = np.arange(count)
    while True:
        lowest = np.where(linked, group[None], count).min(axis=1)
        lowest = lowest[lowest]
        if (lowest == group).all():
            break
        group = lowest
    return group
