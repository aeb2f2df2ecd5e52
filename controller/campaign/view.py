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

BANDS = 80
_NEAR_M = 0.1
_TOUCHING_M = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """One look. bodies (M,): which ones were looked at. forward_m (B, M): where each band's ray meets each
    body, inf where it does not or is covered by something nearer. free_m (B,): where the first thing that
    hides what is behind it stands, the building included."""

    bodies: NDArray[np.intp]
    forward_m: FloatArray
    free_m: FloatArray


class PlanarEye:
    """The pinhole of a camera, its height and pitch. bearing_tan (B,): right over forward of each band."""

    def __init__(self, world: PlanarWorld, camera: SimulatedCameraConfig, mount: Mount) -> None:
        self._world, self._mount = world, mount
        self.range_m = camera.depth_max_m
        left, right = (-0.5 - camera.cx) / camera.fx, (camera.width - 0.5 - camera.cx) / camera.fx
        edges = np.linspace(left, right, BANDS + 1) / math.cos(mount.pitch_rad)
        self.bearing_tan = 0.5 * (edges[1:] + edges[:-1])
        self.half_width_tan = 0.5 * float(edges[1] - edges[0])
        self._edge_tan = max(-float(edges[0]), float(edges[-1]))
        down = math.atan((camera.height - 0.5 - camera.cy) / camera.fy) + mount.pitch_rad
        up = math.atan((camera.cy + 0.5) / camera.fy) - mount.pitch_rad
        self._down_tan, self._up_tan = math.tan(down), math.tan(up)
        z_m = world.z_m
        self._hides = (z_m[:, 0] < mount.height_m) & (z_m[:, 1] > mount.height_m)
        corners = world.look(0.0)[0].shape[1]
        room = world.room_polygon()
        self._room = np.concatenate((room, np.repeat(room[-1:], max(corners - 4, 0), axis=0)))[None]
        self._next = np.roll(np.arange(max(corners, 4)), -1)
        self._bearing = self.bearing_tan[:, None, None]

    def look(self, polygons: FloatArray, pose: PlanarPose) -> View:
        """polygons (N, K, 2) of all bodies now; pose of the robot."""
        forward, right = self._in_camera(np.concatenate((polygons, self._room)), pose)
        reach = self._edge_tan * forward
        near = (forward.max(axis=1) > _NEAR_M) & (forward.min(axis=1) < self.range_m)
        inside = ((right - reach).min(axis=1) < 0.0) & ((right + reach).max(axis=1) > 0.0)
        near &= inside
        near[-1] = True  # the building, which is not a body
        chosen = np.flatnonzero(near)
        hits = self._hits(forward[chosen], right[chosen])
        bodies, room, hits = chosen[:-1], hits[:, -1], hits[:, :-1]
        hits = self._with_thin_ones(hits, forward[bodies], right[bodies])
        hiding = np.where(self._hides[bodies], hits, np.inf)
        free = np.minimum(hiding.min(axis=1, initial=np.inf), room)
        covered = hits > free[:, None] + _TOUCHING_M
        return View(bodies, np.where(covered | ~self._in_frame(bodies, hits), np.inf, hits), free)

    def _in_camera(self, polygons: FloatArray, pose: PlanarPose) -> tuple[FloatArray, FloatArray]:
        """Forward and right (N, K) of the camera, on the level."""
        cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        dx, dy = polygons[..., 0] - pose.x_m, polygons[..., 1] - pose.y_m
        return dx * cos + dy * sin - self._mount.forward_m, self._mount.left_m + dx * sin - dy * cos

    def _hits(self, forward: FloatArray, right: FloatArray) -> FloatArray:
        """(B, M) forward distance at which each ray first meets an edge of each polygon (M, K)."""
        off = right - self._bearing * forward
        after, ahead = off[..., self._next], forward[..., self._next]
        # Of all the pairs of a ray and an edge only a few meet: the rest is never divided.
        band, body, corner = np.nonzero(off * after <= 0.0)
        here, there = off[band, body, corner], after[band, body, corner]
        drop = here - there
        share = here / np.where(np.abs(drop) < 1e-12, np.inf, drop)
        start = forward[body, corner]
        z = start + share * (ahead[body, corner] - start)
        nearest = np.full(off.shape[:2], np.inf)
        met = z > _NEAR_M
        np.minimum.at(nearest, (band[met], body[met]), z[met])
        return nearest

    def _with_thin_ones(self, hits: FloatArray, forward: FloatArray, right: FloatArray) -> FloatArray:
        """A pole may stand between two rays, and is seen all the same."""
        ahead = forward.min(axis=1) > _NEAR_M
        tangent = right / np.maximum(forward, _NEAR_M)
        low, high = tangent.min(axis=1) - self.half_width_tan, tangent.max(axis=1) + self.half_width_tan
        bearing = self.bearing_tan[:, None]
        thin = ahead & (high - low <= 4.0 * self.half_width_tan) & ~np.isfinite(hits).any(axis=0)
        missed = thin & (bearing > low) & (bearing < high)
        return np.where(missed, forward.min(axis=1), hits)

    def _in_frame(self, bodies: NDArray[np.intp], hits: FloatArray) -> NDArray[np.bool_]:
        """Whether any of its height is between the upper and the lower edge of the image."""
        z_m, eye_m = self._world.z_m[bodies], self._mount.height_m
        finite = np.where(np.isfinite(hits), hits, 0.0)
        above = z_m[:, 1] > eye_m - finite * self._down_tan
        below = z_m[:, 0] < eye_m + finite * self._up_tan
        seen: NDArray[np.bool_] = above & below & (hits < self.range_m)
        return seen
