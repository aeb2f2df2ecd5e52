"""What stood beside the edge of the view and has gone while the robot stands: its place is seen through.

Who walks or drives past leaves strips behind that were taken for standing things for a moment. Beside the
edge of the view they are remembered, for what is there may be just outside of it; a robot that waits for one
would wait without end.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from controller.decision.bodies import Bodies
from controller.decision.view_edges import beyond_edges
from hal.geometry import wrap_angle_rad
from hal.types import CameraMount, FloatArray, PlanarPose
from vision.scene import FreeSpace

# So far inside the side edges of the view the robot's way since then puts nothing outside of them.
_WELL_INSIDE_M = 0.05
# In all scenes of so long: noise does not see through a body for a second part of that. It costs a robot that
# would wait without end nothing.
_FOR_NS = 500_000_000
_STANDS_RAD = math.radians(0.25)  # who turns in place does not stand, and sweeps the edges of its view


class SeenThrough:
    """Keeps, by number, since when nothing was to be seen where something is remembered, and from where."""

    def __init__(self, mount: CameraMount) -> None:
        self._mount = mount
        self._since_ns: dict[int, int] = {}
        self._heading_rad = math.nan

    def forget(self) -> None:
        """The robot drives, or nothing is remembered."""
        self._since_ns.clear()

    def gone(
        self, bodies: Bodies, pose: PlanarPose, edge_tan: float, near_m: float, up_tan: float, free: FreeSpace
    ) -> NDArray[np.bool_]:
        """(N,) which of bodies are no longer there, for a robot that stands at pose. Call once a scene.

        edge_tan, near_m, up_tan: the edges of the view (controller/decision/view_edges.py).
        """
        if not abs(wrap_angle_rad(pose.heading_rad - self._heading_rad)) <= _STANDS_RAD:
            self.forget()
            self._heading_rad = pose.heading_rad
        now_ns = bodies.captured_ns
        cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        offset = bodies.xy_m - (pose.x_m, pose.y_m)
        ahead = offset @ (cos, sin) - self._mount.forward_m
        right = self._mount.left_m - offset @ (-sin, cos)
        near, far = ahead - bodies.half_view_m, ahead + bodies.half_view_m
        in_view = ~bodies.moving & (near > 0.0)
        in_view &= ~beyond_edges(bodies, near, self._mount.height_m, near_m, up_tan)
        in_view &= np.abs(right) + bodies.half_across_m <= edge_tan * near - _WELL_INSIDE_M
        ids, since_ns = bodies.ids.tolist(), {}
        for k in in_view.nonzero()[0].tolist():
            edges_m = right[k] + np.array([-1.0, 1.0]) * bodies.half_across_m[k]
            if _is_free(free, edges_m, float(near[k]), float(far[k])):
                since_ns[ids[k]] = self._since_ns.get(ids[k], now_ns)
        self._since_ns = since_ns
        return np.array([now_ns - since_ns.get(number, now_ns) >= _FOR_NS for number in ids], np.bool_)


def _is_free(free: FreeSpace, edges_m: FloatArray, near_m: float, far_m: float) -> bool:
    """Whether all bands between two places edges_m (2,) to the right, from near_m to far_m ahead, are seen to
    be free beyond far_m. What is not known is not free."""
    tans = np.concatenate((edges_m / near_m, edges_m / far_m))
    bands = (free.bearing_tan >= tans.min() - free.half_width_tan) & (
        free.bearing_tan <= tans.max() + free.half_width_tan
    )
    seen = (free.known_m[bands] >= far_m) & (free.nearest_m[bands] >= far_m)
    return len(seen) > 0 and bool(seen.all())
