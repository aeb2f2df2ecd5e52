"""Bodies whose parts move by themselves: when to believe fragments that disagree, and how far.

People are not rigid. Within half a step a shank goes from rest to more than twice the walker's speed. So:

* believable: whether the fragments of a body tell its velocity: some agree, or the body is restless.
* variance: how far the fragments' velocity may be from the body's. Great for one or two fragments of a
  mover, however sharply they are seen, and where many fragments disagree: some of these are limbs.
* restless: of 6 ends or more, 70 % contradict that the body stands still, whether they agree with each other
  or not. A walker is restless most of the time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray
from vision.motion.least_squares import BodyVelocities

_FEW_ENDS = 2  # of one fragment, if a fifth of all agrees with it
_SOME_ENDS = 4  # of two: these speak, however many others there are
_MANY_ENDS = 6  # of three: fewer that deny may all be on one sliding edge
_LEAST_AGREEMENT = 0.2  # of the ends
_RESTLESS = 0.7  # of the ends: so many must be where nothing that stands still would have them
# Limbs swing about as fast as their body goes. For half a step it is the same ones that disagree: that is
# no noise which averages out from frame to frame.
_DISAGREEMENT_MPS = 1.0
# What several limbs have in common is their body's; a limb and what belongs to it shows so many ends.
_ENDS_PER_LIMB = 8.0
_GAIT = 0.6  # of the body's speed: what one limb, over a step, has more or less than its body


def restless(body: BodyVelocities) -> NDArray[np.bool_]:
    """(G,) bodies that do not stand still by the word of many ends, whether these agree with each other
    or not."""
    result: NDArray[np.bool_] = (body.ends >= _MANY_ENDS) & (body.unexplained >= _RESTLESS)
    return result


def believable(body: BodyVelocities) -> NDArray[np.bool_]:
    """(G,) bodies of which the fragments tell the velocity."""
    agreeing = body.agreement * body.ends
    alike = (agreeing >= _FEW_ENDS) & ((body.agreement >= _LEAST_AGREEMENT) | (agreeing >= _SOME_ENDS))
    result: NDArray[np.bool_] = alike | restless(body)
    return result


def variance(body: BodyVelocities, speed_mps: FloatArray) -> FloatArray:
    """(G,) m^2/s^2 by which the velocity of the fragments may differ from that of the body, per axis.

    speed_mps (G,): of bodies that are known to move, 0 for others: what stands does not swing its limbs.
    """
    agreeing = np.maximum(body.agreement * body.ends, 1.0)
    # Where some ends stand, the others are no limbs of a body that goes.
    limbs = np.where(restless(body), np.maximum(body.ends / _ENDS_PER_LIMB, 1.0), 1.0)
    result: FloatArray = (
        np.square(_DISAGREEMENT_MPS * (1.0 - body.agreement)) / limbs
        + np.square(_GAIT * speed_mps) / agreeing
    )
    return result
