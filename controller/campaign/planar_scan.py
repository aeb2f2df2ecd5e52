"""A perfect planar laser scanner at the robot's front: exact points, at a fixed height above the floor."""

from __future__ import annotations

import math

import numpy as np

from controller.campaign.stage import Stage
from controller.decision.surfaces import floor_points
from hal.compiled import compiled
from hal.directions import along_and_left
from hal.types import FloatArray, PlanarPose
from sim.planar import PlanarWorld

# A safety scanner as it is usually mounted on a vehicle: low enough for a foot, a ray for each degree.
SCAN_HEIGHT_M = 0.2
_FIELD_OF_VIEW_RAD = math.radians(270.0)
_RAYS = 271
_RANGE_M = 12.0  # farther than any field or zone reaches
_PERIOD_S = 0.066
_NOTHING = np.full(_RAYS, np.inf)


class PlanarScanner:
    """Scans every 66 ms, as safety scanners do, without errors. Points are in the body frame.

    It sees only what is at its height: neither a pallet on the floor nor a beam.
    """

    def __init__(self, stage: Stage) -> None:
        self._world: PlanarWorld = stage.world
        self._front_m = stage.robot.body.front_m
        z_m = self._world.z_m
        self._at_height = (z_m[:, 0] <= SCAN_HEIGHT_M) & (z_m[:, 1] > SCAN_HEIGHT_M)
        angles = np.linspace(-0.5 * _FIELD_OF_VIEW_RAD, 0.5 * _FIELD_OF_VIEW_RAD, _RAYS)
        self._rays = np.stack((np.cos(angles), np.sin(angles)))
        self._next_s = 0.0
        self._points: FloatArray = np.zeros((0, 2))
        self._scan_pose: PlanarPose | None = None

    def points(self, pose: PlanarPose, t_s: float) -> FloatArray:
        """Points (P, 2) of the newest scan, moved to the present body frame by the robot's motion since
        then."""
        if t_s >= self._next_s:
            self._next_s = t_s + _PERIOD_S
            self._points = self._scan(pose, t_s)
            self._scan_pose = pose
        if self._scan_pose is None or not len(self._points):
            return self._points
        ahead_m, left_m = self._points.T
        return in_body(pose, floor_points(self._scan_pose, ahead_m, left_m))

    def _scan(self, pose: PlanarPose, t_s: float) -> FloatArray:
        polygons = self._world.snapshot(t_s)[0][self._at_height]
        nearest = _ray_lengths(_NOTHING, self._world.room_polygon()[None], self._rays, pose, self._front_m)
        nearest = _ray_lengths(nearest, polygons, self._rays, pose, self._front_m)
        in_range = nearest < _RANGE_M
        ahead_m, left_m = nearest[in_range] * self._rays[:, in_range]
        return np.stack((ahead_m + self._front_m, left_m), axis=1)


@compiled("float64[:], float64[:, :, ::1], float64[:, ::1]", PlanarPose, "float64")
def _ray_lengths(
    max_m: FloatArray, polygons: FloatArray, rays: FloatArray, body: PlanarPose, front_m: float
) -> FloatArray:
    """(R,) lengths of rays up to the first edge of polygons (N, K, 2), at most max_m.

    rays (2, R): cosines and sines of their angles to the heading of a body. They begin front_m ahead of it.
    """
    cos, sin = math.cos(body.heading_rad), math.sin(body.heading_rad)
    nearest, corners = max_m.copy(), polygons.shape[1]
    forward, left = np.empty(corners), np.empty(corners)
    for polygon in polygons:
        for j in range(corners):
            along_m, left[j] = along_and_left(polygon[j, 0] - body.x_m, polygon[j, 1] - body.y_m, cos, sin)
            forward[j] = along_m - front_m
        for j in range(corners):
            next_corner = (j + 1) % corners
            for ray in range(len(nearest)):
                c, s = rays[0, ray], rays[1, ray]
                side = left[j] * c - forward[j] * s
                next_side = left[next_corner] * c - forward[next_corner] * s
                if side * next_side > 0.0:
                    continue
                span = side - next_side
                fraction = side / span if abs(span) >= 1e-12 else 0.0
                along = forward[j] * c + left[j] * s
                distance = along + fraction * (forward[next_corner] * c + left[next_corner] * s - along)
                if 0.0 < distance < nearest[ray]:
                    nearest[ray] = distance
    return nearest


def in_body(pose: PlanarPose, points: FloatArray) -> FloatArray:
    """Floor points (P, 2) in the frame of a body at pose."""
    cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    dx, dy = points[:, 0] - pose.x_m, points[:, 1] - pose.y_m
    return np.stack((dx * cos + dy * sin, dy * cos - dx * sin), axis=1)
