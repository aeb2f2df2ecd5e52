"""Movers that come in from beside the view: their near side may still be beyond the edge.

Of something wide that drives in from the side, the far corner comes into view first, and the near one last.
As long as the near corner of its box lies on the edge of the view, the body may extend nearer to the robot.
controller/decision/world_model.py asks once a scene.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from controller.decision.bodies import Bodies
from controller.decision.view_edges import ViewEdges
from hal.types import CameraMount, PlanarPose

# How much nearer it may extend: about the width of a vehicle in a hall.
_HIDDEN_M = 1.0
# A corner farther inside the edge of the view than this is seen: a distance, and a share of the view's half
# width, because depth is often missing in the outermost columns.
_INSIDE_M, _INSIDE_SHARE = 0.1, 0.1
# What comes in slower than this, or rather along the view than across it, is seen in time.
_MIN_INWARDS_MPS = 0.3


def with_hidden_near_sides(boxes: Bodies, pose: PlanarPose, mount: CameraMount, edges: ViewEdges) -> Bodies:
    """The boxes, those of movers that come in over the edge of the view extended towards the robot."""
    if not np.count_nonzero(boxes.moving):
        return boxes
    cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    forward, leftward = np.array([cos, sin]), np.array([-sin, cos])
    offset = boxes.xy_m - (pose.x_m, pose.y_m)
    ahead, left = offset @ forward - mount.forward_m, offset @ leftward - mount.left_m
    near = ahead - boxes.half_view_m
    side = np.where(left < 0.0, -1.0, 1.0)
    inner = side * left - boxes.half_across_m
    inwards, along = -side * (boxes.velocity_mps @ leftward), np.abs(boxes.velocity_mps @ forward)
    cut = boxes.moving & (near > 0.0) & (inner >= (1.0 - _INSIDE_SHARE) * edges.edge_tan * near - _INSIDE_M)
    cut &= inwards > np.maximum(along, _MIN_INWARDS_MPS)
    if not np.count_nonzero(cut):
        return boxes
    half_m = np.where(cut, 0.5 * np.minimum(_HIDDEN_M, near), 0.0)
    return replace(boxes, xy_m=boxes.xy_m - half_m[:, None] * forward, half_view_m=boxes.half_view_m + half_m)
