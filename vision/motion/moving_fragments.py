"""Which fragments move by their residuals, which have long been static, and which neighbours move alike.

Used by vision/bodies/carving.py and adoption.py.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled, inlined
from hal.types import FloatArray
from vision.motion.velocities import STATIC_END_CHI2, EndResiduals

_STATIC_FRAGMENT_CHI2 = 18.5  # 99.9 % of static fragments, 4 degrees of freedom
_LONG_S = 0.26  # about the time window over which motion is measured
_NEAR_M = 0.5  # maximum distance of neighbours; a chain of neighbours makes a group
_UPRIGHT = 0.6  # a distance upwards counts for less, by this factor: bodies are taller than wide
_VELOCITY_GATE_MPS = 0.5  # plus two sigmas: allows for limbs, which move differently from their body


@compiled(EndResiduals, "int64[:]")
def moving_candidates(motion: EndResiduals, age_frames: NDArray[np.intp]) -> NDArray[np.bool_]:
    """(N,) fragments that no static surface explains.

    Both ends contradict it, at the near and at the far depth of a silhouette.
    """
    result = np.empty(len(age_frames), np.bool_)
    for n in range(len(age_frames)):
        usable = motion.usable[2 * n] and motion.usable[2 * n + 1]
        one, other = motion.static_chi2[2 * n], motion.static_chi2[2 * n + 1]
        both = usable and one > STATIC_END_CHI2 and other > STATIC_END_CHI2
        result[n] = both and one + other > _STATIC_FRAGMENT_CHI2 and age_frames[n] >= 2
    return result


@compiled(EndResiduals, "float64[:]")
def long_static(motion: EndResiduals, age_s: FloatArray) -> NDArray[np.bool_]:
    """(N,) fragments of some age, age_s (N,), both of whose ends are static by their residuals."""
    result = np.empty(len(age_s), np.bool_)
    for n in range(len(age_s)):
        usable = motion.usable[2 * n] and motion.usable[2 * n + 1]
        most = max(motion.static_chi2[2 * n], motion.static_chi2[2 * n + 1])
        result[n] = usable and most <= STATIC_END_CHI2 and age_s[n] >= _LONG_S
    return result


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
        position_m[one, 0] - position_m[other, 0], _UPRIGHT * (position_m[one, 1] - position_m[other, 1])
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
def cluster(
    position_m: FloatArray, velocity: FloatArray, covariance: FloatArray, sigma_m: FloatArray
) -> NDArray[np.intp]:
    """(M,) group of each of M moving fragments, as the index of the group's first fragment.

    Neighbours in space that move alike belong to one group: it spreads from a fragment without one along the
    chains of its neighbours. position_m (M, 3), velocity (M, 3), covariance (M, 3, 3): in the camera's axes.
    sigma_m (M,): depth noise at their distance.
    """
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
