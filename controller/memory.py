"""Bodies that have left the camera's view but are still there: under its nose and beside its edges."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from controller.bodies import Bodies, no_bodies
from controller.limits import LEAVES_ASLANT
from hal.clocks import NS_PER_S
from hal.types import CameraMount, FloatArray, PlanarPose

BoolArray = NDArray[np.bool_]

_SAME_PLACE_M = 0.25
# What was seen for less than this is not believed once it is gone.
_SETTLED_S = 0.5
_MOVING_KEPT_S, _MAY_COME_KEPT_S = 2.0, 6.0
# The height of what is seen only in part is known no better.
_UNCERTAIN_M = 0.1
_EDGE_M, _EDGE_MPS = 0.3, 0.15


class OutOfView:
    """Standing bodies are kept until their place is seen again or has been passed, moving ones go on as they
    did: for a while, or, where they may come before the robot, until they must have come into view again.
    near_m: ahead of the camera, nearer than this the floor is not seen."""

    def __init__(self, mount: CameraMount, near_m: float) -> None:
        self._mount, self._near_m = mount, near_m
        self._bodies = no_bodies(0)
        self._since_s: FloatArray = np.zeros(0)

    def update(
        self, before: Bodies, seen: Bodies, pose: PlanarPose, edge_tan: float, standing: bool
    ) -> Bodies:
        """What is to be reckoned with besides seen. before: what was seen in the scene before.

        What stood and vanishes while the robot stands has gone by itself, and so has what was part of
        something that is still seen.
        """
        dt_s = (seen.captured_ns - before.captured_ns) / NS_PER_S
        gone = _missing(before.ids, seen.ids)
        gone &= before.moving | ((before.age_s >= _SETTLED_S) & (not standing))
        if not len(self._since_s) and not gone.any():
            return no_bodies(seen.captured_ns)
        since = np.concatenate((self._since_s, np.zeros(int(gone.sum())))) + dt_s
        bodies = self._bodies.joined(before.select(gone))
        bodies = replace(
            bodies,
            captured_ns=seen.captured_ns,
            xy_m=bodies.xy_m + bodies.velocity_mps * dt_s,
            unseen_s=bodies.unseen_s + dt_s,
        )
        part = seen.covers(bodies.xy_m, bodies.half_view_m, _SAME_PLACE_M).any(axis=1)
        kept = self._hidden(bodies, pose, edge_tan) & ~part & _missing(bodies.ids, seen.ids)
        kept &= ~bodies.moving | (
            since <= np.where(_may_come(bodies, pose), _MAY_COME_KEPT_S, _MOVING_KEPT_S)
        )
        self._bodies, self._since_s = bodies.select(kept), since[kept]
        return self._bodies

    def _hidden(self, bodies: Bodies, pose: PlanarPose, edge_tan: float) -> BoolArray:
        """(N,) beside the view or below it, and not yet behind the camera by more than a robot's length."""
        cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        dx, dy = bodies.xy_m[:, 0] - pose.x_m, bodies.xy_m[:, 1] - pose.y_m
        ahead = dx * cos + dy * sin - self._mount.forward_m
        left = dy * cos - dx * sin - self._mount.left_m
        near_face = ahead - bodies.half_view_m
        lowest_seen_m = self._mount.height_m * (1.0 - near_face / self._near_m)
        below = (near_face < self._near_m) & (bodies.top_m < lowest_seen_m + _UNCERTAIN_M)
        # At the edge of the view it may be outside by what is not known of it.
        edge_m = edge_tan * np.maximum(ahead, 0.0) - _EDGE_M - _EDGE_MPS * bodies.unseen_s
        beside = np.abs(left) > edge_m
        hidden: BoolArray = (below | beside) & (ahead > -2.0)
        return hidden


def _may_come(bodies: Bodies, pose: PlanarPose) -> BoolArray:
    """(N,) towards the robot's axis, from either side, or along with the robot: that is how one cuts in."""
    cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    left = (bodies.xy_m[:, 1] - pose.y_m) * cos - (bodies.xy_m[:, 0] - pose.x_m) * sin
    leftward = bodies.velocity_mps[:, 1] * cos - bodies.velocity_mps[:, 0] * sin
    forward = bodies.velocity_mps[:, 0] * cos + bodies.velocity_mps[:, 1] * sin
    comes: BoolArray = (left * leftward < 0.0) | (forward > LEAVES_ASLANT * np.abs(leftward))
    return comes


def _missing(ids: NDArray[np.int64], among: NDArray[np.int64]) -> BoolArray:
    """(N,) which are not among the others; for a few, a table is faster than sorting."""
    missing: BoolArray = (ids[:, None] != among).all(axis=1)
    return missing


def visible_from_m(
    bodies: Bodies, side_m: FloatArray, edge_tan: float, near_m: float, height_m: float
) -> FloatArray:
    """(N,) how far ahead of the camera a body has to be so that it is seen: its middle within the edges of
    the view, its upper part above the lower one. side_m (N,): its middle beside the camera's axis."""
    lowest = np.clip(1.0 - (bodies.top_m - _UNCERTAIN_M) / height_m, 0.0, 1.0)
    visible: FloatArray = np.maximum(np.abs(side_m) / max(edge_tan, 0.1), near_m * lowest)
    return visible
