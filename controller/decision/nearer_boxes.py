"""Boxes of bodies that may be nearer to the robot than they are seen, extended towards it.

controller/decision/cut_movers.py and turning_vehicles.py say by how much; known_bodies.py asks once a scene.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from controller.decision.bodies import Bodies
from controller.decision.view_edges import CurrentView
from hal.types import FloatArray

# No box is extended nearer to the robot's front than this: more than the robot drives between exposure and
# decision, plus ALONGSIDE_M (controller/decision/limits.py). Else it would count as something that the front
# has passed, and the robot would stop braking for it.
_LEAST_AHEAD_M = 0.3


def extended_nearer(boxes: Bodies, by_m: FloatArray, view: CurrentView, front_m: float) -> Bodies:
    """The boxes, each extended towards the robot by by_m (N,), but not up to its front.

    front_m: from the robot's turning centre to its foremost point.
    """
    if not np.count_nonzero(by_m):
        return boxes
    forward = math.cos(view.heading_rad), math.sin(view.heading_rad)
    ahead_m = (boxes.xy_m - (view.x_m, view.y_m)) @ forward
    room_m = ahead_m - boxes.half_view_m - front_m - _LEAST_AHEAD_M
    half_m = 0.5 * np.minimum(by_m, np.maximum(room_m, 0.0))
    xy_m = boxes.xy_m - half_m[:, None] * forward
    return replace(boxes, xy_m=xy_m, half_view_m=boxes.half_view_m + half_m)
