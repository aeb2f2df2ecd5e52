"""What a camera can see of the plane: rays through bands of columns against footprints."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.camera import SimulatedCameraConfig
from config.robot import Mount
from hal.types import FloatArray, PlanarPose
from sim.planar import PlanarWorld
from vision.scene import NEVER_M

BANDS = 80
_NEAR_M = 0.1
_TOUCHING_M = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class PlanarView:
    """One look. bodies (M,): which ones were looked at. forward_m (M, B): where each band's ray meets each
    body, inf where it does not or is covered by something nearer. free_m (B,): where the first thing that
    hides what is behind it stands, the building included."""

    bodies: NDArray[np.intp]
    forward_m: FloatArray
    free_m: FloatArray


class PlanarEye:
    """The pinhole of a camera, its height and pitch. bearing_tan (B,): right over forward of each band.
    floor_from_m, up_tan: as in FreeSpace."""

    def __init__(
        self,
        world: PlanarWorld,
        camera: SimulatedCameraConfig,
        mount: Mount,
        hangs_m: float = math.inf,
    ) -> None:
        """hangs_m: what begins so high hangs, and hides nothing of the floor behind it."""
        self._world, self._mount = world, mount
        self.range_m = camera.depth_max_m
        left, right = (-0.5 - camera.cx) / camera.fx, (camera.width - 0.5 - camera.cx) / camera.fx
        edges = np.linspace(left, right, BANDS + 1) / math.cos(mount.pitch_rad)
        self.bearing_tan = 0.5 * (edges[1:] + edges[:-1])
        self.half_width_tan = 0.5 * float(edges[1] - edges[0])
        self._edge_tan = max(-float(edges[0]), float(edges[-1]))
        down = math.atan((camera.height - 0.5 - camera.cy) / camera.fy) + mount.pitch_rad
        up = math.atan((camera.cy + 0.5) / camera.fy) - mount.pitch_rad
        self._down_tan, self.up_tan = math.tan(down), math.tan(up)
        sees_floor = self._down_tan > mount.height_m / NEVER_M
        self.floor_from_m = mount.height_m / self._down_tan if sees_floor else NEVER_M
        z_m = world.z_m
        self._hides = (z_m[:, 0] < min(mount.height_m, hangs_m)) & (z_m[:, 1] > mount.height_m)
        # (2, K + 1, N + 1): the outlines of all bodies and, at the end, of the building, by corners; each is
        # closed by its first one.
        outlines, room = world.look(0.0)[0], world.room_polygon()
        corners = max(outlines.shape[1], len(room))
        self._outlines = np.empty((2, corners + 1, len(world) + 1))
        self._outlines[:, :-1, -1] = room[np.minimum(np.arange(corners), len(room) - 1)].T

    def look(self, polygons: FloatArray, pose: PlanarPose) -> PlanarView:
        """polygons (N, K, 2) of all bodies now; pose of the robot."""
        outlines = self._outlines
        outlines[:, :-1, :-1] = polygons.T
        outlines[:, -1] = outlines[:, 0]
        forward, right = self._in_camera(outlines[0], outlines[1], pose)
        reach = self._edge_tan * forward
        near = (forward.max(axis=0) > _NEAR_M) & (forward.min(axis=0) < self.range_m)
        near &= ((right - reach).min(axis=0) < 0.0) & ((right + reach).max(axis=0) > 0.0)
        near[-1] = True  # the building, which is not a body
        chosen = near.nonzero()[0]
        forward, right = forward.take(chosen, 1), right.take(chosen, 1)
        hits = self._hits(forward, right)
        bodies, room, hits = chosen[:-1], hits[-1], hits[:-1]
        unmet = np.isinf(hits.min(axis=1)).nonzero()[0]
        if len(unmet):
            hits[unmet] = self._thin_ones(forward[:, unmet], right[:, unmet])
        hiding = hits.take(self._hides[bodies].nonzero()[0], 0)
        free = np.minimum(hiding.min(axis=0, initial=np.inf), room)
        np.putmask(hits, (hits > free + _TOUCHING_M) | ~self._in_frame(bodies, hits), np.inf)
        return PlanarView(bodies, hits, free)

    def _in_camera(self, x_m: FloatArray, y_m: FloatArray, pose: PlanarPose) -> tuple[FloatArray, FloatArray]:
        """Forward and right (...) of the camera, on the level, of points x_m (...), y_m (...)."""
        cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        dx, dy = x_m - pose.x_m, y_m - pose.y_m
        return dx * cos + dy * sin - self._mount.forward_m, self._mount.left_m + dx * sin - dy * cos

    def _hits(self, forward: FloatArray, right: FloatArray) -> FloatArray:
        """(M, B) forward distance at which each ray first meets an edge of each polygon (K + 1, M)."""
        # All pairs of a ray and an edge at once: to pick the few that meet would take longer.
        off = right[:, :, None] - self.bearing_tan * forward[:, :, None]
        here, there = off[:-1], off[1:]
        drop = here - there
        share = here / np.where(np.abs(drop) < 1e-12, np.inf, drop)
        start = forward[:-1, :, None]
        z = start + share * (forward[1:, :, None] - start)
        met = (here * there <= 0.0) & (z > _NEAR_M)
        nearest: FloatArray = np.where(met, z, np.inf).min(axis=0)
        return nearest

    def _thin_ones(self, forward: FloatArray, right: FloatArray) -> FloatArray:
        """(M, B) for bodies that no ray has met: a pole may stand between two, and is seen all the same."""
        ahead = forward.min(axis=0)
        tangent = right / np.maximum(forward, _NEAR_M)
        low, high = tangent.min(axis=0) - self.half_width_tan, tangent.max(axis=0) + self.half_width_tan
        thin = (ahead > _NEAR_M) & (high - low <= 4.0 * self.half_width_tan)
        between = (self.bearing_tan > low[:, None]) & (self.bearing_tan < high[:, None])
        return np.where(thin[:, None] & between, ahead[:, None], np.inf)

    def _in_frame(self, bodies: NDArray[np.intp], hits: FloatArray) -> NDArray[np.bool_]:
        """Whether any of its height is between the upper and the lower edge of the image."""
        z_m, eye_m = self._world.z_m.take(bodies, 0), self._mount.height_m
        above = z_m[:, 1:] > eye_m - hits * self._down_tan
        below = z_m[:, :1] < eye_m + hits * self.up_tan
        seen: NDArray[np.bool_] = above & below & (hits < self.range_m)
        return seen
