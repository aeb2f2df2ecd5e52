"""What one frame says of whether the tracks move: what vision/judgement.py decides by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class MotionEvidence:
    """Of T tracks, along the axes of the fixed frame.

    sight (T, 3): unit vector from the camera; distance_m (T,); depth_sigma_m (T,): of one pixel's depth
    there. velocity (T, 3), covariance (T, 3, 3): as filtered. own_velocity, own_covariance: of this
    frame's fragments alone, from ends (T,) points of which agreement (T,) agree; restless (T,): by these it
    does not stand still, whether they agree or not; unrest_s (T,): for how long it has not.
    surface_velocity, surface_covariance: from the surface's centre alone.
    arrived (T,) and cells (T,) of its surface; size_m (T,): its greatest extent; clean_s (T,): for how long
    its centre has been seen without a break; view_radps (T,): how fast the camera comes to see it from
    another side; growth_mps (T,): how fast its centre may wander because its visible part grows or shrinks.
    goes (T,): its centre really goes about as fast as the velocity says. guessed (T,): where it ends in what
    stands around it is a guess. up (3,): the floor's normal, None
    where it is not known. trusted: the camera's motion is known. reckoned: odometry says it, too, not the
    images alone.
    """

    sight: FloatArray
    distance_m: FloatArray
    depth_sigma_m: FloatArray
    velocity: FloatArray
    covariance: FloatArray
    own_velocity: FloatArray
    own_covariance: FloatArray
    surface_velocity: FloatArray
    surface_covariance: FloatArray
    ends: NDArray[np.intp]
    agreement: FloatArray
    restless: NDArray[np.bool_]
    unrest_s: FloatArray
    arrived: NDArray[np.intp]
    cells: NDArray[np.intp]
    size_m: FloatArray
    clean_s: FloatArray
    view_radps: FloatArray
    growth_mps: FloatArray
    goes: NDArray[np.bool_]
    guessed: NDArray[np.bool_]
    up: FloatArray | None
    trusted: bool
    reckoned: bool
