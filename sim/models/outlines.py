"""The footprint of each kind of body, which counts for contact, and its heights. Its faces: bodies.py."""

from __future__ import annotations

import math

import numpy as np

from config.scenario import (
    Beam,
    BodySpec,
    Column,
    Crate,
    Pallet,
    Person,
    Pole,
    RobotBody,
    Shelf,
    Wall,
)
from hal.types import FloatArray
from sim.models.person import swing
from sim.models.vehicle import SENSOR_HEIGHT_M

POLE_SIDES = 8  # of the prism that stands for a pole


def footprint(spec: BodySpec, speed_mps: float) -> FloatArray:
    """Corners (K, 2) in the body frame, convex, counter-clockwise, of a body that goes at speed_mps."""
    match spec:
        case Person():
            return _person(spec.height_m, swing(speed_mps))
        case Column():
            return _regular_polygon(spec.sides, 0.5 * spec.diameter_m)
        case Pole():
            return _regular_polygon(POLE_SIDES, 0.5 * spec.diameter_m)
        case Crate() | Shelf() | Pallet() | Wall() | Beam() | RobotBody():
            x, y = 0.5 * spec.length_m, 0.5 * spec.width_m
            return np.array([[x, -y], [x, y], [-x, y], [-x, -y]])


def heights(spec: BodySpec) -> tuple[float, float]:
    """The lowest and the highest point of a body above the floor."""
    on_top_m = 0.0
    if isinstance(spec, Pallet):
        on_top_m = spec.load_height_m
    elif isinstance(spec, RobotBody):
        on_top_m = max(spec.load_height_m, SENSOR_HEIGHT_M)
    return spec.z_m, spec.z_m + spec.height_m + on_top_m


def _regular_polygon(sides: int, radius_m: float) -> FloatArray:
    """Corners (sides, 2) on a circle around the origin, counter-clockwise, as in sim.models.mesh.prism."""
    angles = (np.arange(sides) + 0.5) * (2.0 * math.pi / sides)
    return np.stack([radius_m * np.cos(angles), radius_m * np.sin(angles)], axis=1)


def _person(h: float, amplitude: float) -> FloatArray:
    """An octagon (8, 2) around feet and arms of a person h tall, whose limbs swing with this amplitude."""
    front, rear, side = (0.11 + 0.23 * amplitude) * h, (0.075 + 0.20 * amplitude) * h, 0.166 * h
    return np.array(
        [
            [front, -0.11 * h], [front, 0.11 * h], [0.85 * front, side], [-0.85 * rear, side],
            [-rear, 0.11 * h], [-rear, -0.11 * h], [-0.85 * rear, -side], [0.85 * front, -side],
        ]
    )  # fmt: skip
