"""Ends that slide along their own edge: the speed along the line of sight that few fragments cannot tell.

Along the line of sight, fragments measure by their length. Where an edge ends at something behind the body,
such as a seam of the ceiling behind the corner of a lorry, that end is no point of the body. As the body
moves, it slides along the edge, and the length changes as if the body came nearer or went away. Many
fragments outvote it, and so does the centre of a surface that is seen from side to side. vision/tracker.py
asks for the bodies where neither is there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled
from hal.types import FloatArray
from vision.motion.least_squares import BodyVelocities

_MANY_ENDS = 8  # four fragments, as for a proof of motion along the line of sight (proof_rules.py)
SLIDING_MPS = 3.0  # an end slides about as fast as its body and the robot move


@compiled(BodyVelocities, "boolean[:], int64[::1], float64[:, :]")
def variance(
    body: BodyVelocities, cut: NDArray[np.bool_], use: NDArray[np.intp], sight: FloatArray
) -> FloatArray:
    """(K, 3, 3) additional covariance (m^2/s^2) of the velocities by fragments of the tracks use (K,).

    cut (T,): tracks that the left or right border of the image cuts. sight (T, 3): unit vectors to them.
    """
    result = np.zeros((len(use), 3, 3))
    for k in range(len(use)):
        t = use[k]
        if cut[t] and body.agreement[t] * body.ends[t] < _MANY_ENDS:
            for i in range(3):
                for j in range(3):
                    result[k, i, j] = SLIDING_MPS**2 * (sight[t, i] * sight[t, j])
    return result
