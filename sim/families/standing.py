"""Obstacles that stand on the path, beside it, above it or at its end."""

from __future__ import annotations

from config.scenario import Beam, BodySpec, Crate, Pallet, Pole, Scenario, Wall
from sim.families.layout import (
    FRONT_M,
    HALF_WIDTH_M,
    Random,
    hall,
    racks,
    random_side,
    random_texture,
    scenario,
)


def empty_aisle(random: Random) -> Scenario:
    """Nothing but racks: the robot must not slow down."""
    length = float(random.uniform(36.0, 44.0))
    return scenario("empty_aisle", length, racks(random, length))


def static_crate(random: Random) -> Scenario:
    """A crate that blocks the path for ever."""
    length = float(random.uniform(11.0, 15.0))
    crate = Crate(
        kind="crate",
        name="crate",
        x_m=float(random.uniform(6.0, length - 1.0)),
        y_m=float(random.uniform(-0.5, 0.5)),
        heading_deg=float(random.uniform(-45.0, 45.0)),
        length_m=float(random.uniform(0.4, 0.9)),
        width_m=float(random.uniform(0.4, 0.8)),
        height_m=float(random.uniform(0.35, 1.0)),
        texture=random_texture(random, "fine", "coarse", "plain"),
    )
    return scenario("static_crate", length, (*racks(random, length), crate), blocked=True)


def crate_beside(random: Random) -> Scenario:
    """Crates close to the path, but outside of what the body sweeps: the robot must not stop."""
    length = float(random.uniform(30.0, 36.0))
    crates = []
    for number, x in enumerate((7.0, 15.0, 23.0), start=1):
        width = float(random.uniform(0.4, 0.8))
        offset = HALF_WIDTH_M + float(random.uniform(0.22, 0.6))
        crates.append(
            Crate(
                kind="crate",
                name=f"crate {number}",
                x_m=x + float(random.uniform(-2.0, 2.0)),
                y_m=random_side(random) * (offset + 0.5 * width),
                length_m=float(random.uniform(0.4, 0.9)),
                width_m=width,
                height_m=float(random.uniform(0.4, 1.0)),
            )
        )
    return scenario("crate_beside", length, (*racks(random, length), *crates))


def low_pallet(random: Random) -> Scenario:
    """An empty pallet on the floor, below the plane of most laser scanners."""
    length = float(random.uniform(11.0, 15.0))
    pallet = Pallet(
        kind="pallet",
        name="pallet",
        x_m=float(random.uniform(6.0, length - 1.0)),
        y_m=float(random.uniform(-0.6, 0.6)),
        heading_deg=float(random.uniform(-90.0, 90.0)),
        height_m=float(random.uniform(0.12, 0.18)),
    )
    return scenario("low_pallet", length, (*racks(random, length), pallet), blocked=True)


def thin_pole(random: Random) -> Scenario:
    """An upright tube on the path."""
    length = float(random.uniform(11.0, 15.0))
    pole = Pole(
        kind="pole",
        name="pole",
        x_m=float(random.uniform(6.0, length - 1.0)),
        y_m=float(random.uniform(-0.3, 0.3)),
        diameter_m=float(random.uniform(0.04, 0.09)),
        height_m=float(random.uniform(0.9, 2.2)),
        texture=random_texture(random, "coarse", "plain"),
    )
    return scenario("thin_pole", length, (*racks(random, length), pole), blocked=True)


def plain_wall(random: Random) -> Scenario:
    """A wall without any texture, beyond the target or, for half of the seeds, before it."""
    length = float(random.uniform(11.0, 15.0))
    blocked = bool(random.integers(2))
    gap = -float(random.uniform(0.5, 3.0)) if blocked else float(random.uniform(0.75, 2.0))
    wall = Wall(
        kind="wall", name="wall", x_m=length + FRONT_M + gap + 0.1, y_m=0.0, heading_deg=90.0, length_m=4.0
    )
    return scenario("plain_wall", length, (wall, *racks(random, length - 3.0)), blocked=blocked)


def hanging_beam(random: Random) -> Scenario:
    """A bar across the path, at the robot's height or, for half of the seeds, above it."""
    length = float(random.uniform(11.0, 15.0))
    blocked = bool(random.integers(2))
    underside = float(random.uniform(0.35, 0.65)) if blocked else float(random.uniform(1.1, 1.8))
    beam = Beam(
        kind="beam",
        name="beam",
        x_m=float(random.uniform(6.0, length - 1.0)),
        y_m=0.0,
        z_m=underside,
        heading_deg=90.0,
        length_m=float(random.uniform(2.0, 3.2)),
        texture=random_texture(random, "fine", "coarse"),
    )
    return scenario("hanging_beam", length, (beam, *racks(random, length)), blocked=blocked)


def glass_front(random: Random) -> Scenario:
    """A glass front across the path, for which there is no depth."""
    length = float(random.uniform(12.0, 15.0))
    front: BodySpec = Wall(
        kind="wall",
        name="glass front",
        x_m=float(random.uniform(8.0, length - 1.0)),
        y_m=0.0,
        heading_deg=90.0,
        length_m=6.0,
        width_m=0.05,
        glass=True,
    )
    return scenario("glass_front", length, (front,), blocked=True, room=hall(length, 3.2))
