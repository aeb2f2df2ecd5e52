"""Where movers out of view are expected now; how they move is in controller/decision/unseen_motion.py.

controller/decision/out_of_view.py extrapolates its movers, and pushes those that would be seen by now out of
the view again.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from controller.decision.bodies import Bodies
from controller.decision.unseen_motion import leftward_variance, significant_component
from controller.decision.view_edges import (
    EDGE_TOLERANCE_M,
    EDGE_TOLERANCE_MPS,
    CurrentView,
    ahead_and_left,
    all_ahead_and_left,
    below_or_above_view,
)
from hal.compiled import compiled
from hal.directions import along_and_left
from hal.types import FloatArray
from vision.scene import FreeSpace

_MIN_AXIS_DISTANCE_M = 0.1  # least distance from the camera's axis of a mover that was not seen to come in
# A body out of view may have changed its velocity by this much per second.
_VELOCITY_CHANGE_MPS2 = 0.25
_ROUNDING = 1e-6


@compiled(Bodies, "float64", CurrentView)
def extrapolated(bodies: Bodies, dt_s: float, view: CurrentView) -> FloatArray:
    """(N, 2) the positions dt_s later at constant velocity.

    A mover ahead of the camera that approaches its axis (by more than one standard deviation of the
    sideways velocity) stays at least _MIN_AXIS_DISTANCE_M on its own side: had it crossed, it would have
    been seen.
    """
    cos, sin = math.cos(view.heading_rad), math.sin(view.heading_rad)
    xy = np.empty(bodies.xy_m.shape)
    for k in range(len(xy)):
        vx, vy = bodies.velocity_mps[k]
        ahead, left = ahead_and_left(bodies.xy_m[k], view)
        _, leftward_mps = along_and_left(vx, vy, cos, sin)
        side, before_camera = -1.0 if left < 0.0 else 1.0, ahead - bodies.half_view_m[k] > 0.0
        variance = leftward_variance(bodies.covariance[k], cos, sin)
        past_m = 0.0
        if bodies.moving[k] and before_camera and -side * leftward_mps > math.sqrt(variance):
            past_m = max(_MIN_AXIS_DISTANCE_M - side * (left + leftward_mps * dt_s), 0.0)
        xy[k, 0] = bodies.xy_m[k, 0] + vx * dt_s - side * past_m * sin
        xy[k, 1] = bodies.xy_m[k, 1] + vy * dt_s + side * past_m * cos
    return xy


def pushed_out_of_view(bodies: Bodies, missing_s: FloatArray, view: CurrentView, free: FreeSpace) -> Bodies:
    """The bodies, with movers whose expected place is seen to be free moved outwards, out of the view.

    They are moved sideways to the edge of the free space, and a velocity towards the axis is replaced by
    its forward component. A body that approaches (by more than one standard deviation) is not moved
    until it is late by EDGE_TOLERANCE_M plus EDGE_TOLERANCE_MPS for each second since it was last seen.
    missing_s (N,): for how long each has been out of view.
    """
    cos, sin = math.cos(view.heading_rad), math.sin(view.heading_rad)
    forward, leftward = np.array([cos, sin]), np.array([-sin, cos])
    ahead, left = all_ahead_and_left(bodies.xy_m, view)
    near, far = ahead - bodies.half_view_m, ahead + bodies.half_view_m
    within = bodies.moving & (near > 0.0) & ~below_or_above_view(bodies, near, view)
    if not np.count_nonzero(within):
        return bodies
    side = np.where(left < 0.0, -1.0, 1.0)
    inner = side * left - bodies.half_across_m
    xy, velocity = bodies.xy_m.copy(), bodies.velocity_mps.copy()
    covariance, unseen_s = bodies.covariance.copy(), bodies.unseen_s.copy()
    for k in within.nonzero()[0].tolist():
        from_tan = float(min(inner[k] / near[k], inner[k] / far[k]))
        outside_m = _seen_through_tan(free, float(side[k]), from_tan, float(far[k])) * far[k]
        push_out_m = outside_m - inner[k]
        inwards_mps = -side[k] * float(velocity[k] @ leftward)
        comes = -side[k] * significant_component(velocity[k], covariance[k], leftward) > 0.0
        if push_out_m < (EDGE_TOLERANCE_M + EDGE_TOLERANCE_MPS * unseen_s[k] if comes else -_ROUNDING):
            continue
        xy[k] += side[k] * push_out_m * leftward
        if inwards_mps > 0.0:
            velocity[k] = significant_component(velocity[k], covariance[k], forward) * forward
        turned_mps = _VELOCITY_CHANGE_MPS2 * float(missing_s[k])
        np.fill_diagonal(covariance[k], np.maximum(np.diagonal(covariance[k]), turned_mps**2))
        unseen_s[k] = 0.0
    return replace(bodies, xy_m=xy, velocity_mps=velocity, covariance=covariance, unseen_s=unseen_s)


def _seen_through_tan(free: FreeSpace, side: float, from_tan: float, far_m: float) -> float:
    """Tangent of the bearing, outwards, up to which all bands from from_tan on are seen free to far_m.

    side: 1 to the left, -1 to the right. -inf if the first band is not seen that far.
    """
    outwards = -side * free.bearing_tan
    order = np.argsort(outwards)
    order = order[outwards[order] + free.half_width_tan > from_tan - _ROUNDING]
    closed = np.flatnonzero(~(free.known_m[order] >= far_m))
    opened = order[: closed[0]] if len(closed) else order
    return float(outwards[opened[-1]]) + free.half_width_tan if len(opened) else -math.inf
