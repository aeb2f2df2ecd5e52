"""A simulated planar lidar: rays against the walls and the outlines of all bodies at the scanner's height."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from config.scenario import Room
from hal.types import FloatArray, PlanarPose
from sim.world import BodyState

_LEG_OUTLINE_RATIO = 0.6  # size of a person's outline, as a share of the footprint


@dataclass(frozen=True, slots=True)
class LidarModel:
    """A common safety or navigation scanner.

    height_m: above the floor.
    forward_m: ahead of the robot's centre of rotation.
    field_deg, step_deg: field of view, and angle between beams.
    rate_hz: scans per second.
    range_m: greatest range.
    noise_m: standard deviation of a range.
    """

    height_m: float = 0.30
    forward_m: float = 0.45
    field_deg: float = 270.0
    step_deg: float = 0.33
    rate_hz: float = 15.0
    range_m: float = 15.0
    noise_m: float = 0.03

    @property
    def bearings_rad(self) -> FloatArray:
        """(N,) bearings of the beams, from right to left."""
        count = round(self.field_deg / self.step_deg) + 1
        half = math.radians(self.field_deg) / 2.0
        return np.linspace(-half, half, count)


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """One scan. bearings_rad, range_m: (N,), one a beam; range inf where there is no return."""

    stamp_s: float
    bearings_rad: FloatArray
    range_m: FloatArray


class Lidar:
    """Scans the world.

    A person is one convex outline, _LEG_OUTLINE_RATIO times the footprint that swinging limbs need. This
    favours the lidar: two legs that occlude each other in turn would be harder to track.
    """

    def __init__(self, model: LidarModel, room: Room, seed: int) -> None:
        self._model = model
        corners = np.array(
            [
                [room.x_min_m, room.y_min_m],
                [room.x_max_m, room.y_min_m],
                [room.x_max_m, room.y_max_m],
                [room.x_min_m, room.y_max_m],
            ]
        )
        self._walls = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
        self._generator = np.random.default_rng((seed, 301))

    def scan(self, t_s: float, robot: PlanarPose, bodies: Sequence[BodyState]) -> Scan:
        """One scan with noise. robot: its true pose."""
        model = self._model
        outlines = [
            np.stack([outline, np.roll(outline, -1, axis=0)], axis=1)
            for body, outline in ((body, _outline(body)) for body in bodies)
            if body.z_m[0] <= model.height_m <= body.z_m[1]
        ]
        c, s = math.cos(robot.heading_rad), math.sin(robot.heading_rad)
        origin = np.array([robot.x_m + model.forward_m * c, robot.y_m + model.forward_m * s])
        bearings = model.bearings_rad
        exact = cast(origin, bearings + robot.heading_rad, np.concatenate([self._walls, *outlines]))
        noisy = exact + self._generator.normal(0.0, model.noise_m, len(exact))
        return Scan(t_s, bearings, np.where(noisy <= model.range_m, noisy, np.inf))


def _outline(body: BodyState) -> FloatArray:
    if body.kind != "person":
        return body.footprint_m
    middle = body.footprint_m.mean(axis=0)
    return np.asarray(middle + _LEG_OUTLINE_RATIO * (body.footprint_m - middle))


def cast(origin: FloatArray, angles_rad: FloatArray, segments: FloatArray) -> FloatArray:
    """(N,) distance from origin (2,) along angles (N,) to the nearest of segments (M, 2, 2); inf: no hit."""
    direction = np.stack([np.cos(angles_rad), np.sin(angles_rad)], axis=1)[:, None, :]
    start = segments[None, :, 0] - origin
    along = (segments[:, 1] - segments[:, 0])[None]
    determinant = direction[..., 0] * along[..., 1] - direction[..., 1] * along[..., 0]
    safe = np.where(np.abs(determinant) > 1e-12, determinant, np.nan)
    range_m = (start[..., 0] * along[..., 1] - start[..., 1] * along[..., 0]) / safe
    fraction = (start[..., 0] * direction[..., 1] - start[..., 1] * direction[..., 0]) / safe
    hit = (range_m > 0.0) & (fraction >= 0.0) & (fraction <= 1.0)
    nearest: FloatArray = np.where(hit, range_m, np.inf).min(axis=1)
    return nearest
