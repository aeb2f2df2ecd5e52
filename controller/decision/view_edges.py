"""What is below and above the camera's view, by how far ahead of it that is. Heights are over the floor."""

from __future__ import annotations

import math

import numpy as np

from controller.decision.bodies import Bodies
from hal.types import FloatArray

# The height of what is seen only in part is known no better.
UNCERTAIN_M = 0.1
LEAST_TAN, _LEAST_M = 0.1, 1e-3
_MOST_CONSENT_M = 2.5


def consented_m(near_m: float, floor_from_m: float) -> float:
    """How far ahead of the camera the floor is free by the consent of whoever starts the robot: near_m, or to
    where it comes into view, from floor_from_m on, unless that is too far to be consented to."""
    return max(near_m, min(floor_from_m, _MOST_CONSENT_M))


def lowest_seen_m(ahead_m: FloatArray, height_m: float, near_m: float) -> FloatArray:
    """(N,) height of the lower edge of the view at ahead_m (N,) of a camera at height_m that sees the floor
    from near_m on."""
    return height_m * (1.0 - ahead_m / max(near_m, _LEAST_M))


def highest_seen_m(ahead_m: FloatArray, height_m: float, up_tan: float) -> FloatArray:
    """(N,) height of the upper edge, which rises by up_tan a metre; inf: nothing is known to be above it."""
    if math.isinf(up_tan):
        return np.full(ahead_m.shape, math.inf)
    return height_m + up_tan * np.maximum(ahead_m, 0.0)


def above_from_m(top_m: float, height_m: float, up_tan: float) -> float:
    """Nearer than this, something that is no higher than top_m may be above the view."""
    rise_m = top_m - height_m
    return max(rise_m, 0.0) / max(up_tan, LEAST_TAN)


def visible_from_m(
    bodies: Bodies, side_m: FloatArray, edge_tan: float, near_m: float, height_m: float, up_tan: float
) -> FloatArray:
    """(N,) how far ahead of the camera a body has to be so that it is seen: its middle within the edges of
    the view, its upper part above the lower one and its lower part below the upper one. side_m (N,): its
    middle beside the camera's axis."""
    lowest = np.clip(1.0 - (bodies.top_m - UNCERTAIN_M) / height_m, 0.0, 1.0)
    visible = np.maximum(np.abs(side_m) / max(edge_tan, LEAST_TAN), near_m * lowest)
    rise_m = np.maximum(bodies.bottom_m + UNCERTAIN_M - height_m, 0.0)
    result: FloatArray = np.maximum(visible, rise_m / max(up_tan, LEAST_TAN))
    return result
