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

from controller.decision.bodies import Bodies
from controller.decision.view_edges import CurrentView, ahead_and_left, is_below_or_above_view
from hal.compiled import compiled, inlined
from hal.geometry import wrap_angle_rad
from hal.types import Flags
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

    def __init__(self) -> None:
        self._since_ns: dict[int, int] = {}
        self._heading_rad = math.nan

    def forget(self) -> None:
        """Start anew: the robot drives, or nothing is remembered."""
        self._since_ns.clear()

    def seen_empty(self, bodies: Bodies, view: CurrentView, free: FreeSpace) -> Flags:
        """(N,) which bodies are no longer there, for a robot that stands. Call once a scene."""
        if not abs(wrap_angle_rad(view.heading_rad - self._heading_rad)) <= _STANDS_RAD:
            self.forget()
            self._heading_rad = view.heading_rad
        now_ns, ids = bodies.captured_ns, bodies.ids.tolist()
        empty = _seen_empty(bodies, view, free).tolist()
        self._since_ns = {
            track_id: self._since_ns.get(track_id, now_ns)
            for track_id, gone in zip(ids, empty, strict=True)
            if gone
        }
        return np.array(
            [now_ns - self._since_ns.get(track_id, now_ns) >= _FOR_NS for track_id in ids], np.bool_
        )


@inlined
def _covered_bands(
    bodies: Bodies, k: int, ahead_m: float, left_m: float, free: FreeSpace
) -> tuple[int, int, bool]:
    """Of the bands that body k covers, at its near or its far face: how many there are, how many are seen
    free beyond it, and whether one ends at a surface in its place. What is not known is not free.

    ahead_m, left_m: where its centre is from the camera. Its near face is ahead of the camera.
    """
    near_m, far_m = ahead_m - bodies.half_view_m[k], ahead_m + bodies.half_view_m[k]
    left_edge_m, right_edge_m = -left_m - bodies.half_across_m[k], -left_m + bodies.half_across_m[k]
    first = min(left_edge_m / near_m, left_edge_m / far_m) - free.half_width_tan
    last = max(right_edge_m / near_m, right_edge_m / far_m) + free.half_width_tan
    covered, seen_free, there = 0, 0, False
    for b in range(len(free.bearing_tan)):
        if first <= free.bearing_tan[b] <= last:
            covered += 1
            seen_free += int(free.known_m[b] >= far_m and free.nearest_m[b] >= far_m)
            there |= near_m - _AT_PLACE_M <= free.nearest_m[b] < far_m + _AT_PLACE_M
    return covered, seen_free, there


@compiled(Bodies, CurrentView, FreeSpace)
def _seen_empty(bodies: Bodies, view: CurrentView, free: FreeSpace) -> Flags:
    """(N,) which standing bodies are well in view, and all bands that they cover are seen free."""
    empty = np.zeros(len(bodies.moving), np.bool_)
    for k in range(len(empty)):
        ahead, left = ahead_and_left(bodies.xy_m[k], view)
        near = ahead - bodies.half_view_m[k]
        inside = abs(left) + bodies.half_across_m[k] <= view.edge_tan * near - _WELL_INSIDE_M
        if bodies.moving[k] or not (near > 0.0 and inside):
            continue
        if not is_below_or_above_view(bodies, k, near, view):
            covered, seen_free, _ = _covered_bands(bodies, k, ahead, left, free)
            empty[k] = 0 < covered == seen_free
    return empty


@compiled(Bodies, CurrentView, FreeSpace)
def unproven(bodies: Bodies, view: CurrentView, free: FreeSpace) -> Flags:
    """(N,) which bodies that surely stood are in view and near, but their place is not seen in this scene.

    It is seen if every band that the body covers is free beyond it, or if one ends at a surface there.
    """
    unseen = np.zeros(len(bodies.moving), np.bool_)
    for k in range(len(unseen)):
        ahead, left = ahead_and_left(bodies.xy_m[k], view)
        near = ahead - bodies.half_view_m[k]
        speed_mps = math.hypot(bodies.measured_mps[k, 0], bodies.measured_mps[k, 1])
        stood = not bodies.moving[k] and bodies.tracked_s[k] >= _STOOD_S and speed_mps <= _STOOD_MPS
        if not (stood and 0.0 < near <= _NEAR_M):
            continue
        if not is_below_or_above_view(bodies, k, near, view):
            covered, seen_free, there = _covered_bands(bodies, k, ahead, left, free)
            unseen[k] = not there and seen_free < covered
    return unseen
