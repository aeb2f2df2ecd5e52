"""The places of the simulated set: rooms with their fixed bodies and clutter."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from config.scenario import (
    Beam,
    BodySpec,
    Column,
    Crate,
    Pallet,
    Person,
    Pole,
    Room,
    Shelf,
    TapeLine,
    Texture,
    Wall,
)
from hal.types import FloatArray

PlaceName = Literal["hall", "aisle", "workshop"]
# The room; bodies that stand where they are; clutter, of which scenes leave out what is in the way.
Place = tuple[Room, list[BodySpec], list[BodySpec]]


def _bounds(course: FloatArray, margin_m: float) -> tuple[float, float, float, float]:
    low, high = course.min(axis=0) - margin_m, course.max(axis=0) + margin_m
    return float(low[0]), float(high[0]), float(low[1]), float(high[1])


def _hall(generator: np.random.Generator, course: FloatArray) -> Place:
    """A large hall with scattered columns, crates, pallets and poles; the walls are some metres away."""
    x0, x1, y0, y1 = _bounds(course, 11.0)
    tape = tuple(TapeLine(ax_m=x0, ay_m=y_m, bx_m=x1, by_m=y_m) for y_m in (1.4, -1.4))
    room = Room(x_min_m=x0, x_max_m=x1, y_min_m=y0, y_max_m=y1, height_m=5.5, tape=tape)
    return room, [], _scatter(generator, (x0 + 1.0, x1 - 1.0, y0 + 1.0, y1 - 1.0), 46)


def _aisle(generator: np.random.Generator, course: FloatArray) -> Place:
    """An aisle between racks, with a gap on either side some metres ahead."""
    end = float(course[:, 0].max())
    tape = (TapeLine(ax_m=-4.0, ay_m=1.2, bx_m=end + 12.0, by_m=1.2, colour="white"),)
    room = Room(x_min_m=-4.0, x_max_m=end + 12.0, y_min_m=-7.0, y_max_m=7.0, floor="coarse", tape=tape)
    racks: list[BodySpec] = []
    for side in (1.0, -1.0):
        for index, (x_m, length_m) in enumerate(((0.4, 5.4), (end + 8.1, 5.4))):
            racks.append(
                Shelf(
                    kind="shelf",
                    name=f"rack {index} {'left' if side > 0 else 'right'}",
                    x_m=x_m,
                    y_m=side * float(generator.uniform(2.4, 2.9)),
                    length_m=length_m,
                    goods=float(generator.uniform(0.4, 0.8)),
                )
            )
    return room, racks, _scatter(generator, (3.0, end + 10.0, -5.5, 5.5), 14)


def _workshop(generator: np.random.Generator, course: FloatArray) -> Place:
    """A workshop: textured walls nearby, scattered objects, a beam overhead."""
    x0, x1, y0, y1 = _bounds(course, 8.5)
    room = Room(
        x_min_m=x0,
        x_max_m=x1,
        y_min_m=y0,
        y_max_m=y1,
        height_m=4.0,
        floor="fine",
        walls="fine",
        ceiling="coarse",
    )
    fixed: list[BodySpec] = [
        Beam(kind="beam", name="beam", x_m=float(course[-1, 0]) + 4.0, y_m=0.0, z_m=2.4, heading_deg=90.0,
             length_m=6.0),
    ]  # fmt: skip
    return room, fixed, _scatter(generator, (x0 + 0.8, x1 - 0.8, y0 + 0.8, y1 - 0.8), 34)


def _scatter(
    generator: np.random.Generator, area: tuple[float, float, float, float], count: int
) -> list[BodySpec]:
    """Clutter: static objects, at least 1.2 m apart."""
    x0, x1, y0, y1 = area
    placed: list[FloatArray] = []
    bodies: list[BodySpec] = []
    for index in range(count):
        position = np.array([generator.uniform(x0, x1), generator.uniform(y0, y1)])
        if placed and np.hypot(*(np.array(placed) - position).T).min() < 1.2:
            continue
        placed.append(position)
        bodies.append(_clutter_object(generator, index, float(position[0]), float(position[1])))
    return bodies


def _clutter_object(generator: np.random.Generator, index: int, x_m: float, y_m: float) -> BodySpec:
    turn_deg = float(generator.uniform(-90.0, 90.0))
    name = f"thing {index}"
    texture: Texture = ("fine", "coarse", "plain")[int(generator.integers(3))]
    match int(generator.integers(8)):
        case 0:
            return Column(kind="column", name=name, x_m=x_m, y_m=y_m, texture=texture, height_m=4.0)
        case 1:
            return Pole(kind="pole", name=name, x_m=x_m, y_m=y_m)
        case 2:
            return Pallet(kind="pallet", name=name, x_m=x_m, y_m=y_m, heading_deg=turn_deg)
        case 3:
            return Pallet(
                kind="pallet", name=name, x_m=x_m, y_m=y_m, heading_deg=turn_deg, texture=texture,
                load_height_m=float(generator.uniform(0.4, 1.3)),
            )  # fmt: skip
        case 4:
            return Wall(
                kind="wall", name=name, x_m=x_m, y_m=y_m, heading_deg=turn_deg, texture=texture, length_m=1.6,
                height_m=1.8,
            )  # fmt: skip
        case 5:
            return Person(kind="person", name=name, x_m=x_m, y_m=y_m, heading_deg=turn_deg)
        case _:
            return Crate(
                kind="crate", name=name, x_m=x_m, y_m=y_m, heading_deg=turn_deg, texture=texture,
                length_m=float(generator.uniform(0.4, 1.0)), width_m=float(generator.uniform(0.4, 0.8)),
                height_m=float(generator.uniform(0.3, 1.3)),
            )  # fmt: skip


PLACES: dict[PlaceName, Callable[[np.random.Generator, FloatArray], Place]] = {
    "hall": _hall,
    "aisle": _aisle,
    "workshop": _workshop,
}
"""Each makes its place around the robot's course (N, 2)."""
