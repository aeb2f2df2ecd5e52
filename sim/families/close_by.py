"""Obstacles close beside a path that stays free: a crate beside a bend, racks on both sides."""

from __future__ import annotations

import math

import numpy as np

from config.scenario import Crate, Scenario, Shelf
from sim.families.layout import (
    BLEND_M,
    FRONT_M,
    HALF_WIDTH_M,
    RACK_DEPTH_M,
    Random,
    bend_path,
    random_side,
    scenario,
)

# Corners and middles of the sides of a crate, as shares of its size.
_OUTLINE = np.array([(x, y) for x in (-0.5, 0.0, 0.5) for y in (-0.5, 0.0, 0.5) if x or y])


def crate_beside_bend(random: Random) -> Scenario:
    """A crate at any angle, inside or outside of a bend: the robot must not stop for it."""
    radius, turn = float(random.uniform(2.5, 7.0)), random_side(random) * float(random.uniform(40.0, 90.0))
    before, after = float(random.uniform(3.0, 5.0)), float(random.uniform(4.0, 6.0))
    crate = _crate_at(random, before, radius, turn, outside=bool(random.integers(2)))
    path, room = bend_path(before, radius, turn, after)
    return scenario("crate_beside_bend", 0.0, (crate,), path=path, room=room)


def _crate_at(random: Random, before_m: float, radius_m: float, turn_deg: float, outside: bool) -> Crate:
    """A crate 0.3 to 0.7 m from what the robot sweeps on the circle of the bend. The blends hardly deviate
    from that circle."""
    length, width = float(random.uniform(0.4, 0.9)), float(random.uniform(0.4, 0.8))
    heading = float(random.uniform(0.0, 180.0))
    left = math.copysign(1.0, turn_deg)
    angle = math.radians(abs(turn_deg)) * float(random.uniform(0.2, 0.8))
    outwards = np.array([math.sin(angle), -left * math.cos(angle)])
    cos, sin = math.cos(math.radians(heading)), math.sin(math.radians(heading))
    outline = _OUTLINE * (length, width) @ np.array([[cos, sin], [-sin, cos]])
    clearance = math.hypot(radius_m + HALF_WIDTH_M, FRONT_M) - radius_m + float(random.uniform(0.3, 0.7))
    # Distance of the crate's centre from the centre of the bend, from the crate's innermost or outermost
    # point.
    if outside:
        from_centre = radius_m + clearance - float((outline @ outwards).min())
    else:
        from_centre = radius_m - clearance - float((outline @ outwards).max())
    x, y = np.array([before_m + 0.5 * BLEND_M, left * radius_m]) + from_centre * outwards
    return Crate(
        kind="crate",
        name="crate outside" if outside else "crate inside",
        x_m=float(x),
        y_m=float(y),
        heading_deg=heading,
        length_m=length,
        width_m=width,
        height_m=float(random.uniform(0.4, 1.0)),
    )


def narrow_aisle(random: Random) -> Scenario:
    """Racks on both sides, 0.3 to 0.6 m from the robot's sides, and nothing else."""
    length = float(random.uniform(18.0, 24.0))
    shelves = []
    for side in (1.0, -1.0):
        offset = HALF_WIDTH_M + float(random.uniform(0.3, 0.6))
        shelves.append(
            Shelf(
                kind="shelf",
                name="rack left" if side > 0 else "rack right",
                x_m=0.5 * length - 2.0,
                y_m=side * (offset + 0.5 * RACK_DEPTH_M),
                length_m=length,
                width_m=RACK_DEPTH_M,
            )
        )
    return scenario("narrow_aisle", length, tuple(shelves))
