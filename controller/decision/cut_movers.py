"""Movers that come in from beside the view: their near side may still be beyond the edge.

Of something wide that drives in from the side, the far corner comes into view first, and the near one last.
As long as the near corner of its box lies on the edge of the view, the body may extend nearer to the robot.
controller/decision/world_model.py asks once a scene.
"""

from __future__ import annotations

import math

import numpy as np

from controller.decision.bodies import Bodies, extended_towards
from controller.decision.view_edges import CurrentView, ahead_and_left, reaches_side_edge
from hal.compiled import compiled
from hal.directions import along_and_left
from hal.types import FloatArray

# How much nearer it may extend: about the width of a vehicle in a hall.
_HIDDEN_M = 1.0
# It does not extend nearer to the robot's front than this: more than the robot drives between exposure and
# decision, plus ALONGSIDE_M (controller/decision/limits.py). Else it would count as something that the front
# has passed, and the robot would stop braking for it.
LEAST_AHEAD_M = 0.3
# What comes in slower than this, or rather along the view than across it, is seen in time.
_MIN_INWARDS_MPS = 0.3


def with_hidden_near_sides(boxes: Bodies, view: CurrentView, front_m: float) -> Bodies:
    """The boxes, those of movers that come in over the edge of the view extended towards the robot.

    front_m: from the robot's turning centre to its foremost point.
    """
    if not np.count_nonzero(boxes.moving):
        return boxes
    hidden_m = _hidden(boxes, view, max(front_m - view.forward_m + LEAST_AHEAD_M, 0.0))
    if not np.count_nonzero(hidden_m):
        return boxes
    return extended_towards(boxes, hidden_m, view.heading_rad)


@compiled(Bodies, CurrentView, "float64")
def _hidden(bodies: Bodies, view: CurrentView, least_m: float) -> FloatArray:
    """(N,) by how much the bodies may extend nearer than their boxes, at most to least_m from the camera."""
    cos, sin = math.cos(view.heading_rad), math.sin(view.heading_rad)
    hidden_m = np.zeros(len(bodies.moving))
    for k in range(len(hidden_m)):
        ahead_m, left_m = ahead_and_left(bodies.xy_m[k], view)
        near_m, inner_m = ahead_m - bodies.half_view_m[k], abs(left_m) - bodies.half_across_m[k]
        vx, vy = bodies.velocity_mps[k]
        along_mps, leftward_mps = along_and_left(vx, vy, cos, sin)
        inwards_mps = -math.copysign(1.0, left_m) * leftward_mps
        on_edge = reaches_side_edge(inner_m, near_m, view)
        comes_in = inwards_mps > max(abs(along_mps), _MIN_INWARDS_MPS)
        if bodies.moving[k] and near_m > least_m and on_edge and comes_in:
            hidden_m[k] = min(_HIDDEN_M, near_m - least_m)
    return hidden_m
