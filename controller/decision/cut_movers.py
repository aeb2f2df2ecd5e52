"""Movers that come in from beside the view: their near side may still be beyond the edge.

Of something wide that drives in from the side, the far corner comes into view first, and the near one last.
As long as the near corner of its box lies on the edge of the view, the body may extend nearer to the robot.
controller/decision/known_bodies.py asks once a scene.
"""

from __future__ import annotations

import math

import numpy as np

from controller.decision.bodies import Bodies
from controller.decision.view_edges import CurrentView, ahead_and_left, reaches_side_edge
from hal.compiled import compiled
from hal.directions import along_and_left
from hal.types import FloatArray

# How much nearer it may extend: about the width of a vehicle in a hall.
_HIDDEN_M = 1.0
# What comes in slower than this, or rather along the view than across it, is seen in time.
_MIN_INWARDS_MPS = 0.3


@compiled(Bodies, CurrentView)
def hidden_m(bodies: Bodies, view: CurrentView) -> FloatArray:
    """(N,) by how much movers that come in over the edge of the view may extend nearer than their boxes."""
    cos, sin = math.cos(view.heading_rad), math.sin(view.heading_rad)
    hidden = np.zeros(len(bodies.moving))
    for k in range(len(hidden)):
        ahead_m, left_m = ahead_and_left(bodies.xy_m[k], view)
        near_m, inner_m = ahead_m - bodies.half_view_m[k], abs(left_m) - bodies.half_across_m[k]
        vx, vy = bodies.velocity_mps[k]
        along_mps, leftward_mps = along_and_left(vx, vy, cos, sin)
        inwards_mps = -math.copysign(1.0, left_m) * leftward_mps
        on_edge = reaches_side_edge(inner_m, near_m, view)
        comes_in = inwards_mps > max(abs(along_mps), _MIN_INWARDS_MPS)
        if bodies.moving[k] and on_edge and comes_in:
            hidden[k] = _HIDDEN_M
    return hidden
