"""What is below and above the camera's view, by how far ahead of it that is. Heights are over the floor."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from controller.decision.bodies import Bodies
from hal.compiled import compiled, inlined
from hal.types import CameraMount, FloatArray, PlanarPose

BoolArray = NDArray[np.bool_]

# The height of what is seen only in part is known no better.
UNCERTAIN_M = 0.1
LEAST_TAN, _LEAST_M = 0.1, 1e-3
_BEHIND_M = 2.0
_MOST_CONSENT_M = 2.5


def consented_m(near_m: float, floor_from_m: float) -> float:
    """How far ahead of the camera the floor is free by the consent of whoever starts the robot: near_m, or to
    where it comes into view, from floor_from_m on, unless that is too far to be consented to."""
    return max(near_m, min(floor_from_m, _MOST_CONSENT_M))


def beyond_edges(
    bodies: Bodies, near_face_m: FloatArray, height_m: float, near_m: float, up_tan: float
) -> BoolArray:
    """(N,) below the view or above it, where they begin near_face_m (N,) ahead of a camera at height_m that
    sees the floor from near_m on, and the upper edge of whose view rises by up_tan a metre."""
    return _beyond_edges(near_face_m, bodies.bottom_m, bodies.top_m, height_m, near_m, up_tan)


def out_of_view(
    bodies: Bodies,
    pose: PlanarPose,
    mount: CameraMount,
    edge_tan: float,
    near_m: float,
    up_tan: float,
    edge_m: float,
    late_mps: float,
) -> BoolArray:
    """(N,) beside, below or above the view of a camera that a body at pose carries, but not behind it by more
    than a robot's length. So far as edge_m within its side edge counts as beside it; of who moves, late_mps
    more for each second that it has not been seen."""
    return _out_of_view(
        bodies.xy_m,
        bodies.half_view_m,
        bodies.bottom_m,
        bodies.top_m,
        bodies.moving,
        bodies.unseen_s,
        pose.x_m,
        pose.y_m,
        pose.heading_rad,
        mount.forward_m,
        mount.left_m,
        mount.height_m,
        edge_tan,
        near_m,
        up_tan,
        edge_m,
        late_mps,
    )


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
    return _visible_from_m(bodies.top_m, bodies.bottom_m, side_m, edge_tan, near_m, height_m, up_tan)


@inlined
def _lowest_seen_m(ahead_m: float, height_m: float, near_m: float) -> float:
    """Height of the lower edge of the view at ahead_m."""
    return height_m * (1.0 - ahead_m / max(near_m, _LEAST_M))


@inlined
def _highest_seen_m(ahead_m: float, height_m: float, up_tan: float) -> float:
    """Height of the upper edge, which rises by up_tan a metre; inf: nothing is known to be above it."""
    return math.inf if math.isinf(up_tan) else height_m + up_tan * max(ahead_m, 0.0)


@inlined
def _beyond(
    near_face_m: float, bottom_m: float, top_m: float, height_m: float, near_m: float, up_tan: float
) -> bool:
    below = near_face_m < near_m and top_m < _lowest_seen_m(near_face_m, height_m, near_m) + UNCERTAIN_M
    return below or bottom_m > _highest_seen_m(near_face_m, height_m, up_tan) - UNCERTAIN_M


@compiled("float64[:], float64[:], float64[:], float64, float64, float64")
def _beyond_edges(
    near_face_m: FloatArray,
    bottom_m: FloatArray,
    top_m: FloatArray,
    height_m: float,
    near_m: float,
    up_tan: float,
) -> BoolArray:
    beyond = np.empty(len(near_face_m), np.bool_)
    for k in range(len(near_face_m)):
        beyond[k] = _beyond(near_face_m[k], bottom_m[k], top_m[k], height_m, near_m, up_tan)
    return beyond


@compiled(
    "float64[:, :], float64[:], float64[:], float64[:], boolean[:], float64[:], float64, float64, float64,"
    "float64, float64, float64, float64, float64, float64, float64, float64"
)
def _out_of_view(
    xy_m: FloatArray,
    half_view_m: FloatArray,
    bottom_m: FloatArray,
    top_m: FloatArray,
    moving: BoolArray,
    unseen_s: FloatArray,
    x_m: float,
    y_m: float,
    heading_rad: float,
    forward_m: float,
    left_m: float,
    height_m: float,
    edge_tan: float,
    near_m: float,
    up_tan: float,
    edge_m: float,
    late_mps: float,
) -> BoolArray:
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    out = np.empty(len(xy_m), np.bool_)
    for k in range(len(xy_m)):
        dx, dy = xy_m[k, 0] - x_m, xy_m[k, 1] - y_m
        ahead, left = dx * cos + dy * sin - forward_m, dy * cos - dx * sin - left_m
        within_m = edge_m + (late_mps * unseen_s[k] if moving[k] else 0.0)
        beside = abs(left) > edge_tan * max(ahead, 0.0) - within_m
        beyond = _beyond(ahead - half_view_m[k], bottom_m[k], top_m[k], height_m, near_m, up_tan)
        out[k] = (beside or beyond) and ahead > -_BEHIND_M
    return out


@compiled("float64[:], float64[:], float64[:], float64, float64, float64, float64")
def _visible_from_m(
    top_m: FloatArray,
    bottom_m: FloatArray,
    side_m: FloatArray,
    edge_tan: float,
    near_m: float,
    height_m: float,
    up_tan: float,
) -> FloatArray:
    visible = np.empty(len(top_m))
    for k in range(len(top_m)):
        lowest = min(max(1.0 - (top_m[k] - UNCERTAIN_M) / height_m, 0.0), 1.0)
        rise_m = max(bottom_m[k] + UNCERTAIN_M - height_m, 0.0)
        beside = abs(side_m[k]) / max(edge_tan, LEAST_TAN)
        visible[k] = max(beside, near_m * lowest, rise_m / max(up_tan, LEAST_TAN))
    return visible
