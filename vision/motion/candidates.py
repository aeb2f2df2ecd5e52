"""Which fragments move, by their residuals, and which have long stood still; which moving ones are neighbours
that move alike (cluster)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled, inlined
from hal.types import FloatArray
from vision.motion.velocities import PointMotion

_STATIC_END_CHI2 = 6.0  # 95 % of static ends, 2 degrees of freedom
_STATIC_FRAGMENT_CHI2 = 18.5  # 99.9 % of static fragments, 4 degrees of freedom
_LONG_S = 0.26  # about the window of time in which motion is measured
_NEAR_M = 0.5  # fragments of one body are no farther apart: it is a chain of neighbours that makes a group
_VELOCITY_GATE_MPS = 0.5  # allowed for limbs, which go unlike their body, beside two sigmas


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
    return _clusters(
        np.ascontiguousarray(position_m),
        np.ascontiguousarray(velocity),
        np.ascontiguousarray(covariance),
        np.ascontiguousarray(depth_sigma_m),
    )


@inlined
def _alike(
    one: int,
    other: int,
    position_m: FloatArray,
    velocity: FloatArray,
    covariance: FloatArray,
    sigma_m: FloatArray,
) -> bool:
    """Whether two fragments are neighbours that move alike."""
    across_m = math.hypot(
        position_m[one, 0] - position_m[other, 0], 0.6 * (position_m[one, 1] - position_m[other, 1])
    )
    along_m = abs(position_m[one, 2] - position_m[other, 2])
    if not (across_m <= _NEAR_M and along_m <= _NEAR_M + (sigma_m[one] + sigma_m[other])):
        return False
    for i in range(2):
        sigma_mps = math.sqrt(covariance[one, i, i] + covariance[other, i, i])
        if not abs(velocity[one, i] - velocity[other, i]) <= _VELOCITY_GATE_MPS + 2.0 * sigma_mps:
            return False
    return True


@compiled("float64[:, ::1], float64[:, ::1], float64[:, :, ::1], float64[::1]")
def _clusters(
    position_m: FloatArray, velocity: FloatArray, covariance: FloatArray, sigma_m: FloatArray
) -> NDArray[np.intp]:
    """As cluster: from each fragment that has no group yet along the chains of its neighbours."""
    count = len(position_m)
    group, reached = np.full(count, -1), np.empty(count, np.intp)
    for first in range(count):
        if group[first] >= 0:
            continue
        group[first], reached[0], waiting = first, first, 1
        while waiting > 0:
            waiting -= 1
            one = reached[waiting]
            for other in range(first + 1, count):
                if group[other] < 0 and _alike(one, other, position_m, velocity, covariance, sigma_m):
                    group[other], reached[waiting] = first, other
                    waiting += 1
    return group
