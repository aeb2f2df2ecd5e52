"""What a camera can see of the world in the plane: rays through bands of columns, intersected with
footprints."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from config.camera import SimulatedCameraConfig
from config.robot import Mount
from controller.decision.surfaces import Eye
from hal.compiled import compiled, inlined
from hal.directions import along_and_left
from hal.records import record
from hal.types import Flags, FloatArray, Integers, Matrix, PlanarPose, Vector
from sim.planar import PlanarWorld
from vision.scene import NEVER_M

IntArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]

BANDS = 80  # as many as the scan of perception has at most
_NEAR_M = 0.1  # nothing nearer than this ahead of the camera is hit, so that no distance is 0
_TOLERANCE_M = 1e-6  # of what is as far away as what occludes it: itself


@record(frozen=True, slots=True, eq=False)
class PlanarView:
    """The view of M bodies in B bands.

    bodies: (M,), indices of the bodies that may be in view.
    forward_m: (M, B), forward distance at which each band's ray meets each body; inf if it misses or the body
        is occluded there.
    free_m: (B,), distance of the first body or wall that occludes what is behind it.
    eye: PlanarCamera.eye().
    """

    bodies: Integers
    forward_m: Matrix
    free_m: Vector
    eye: Eye


class PlanarCamera:
    """A pinhole camera with its height and pitch.

    bearing_tan: (B,), right divided by forward, of the ray of each band.
    half_width_tan: half the width of a band, in the same unit.
    edge_tan: the same of the farther one of both side edges.
    min_depth_m, range_m: from where to where it measures depth.
    height_m: over the floor.
    floor_from_m, up_tan: as in FreeSpace. down_tan: slope of the lower edge.
    z_m: (N, 2), lowest and highest point of the bodies.
    occludes: (N,), which of them hide the floor behind them.
    """

    bearing_tan: Vector
    half_width_tan: float
    edge_tan: float
    min_depth_m: float
    range_m: float
    height_m: float
    down_tan: float
    up_tan: float
    z_m: Matrix
    occludes: Flags

    def __init__(
        self,
        world: PlanarWorld,
        camera: SimulatedCameraConfig,
        mount: Mount,
        max_underside_m: float = math.inf,
    ) -> None:
        """max_underside_m: a body with a higher underside does not occlude the floor behind it."""
        self._mount, self.z_m, self._room = mount, world.z_m, world.room_polygon()
        self.min_depth_m, self.range_m, self.height_m = camera.depth_min_m, camera.depth_max_m, mount.height_m
        left, right = (-0.5 - camera.cx) / camera.fx, (camera.width - 0.5 - camera.cx) / camera.fx
        edges = np.linspace(left, right, BANDS + 1) / math.cos(mount.pitch_rad)
        self.bearing_tan = 0.5 * (edges[1:] + edges[:-1])
        self.half_width_tan = 0.5 * float(edges[1] - edges[0])
        self.edge_tan = max(-float(edges[0]), float(edges[-1]))
        down = math.atan((camera.height - 0.5 - camera.cy) / camera.fy) + mount.pitch_rad
        up = math.atan((camera.cy + 0.5) / camera.fy) - mount.pitch_rad
        self.down_tan, self.up_tan = math.tan(down), math.tan(up)
        sees_floor = self.down_tan > mount.height_m / NEVER_M
        self.floor_from_m = mount.height_m / self.down_tan if sees_floor else NEVER_M
        low_m, high_m = self.z_m.T
        self.occludes = (low_m < min(mount.height_m, max_underside_m)) & (high_m > mount.height_m)

    def look(self, polygons: FloatArray, pose: PlanarPose) -> PlanarView:
        """The view from the robot at pose. polygons: (N, K, 2), footprints of all bodies."""
        eye = self.eye(pose)
        return PlanarView(*_render(self, polygons, self._room, eye), eye)

    def eye(self, pose: PlanarPose) -> Eye:
        """The camera of a robot at pose."""
        cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        forward_m, left_m = self._mount.forward_m, self._mount.left_m
        return (
            pose.x_m + forward_m * cos - left_m * sin,
            pose.y_m + forward_m * sin + left_m * cos,
            cos,
            sin,
        )


@inlined
def _in_camera(
    polygon: FloatArray,
    eye: Eye,
    forward: FloatArray,
    right: FloatArray,
) -> None:
    """Transform the corners (K, 2) to distances forward and right of the camera, (K + 1,) each: the first
    corner is repeated at the end."""
    camera_x, camera_y, cos, sin = eye
    count = len(polygon)
    for j in range(count + 1):
        x, y = polygon[j % count]
        forward[j], left = along_and_left(x - camera_x, y - camera_y, cos, sin)
        right[j] = -left


@inlined
def _may_be_in_view(forward: FloatArray, right: FloatArray, edge_tan: float, range_m: float) -> bool:
    """Whether a polygon may reach into the field of view."""
    nearest, farthest, leftmost, rightmost = math.inf, -math.inf, math.inf, -math.inf
    for j in range(len(forward)):
        nearest, farthest = min(nearest, forward[j]), max(farthest, forward[j])
        reach = edge_tan * forward[j]
        leftmost, rightmost = min(leftmost, right[j] - reach), max(rightmost, right[j] + reach)
    return farthest > _NEAR_M and nearest < range_m and leftmost < 0.0 and rightmost > 0.0


@inlined
def _cast_rays(forward: FloatArray, right: FloatArray, bearing_tan: FloatArray, hits: FloatArray) -> bool:
    """Fill hits (B,) with the forward distance at which each ray first meets an edge of a polygon, inf for
    none. Return whether any ray does."""
    any_hit = False
    hits[:] = math.inf
    for j in range(len(forward) - 1):
        for b in range(len(bearing_tan)):
            side = right[j] - bearing_tan[b] * forward[j]
            next_side = right[j + 1] - bearing_tan[b] * forward[j + 1]
            if side * next_side > 0.0:
                continue
            span = side - next_side
            fraction = side / span if abs(span) >= 1e-12 else 0.0
            z = forward[j] + fraction * (forward[j + 1] - forward[j])
            if z > _NEAR_M and z < hits[b]:
                hits[b], any_hit = z, True
    return any_hit


@inlined
def _add_thin_body(
    forward: FloatArray, right: FloatArray, bearing_tan: FloatArray, half_width_tan: float, hits: FloatArray
) -> None:
    """Fill hits for a body that no ray has met: a pole between two rays is still visible in its band."""
    nearest, low, high = math.inf, math.inf, -math.inf
    for j in range(len(forward)):
        tangent = right[j] / max(forward[j], _NEAR_M)
        nearest, low, high = min(nearest, forward[j]), min(low, tangent), max(high, tangent)
    low, high = low - half_width_tan, high + half_width_tan
    if nearest > _NEAR_M and high - low <= 4.0 * half_width_tan:
        for b in range(len(bearing_tan)):
            if low < bearing_tan[b] < high:
                hits[b] = nearest


@compiled(PlanarCamera, "float64[:, :, ::1], float64[:, ::1], UniTuple(float64, 4)")
def _render(
    camera: PlanarCamera, polygons: FloatArray, room: FloatArray, eye: Eye
) -> tuple[IntArray, FloatArray, FloatArray]:
    """The fields of PlanarView for a camera at eye."""
    bearing_tan, range_m, height_m = camera.bearing_tan, camera.range_m, camera.height_m
    count, corners, bands = len(polygons), polygons.shape[1], len(bearing_tan)
    bodies, hits = np.empty(count, np.intp), np.empty((count, bands))
    forward, right, free = np.empty(len(room) + 1), np.empty(len(room) + 1), np.empty(bands)
    _in_camera(room, eye, forward, right)
    _cast_rays(forward, right, bearing_tan, free)
    forward, right, in_view = np.empty(corners + 1), np.empty(corners + 1), 0
    for k in range(count):
        _in_camera(polygons[k], eye, forward, right)
        if not _may_be_in_view(forward, right, camera.edge_tan, range_m):
            continue
        if not _cast_rays(forward, right, bearing_tan, hits[in_view]):
            _add_thin_body(forward, right, bearing_tan, camera.half_width_tan, hits[in_view])
        if camera.occludes[k]:
            for b in range(bands):
                free[b] = min(free[b], hits[in_view, b])
        bodies[in_view] = k
        in_view += 1
    for row in range(in_view):
        low_m, high_m = camera.z_m[bodies[row]]
        for b in range(bands):
            z = hits[row, b]
            # A body is in the frame if part of its height is between the upper and lower edge of the image.
            in_frame = high_m > height_m - z * camera.down_tan and low_m < height_m + z * camera.up_tan
            if z > free[b] + _TOLERANCE_M or not (z < range_m and in_frame):
                hits[row, b] = math.inf
    return bodies[:in_view], hits[:in_view], free
