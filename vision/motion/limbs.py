"""Bodies with moving limbs: when to believe fragments that disagree, and how much.

People are not rigid. Within half a step a shank accelerates from rest to more than twice the walker's speed.
Therefore:

* believable: whether the fragments of a body give its velocity. Either some agree, or the body is restless.
* variance: how far the velocity of the fragments may be from that of the body. It is large for one or two
  fragments of a mover, however precise they are, and where many fragments disagree, since some are on limbs.
* in_fixed_frame: the velocities as measurements for the filters of the tracks.
* restless: most of several ends contradict that the body is static, whether they agree with each other or
  not. A walking person is restless most of the time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled, inlined
from hal.types import FloatArray
from vision.motion.least_squares import BodyVelocities

_FEW_ENDS = 2  # one fragment: enough agreeing ends if they are at least _MIN_AGREEMENT of all
_SOME_ENDS = 4  # two fragments: enough agreeing ends, however many others there are
_MANY_ENDS = 6  # three fragments: fewer contradicting ends may all be on one sliding edge
_MIN_AGREEMENT = 0.2  # share of the ends
_RESTLESS = 0.7  # share of the ends that must contradict standing still
# Standard deviation if no ends agree. Limbs swing about as fast as their body moves. The same ones disagree
# for half a step, so this does not average out from frame to frame as noise does.
_DISAGREEMENT_MPS = 1.0
# Number of ends that one limb shows. The motion that several limbs have in common is that of the body.
_ENDS_PER_LIMB = 8.0
_GAIT = 0.6  # share of the body's speed by which one limb differs from the body over a step


@inlined
def _is_restless(body: BodyVelocities, g: int) -> bool:
    result: bool = body.ends[g] >= _MANY_ENDS and body.contradicts_static[g] >= _RESTLESS
    return result


@compiled(BodyVelocities)
def restless(body: BodyVelocities) -> NDArray[np.bool_]:
    """(G,) bodies most of whose ends contradict standing still, whether they agree with each other or not."""
    result = np.empty(len(body.ends), np.bool_)
    for g in range(len(body.ends)):
        result[g] = _is_restless(body, g)
    return result


@compiled(BodyVelocities)
def believable(body: BodyVelocities) -> NDArray[np.bool_]:
    """(G,) bodies whose velocity by their fragments can be believed."""
    result = np.empty(len(body.ends), np.bool_)
    for g in range(len(body.ends)):
        agreeing = body.agreement[g] * body.ends[g]
        alike = body.agreement[g] >= _MIN_AGREEMENT or agreeing >= _SOME_ENDS
        result[g] = (agreeing >= _FEW_ENDS and alike) or _is_restless(body, g)
    return result


@compiled(BodyVelocities, "float64[::1]")
def variance(body: BodyVelocities, speed_mps: FloatArray) -> FloatArray:
    """(G,) variance per axis (m^2/s^2) of the difference between the fragments' velocity and the body's.

    speed_mps (G,): of bodies that are known to move, 0 for others: a static body does not swing its limbs.
    """
    result = np.empty(len(speed_mps))
    for g in range(len(speed_mps)):
        agreeing = max(body.agreement[g] * body.ends[g], 1.0)
        # If some ends are static, the others are not limbs of a body that moves.
        limbs = max(body.ends[g] / _ENDS_PER_LIMB, 1.0) if _is_restless(body, g) else 1.0
        disagreement_mps, swing_mps = _DISAGREEMENT_MPS * (1.0 - body.agreement[g]), _GAIT * speed_mps[g]
        result[g] = disagreement_mps * disagreement_mps / limbs + swing_mps * swing_mps / agreeing
    return result


@compiled("float64[:, :], float64[:, :, :], float64[:], int64[::1], float64, float64[:, :]")
def in_fixed_frame(
    velocity_mps: FloatArray,
    covariance: FloatArray,
    swing: FloatArray,
    use: NDArray[np.intp],
    share: float,
    rotation: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Velocities (K, 3) of the tracks use (K,) in the fixed frame, to which rotation leads, and covariances
    (K, 3, 3): share times the given ones, plus swing, the variance by limbs, in each direction."""
    velocity, noise = np.zeros((len(use), 3)), np.zeros((len(use), 3, 3))
    for k in range(len(use)):
        t = use[k]
        for i in range(3):
            for m in range(3):
                velocity[k, i] += rotation[i, m] * velocity_mps[t, m]
            for j in range(3):
                for m in range(3):
                    for n in range(3):
                        noise[k, i, j] += rotation[i, m] * covariance[t, m, n] * share * rotation[j, n]
            noise[k, i, i] += swing[t]
    return velocity, noise
