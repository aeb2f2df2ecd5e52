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
from controller.decision.view_edges import (
    ViewEdges,
    ahead_and_left,
    all_ahead_and_left,
    beyond_edges,
)
from hal.compiled import compiled
from hal.geometry import wrap_angle_rad
from hal.types import CameraMount, PlanarPose
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
        ahead, left = all_ahead_and_left(bodies.xy_m, pose, self._mount)
        near, far = ahead - bodies.half_view_m, ahead + bodies.half_view_m
        in_view = ~bodies.moving & (near > 0.0)
        in_view &= ~beyond_edges(bodies, near, self._mount.height_m, edges)
        in_view &= np.abs(left) + bodies.half_across_m <= edges.edge_tan * near - _WELL_INSIDE_M
        ids, since_ns = bodies.ids.tolist(), {}
        for k in in_view.nonzero()[0].tolist():
            bands = _bands(free, -left[k], float(bodies.half_across_m[k]), float(near[k]), float(far[k]))
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
    unseen = _unproven(bodies, pose, mount, free)
    if np.count_nonzero(unseen):
        ahead, _ = all_ahead_and_left(bodies.xy_m, pose, mount)
        unseen &= ~beyond_edges(bodies, ahead - bodies.half_view_m, mount.height_m, edges)
    return unseen


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


@compiled(Bodies, PlanarPose, CameraMount, FreeSpace)
def _unproven(bodies: Bodies, pose: PlanarPose, mount: CameraMount, free: FreeSpace) -> NDArray[np.bool_]:
    """As unproven(), but for bodies below or above the view."""
    unseen = np.zeros(len(bodies.moving), np.bool_)
    for k in range(len(unseen)):
        ahead, left = ahead_and_left(bodies.xy_m[k], pose, mount)
        half_view_m, half_across_m = bodies.half_view_m[k], bodies.half_across_m[k]
        near, far = ahead - half_view_m, ahead + half_view_m
        speed_mps = math.hypot(bodies.measured_mps[k, 0], bodies.measured_mps[k, 1])
        stood = not bodies.moving[k] and bodies.tracked_s[k] >= _STOOD_S and speed_mps <= _STOOD_MPS
        if not (stood and 0.0 < near <= _NEAR_M):
            continue
        left_edge, right_edge = -left - half_across_m, -left + half_across_m
        first = min(left_edge / near, left_edge / far) - free.half_width_tan
        last = max(right_edge / near, right_edge / far) + free.half_width_tan
        covered, seen_free, there = 0, 0, False
        for b in range(len(free.bearing_tan)):
            if first <= free.bearing_tan[b] <= last:
                covered += 1
                seen_free += int(free.known_m[b] >= far and free.nearest_m[b] >= far)
                there |= near - _AT_PLACE_M <= free.nearest_m[b] < far + _AT_PLACE_M
        unseen[k] = covered > 0 and not there and seen_free < covered
    return unseen
