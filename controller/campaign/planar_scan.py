"""A perfect planar scanner at the robot's front: every point true, at a fixed height over the floor."""

from __future__ import annotations

import math

import numpy as np

from controller.campaign.stage import Stage
from hal.types import FloatArray, PlanarPose
from sim.planar import PlanarWorld

SCAN_HEIGHT_M = 0.2
_FIELD_RAD = math.radians(270.0)
_RAYS = 271
_RANGE_M = 12.0
_PERIOD_S = 0.066


class PlanarScanner:
    """Looks every 66 ms, as safety scanners do; what it says is exact. Points are in the body frame.

    It sees what is at its height only: a pallet on the floor and a beam are not there for it.
    """

    def __init__(self, stage: Stage) -> None:
        self._world: PlanarWorld = stage.world
        self._front_m = stage.robot.body.front_m
        z_m = self._world.z_m
        self._at_height = (z_m[:, 0] <= SCAN_HEIGHT_M) & (z_m[:, 1] > SCAN_HEIGHT_M)
        self._angles = np.linspace(-0.5 * _FIELD_RAD, 0.5 * _FIELD_RAD, _RAYS)
        self._cos, self._sin = np.cos(self._angles), np.sin(self._angles)
        self._next_s = 0.0
        self._points: FloatArray = np.zeros((0, 2))
        self._taken_at: PlanarPose | None = None

    def points(self, pose: PlanarPose, t_s: float) -> FloatArray:
        """(P, 2) points of the newest scan in the body frame now: shifted by the robot's own motion since."""
        if t_s >= self._next_s:
            self._next_s = t_s + _PERIOD_S
            self._points = self._scan(pose, t_s)
            self._taken_at = pose
        if self._taken_at is None or not len(self._points):
            return self._points
        return _seen_from(pose, _on_floor(self._taken_at, self._points))

    def _scan(self, pose: PlanarPose, t_s: float) -> FloatArray:
        polygons = self._world.look(t_s)[0][self._at_height]
        room = np.repeat(self._world.room_polygon(), 1, axis=0)
        corners = [*polygons, room]
        nearest = np.full(_RAYS, np.inf)
        for polygon in corners:
            local = _seen_from(pose, polygon)
            local[:, 0] -= self._front_m
            off = local[:, 1] * self._cos[:, None] - local[:, 0] * self._sin[:, None]
            along = local[:, 0] * self._cos[:, None] + local[:, 1] * self._sin[:, None]
            next_off, next_along = np.roll(off, -1, axis=1), np.roll(along, -1, axis=1)
            drop = off - next_off
            share = off / np.where(np.abs(drop) < 1e-12, np.inf, drop)
            reach = along + share * (next_along - along)
            hit = np.where((off * next_off <= 0.0) & (reach > 0.0), reach, np.inf).min(axis=1)
            nearest = np.minimum(nearest, hit)
        seen = nearest < _RANGE_M
        x = nearest[seen] * self._cos[seen] + self._front_m
        return np.stack((x, nearest[seen] * self._sin[seen]), axis=1)


def _on_floor(pose: PlanarPose, points: FloatArray) -> FloatArray:
    cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    x, y = points[:, 0], points[:, 1]
    return np.stack((pose.x_m + cos * x - sin * y, pose.y_m + sin * x + cos * y), axis=1)


def _seen_from(pose: PlanarPose, points: FloatArray) -> FloatArray:
    cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    dx, dy = points[:, 0] - pose.x_m, points[:, 1] - pose.y_m
    return np.stack((dx * cos + dy * sin, dy * cos - dx * sin), axis=1)
