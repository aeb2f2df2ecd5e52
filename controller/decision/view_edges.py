"""The camera's view and its edges: which bodies are below, above or beside it at their distance.

The lower edge falls from the camera's height to the floor at near_m ahead; the upper edge rises with the
slope up_tan from the camera's height; the side edges are at the tangent edge_tan. Heights are over the floor,
distances ahead of the camera or to its left (ahead_and_left). Whatever compares bodies with the view asks
here: controller/decision/out_of_view.py and its parts, cut_movers.py, turning_vehicles.py, standing_limits.py
and sight.py.
"""

from __future__ import annotations

import math

import numpy as np

from controller.decision.bodies import Bodies
from hal.compiled import compiled, inlined
from hal.directions import along_and_left
from hal.records import record
from hal.types import CameraMount, Flags, FloatArray, PlanarPose

# What is farther inside a side edge of the view than this is seen: a distance, and a share of the view's half
# width, because depth is often missing in the outermost columns.
_INSIDE_M, _INSIDE_SHARE = 0.1, 0.1
# Uncertainty of the height of a body that is seen only in part.
UNCERTAIN_M = 0.1
MIN_TAN, _MIN_M = 0.1, 1e-3  # lower bounds of divisors
# A place this far inside the side edge of the view still counts as outside; of a mover, for each second since
# it was last seen, this much more.
EDGE_TOLERANCE_M, EDGE_TOLERANCE_MPS = 0.3, 0.15
# A body farther behind the camera than about a robot's length no longer counts as out of view.
_BEHIND_M = 2.0


@record(frozen=True, slots=True)
class CurrentView:
    """What the camera has in view from where it is.

    x_m, y_m, heading_rad: of the robot that carries it. The camera looks where the robot heads.
    forward_m, left_m: the camera on the robot, from the turning centre.
    height_m: the camera over the floor.
    edge_tan: tangent of the half angle of view, to either side.
    near_m: distance ahead of the camera from which the floor is in view.
    up_tan: slope of the upper edge; inf: not known, then nothing is above the view.
    """

    x_m: float
    y_m: float
    heading_rad: float
    forward_m: float
    left_m: float
    height_m: float
    edge_tan: float
    near_m: float
    up_tan: float


def view_from(
    pose: PlanarPose, mount: CameraMount, edge_tan: float, near_m: float, up_tan: float
) -> CurrentView:
    """The view of a camera that is mounted on a robot at pose."""
    return CurrentView(
        pose.x_m,
        pose.y_m,
        pose.heading_rad,
        mount.forward_m,
        mount.left_m,
        mount.height_m,
        edge_tan,
        near_m,
        up_tan,
    )


@inlined
def ahead_and_left(point_m: FloatArray, view: CurrentView) -> tuple[float, float]:
    """How far a floor point (2,) is ahead of the camera, and to its left."""
    cos, sin = math.cos(view.heading_rad), math.sin(view.heading_rad)
    along_m, left_m = along_and_left(point_m[0] - view.x_m, point_m[1] - view.y_m, cos, sin)
    return along_m - view.forward_m, left_m - view.left_m


@compiled("float64[:, :]", CurrentView)
def all_ahead_and_left(points_m: FloatArray, view: CurrentView) -> FloatArray:
    """(2, P) ahead_and_left() of floor points (P, 2)."""
    places = np.empty((2, len(points_m)))
    for k in range(len(points_m)):
        places[0, k], places[1, k] = ahead_and_left(points_m[k], view)
    return places


@inlined
def reaches_side_edge(side_m: float, ahead_m: float, view: CurrentView) -> bool:
    """Whether what ends side_m beside the camera's axis, ahead_m ahead of it, may go on beyond the view."""
    return side_m >= (1.0 - _INSIDE_SHARE) * view.edge_tan * ahead_m - _INSIDE_M


@inlined
def _lowest_seen_m(ahead_m: float, view: CurrentView) -> float:
    """Height of the lower edge of the view at ahead_m."""
    return view.height_m * (1.0 - ahead_m / max(view.near_m, _MIN_M))


@inlined
def _highest_seen_m(ahead_m: float, view: CurrentView) -> float:
    """Height of the upper edge at ahead_m; inf if up_tan is not known (inf): then nothing is above it."""
    return math.inf if math.isinf(view.up_tan) else view.height_m + view.up_tan * max(ahead_m, 0.0)


@inlined
def is_below_view(bodies: Bodies, k: int, near_face_m: float, view: CurrentView) -> bool:
    """Whether body k, whose near face is near_face_m ahead of the camera, is entirely below the view."""
    lowest_m = _lowest_seen_m(near_face_m, view)
    return bool(near_face_m < view.near_m and bodies.top_m[k] < lowest_m + UNCERTAIN_M)


@inlined
def is_below_or_above_view(bodies: Bodies, k: int, near_face_m: float, view: CurrentView) -> bool:
    """Whether body k, whose near face is near_face_m ahead, is entirely below the view or entirely above."""
    above = bodies.bottom_m[k] > _highest_seen_m(near_face_m, view) - UNCERTAIN_M
    return bool(above or is_below_view(bodies, k, near_face_m, view))


@compiled(Bodies, "float64[:]", CurrentView)
def below_or_above_view(bodies: Bodies, near_face_m: FloatArray, view: CurrentView) -> Flags:
    """(N,) is_below_or_above_view() of each body; near_face_m (N,)."""
    beyond = np.empty(len(near_face_m), np.bool_)
    for k in range(len(near_face_m)):
        beyond[k] = is_below_or_above_view(bodies, k, near_face_m[k], view)
    return beyond


@compiled(Bodies, CurrentView)
def out_of_view(bodies: Bodies, view: CurrentView) -> Flags:
    """(N,) which bodies are beside, below or above the view, and no farther than _BEHIND_M behind the camera.

    A centre up to EDGE_TOLERANCE_M inside the side edge counts as beside the view; of a mover,
    EDGE_TOLERANCE_MPS more for each second since it was last seen, because the uncertainty of its position
    grows.
    """
    out = np.empty(len(bodies.xy_m), np.bool_)
    for k in range(len(out)):
        ahead, left = ahead_and_left(bodies.xy_m[k], view)
        within_m = EDGE_TOLERANCE_M + (EDGE_TOLERANCE_MPS * bodies.unseen_s[k] if bodies.moving[k] else 0.0)
        beside = abs(left) > view.edge_tan * max(ahead, 0.0) - within_m
        beyond = is_below_or_above_view(bodies, k, ahead - bodies.half_view_m[k], view)
        out[k] = (beside or beyond) and ahead > -_BEHIND_M
    return out


@compiled(Bodies, "float64[:]", CurrentView)
def visible_from_m(bodies: Bodies, side_m: FloatArray, view: CurrentView) -> FloatArray:
    """(N,) the least distance ahead of the camera at which a body is seen, wherever the camera is now.

    There its centre is within the side edges, its top is above the lower edge and its bottom is below the
    upper edge. side_m (N,): sideways distance of its centre from the camera's axis.
    """
    visible = np.empty(len(side_m))
    for k in range(len(side_m)):
        lowest = min(max(1.0 - (bodies.top_m[k] - UNCERTAIN_M) / view.height_m, 0.0), 1.0)
        rise_m = max(bodies.bottom_m[k] + UNCERTAIN_M - view.height_m, 0.0)
        beside = abs(side_m[k]) / max(view.edge_tan, MIN_TAN)
        visible[k] = max(beside, view.near_m * lowest, rise_m / max(view.up_tan, MIN_TAN))
    return visible
