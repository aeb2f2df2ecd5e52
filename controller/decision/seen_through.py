"""Whether the place of a standing body that has gone missing is seen: empty, or with a surface in it.

A body that goes missing in the middle of the view is kept while its place is not seen (unproven). Something
thin is measured in some frames only, and somebody may walk by before it.

People and vehicles that pass leave narrow tracks behind that were judged standing for a moment. Just inside
the edge of the view controller/decision/out_of_view.py keeps them, since what is there may be just outside. A
robot that waits for such a body would wait without end, so it is dropped once its place is seen through.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from controller.decision.bodies import Bodies
from controller.decision.view_edges import ViewEdges, beyond_edges
from hal.compiled import compiled
from hal.geometry import wrap_angle_rad
from hal.types import CameraMount, FloatArray, PlanarPose
from vision.scene import FreeSpace

# Only bodies this far inside the side edges are judged: a smaller distance may be an error of the robot's
# motion since the body was seen.
_WELL_INSIDE_M = 0.05
# The place must be seen empty in every scene for this long. Noise does not see through a body for half of
# that, and a robot that would otherwise wait without end loses nothing.
_FOR_NS = 500_000_000
# Beyond this distance, depth is too often missing to conclude anything from that.
_NEAR_M = 5.0
# A surface within this distance of the place may be what stood there. From then on depth tells of it.
_AT_PLACE_M = 0.3
# Seen for less time, or last measured faster than this, a body did not surely stand, whatever the verdict: a
# limb of somebody who walks by is judged standing for half a second.
_STOOD_S, _STOOD_MPS = 1.0, 0.3
# A robot that turns by more than this does not stand: turning in place sweeps the edges of the view.
_STANDS_RAD = math.radians(0.25)


class SeenThrough:
    """Keeps, by body id, since when its place has been seen empty, and the heading from which."""

    def __init__(self, mount: CameraMount) -> None:
        self._mount = mount
        self._since_ns: dict[int, int] = {}
        self._heading_rad = math.nan

    def forget(self) -> None:
        """Start anew: the robot drives, or nothing is remembered."""
        self._since_ns.clear()

    def seen_empty(
        self, bodies: Bodies, pose: PlanarPose, edges: ViewEdges, free: FreeSpace
    ) -> NDArray[np.bool_]:
        """(N,) which bodies are no longer there, for a robot that stands at pose. Call once a scene."""
        if not abs(wrap_angle_rad(pose.heading_rad - self._heading_rad)) <= _STANDS_RAD:
            self.forget()
            self._heading_rad = pose.heading_rad
        now_ns = bodies.captured_ns
        ahead, right = _in_camera(bodies, pose, self._mount)
        near, far = ahead - bodies.half_view_m, ahead + bodies.half_view_m
        in_view = ~bodies.moving & (near > 0.0)
        in_view &= ~beyond_edges(bodies, near, self._mount.height_m, edges)
        in_view &= np.abs(right) + bodies.half_across_m <= edges.edge_tan * near - _WELL_INSIDE_M
        ids, since_ns = bodies.ids.tolist(), {}
        for k in in_view.nonzero()[0].tolist():
            bands = _bands(free, right[k], float(bodies.half_across_m[k]), float(near[k]), float(far[k]))
            if _is_free(free, bands, float(far[k])):
                since_ns[ids[k]] = self._since_ns.get(ids[k], now_ns)
        self._since_ns = since_ns
        return np.array([now_ns - since_ns.get(track_id, now_ns) >= _FOR_NS for track_id in ids], np.bool_)


def unproven(
    bodies: Bodies, pose: PlanarPose, mount: CameraMount, edges: ViewEdges, free: FreeSpace
) -> NDArray[np.bool_]:
    """(N,) which bodies that surely stood are in view and near, but their place is not seen in this scene.

    It is seen if every band that the body covers is free beyond it, or if one ends at a surface there.
    """
    speed_mps = np.hypot(bodies.measured_mps[:, 0], bodies.measured_mps[:, 1])
    unseen = _unproven(
        bodies.xy_m,
        bodies.half_view_m,
        bodies.half_across_m,
        ~bodies.moving & (bodies.tracked_s >= _STOOD_S) & (speed_mps <= _STOOD_MPS),
        pose.x_m,
        pose.y_m,
        pose.heading_rad,
        mount.forward_m,
        mount.left_m,
        free.bearing_tan,
        free.half_width_tan,
        free.nearest_m,
        free.known_m,
    )
    if np.count_nonzero(unseen):
        ahead, _ = _in_camera(bodies, pose, mount)
        unseen &= ~beyond_edges(bodies, ahead - bodies.half_view_m, mount.height_m, edges)
    return unseen


def _in_camera(bodies: Bodies, pose: PlanarPose, mount: CameraMount) -> tuple[FloatArray, FloatArray]:
    """(N,) each: how far ahead and to the right of the camera the centres are."""
    cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    offset = bodies.xy_m - (pose.x_m, pose.y_m)
    return offset @ (cos, sin) - mount.forward_m, mount.left_m - offset @ (-sin, cos)


def _bands(
    free: FreeSpace, right_m: float, half_across_m: float, near_m: float, far_m: float
) -> NDArray[np.bool_]:
    """(B,) which bands a body covers, from its left to its right edge, at its near and its far face."""
    edges_m = right_m + np.array([-half_across_m, half_across_m])
    tans = np.concatenate((edges_m / near_m, edges_m / far_m))
    covered: NDArray[np.bool_] = (free.bearing_tan >= tans.min() - free.half_width_tan) & (
        free.bearing_tan <= tans.max() + free.half_width_tan
    )
    return covered


def _is_free(free: FreeSpace, bands: NDArray[np.bool_], far_m: float) -> bool:
    """Whether all of the bands (B,) are seen free beyond far_m; what is not known is not free."""
    seen = (free.known_m[bands] >= far_m) & (free.nearest_m[bands] >= far_m)
    return len(seen) > 0 and bool(seen.all())


@compiled(
    "float64[:, :], float64[:], float64[:], boolean[:], float64, float64, float64, float64, float64,"
    "float64[:], float64, float64[:], float64[:]"
)
def _unproven(
    xy_m: FloatArray,
    half_view_m: FloatArray,
    half_across_m: FloatArray,
    stood: NDArray[np.bool_],
    x_m: float,
    y_m: float,
    heading_rad: float,
    forward_m: float,
    left_m: float,
    bearing_tan: FloatArray,
    half_width_tan: float,
    nearest_m: FloatArray,
    known_m: FloatArray,
) -> NDArray[np.bool_]:
    """unproven() in arrays, but for bodies below or above the view."""
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    unseen = np.zeros(len(xy_m), np.bool_)
    for k in range(len(xy_m)):
        dx, dy = xy_m[k, 0] - x_m, xy_m[k, 1] - y_m
        ahead, right = dx * cos + dy * sin - forward_m, left_m - (dy * cos - dx * sin)
        near, far = ahead - half_view_m[k], ahead + half_view_m[k]
        if not (stood[k] and 0.0 < near <= _NEAR_M):
            continue
        left_edge, right_edge = right - half_across_m[k], right + half_across_m[k]
        first = min(left_edge / near, left_edge / far) - half_width_tan
        last = max(right_edge / near, right_edge / far) + half_width_tan
        covered, free, there = 0, 0, False
        for b in range(len(bearing_tan)):
            if first <= bearing_tan[b] <= last:
                covered += 1
                free += int(known_m[b] >= far and nearest_m[b] >= far)
                there |= near - _AT_PLACE_M <= nearest_m[b] < far + _AT_PLACE_M
        unseen[k] = covered > 0 and not there and free < covered
    return unseen
