"""The scenes of the simulated set: movers placed relative to the robot, and clutter off their paths."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from config.path import LineSpec, PathSpec
from config.scenario import (
    Beam,
    BodySpec,
    Column,
    Crate,
    Go,
    Light,
    MotionPlan,
    Pallet,
    Person,
    Pole,
    RobotBody,
    Room,
    Scenario,
    Shelf,
    TapeLine,
    Texture,
    Wall,
)
from controller.evaluation.scripted_drive import ScriptedDrive
from hal.types import FloatArray, PlanarPose

Kind = Literal["person", "robot", "cart"]

_INSTANT_MPS2 = 20.0  # acceleration of movers that are in motion from the start
_ROBOT_CLEARANCE_M = 1.1  # least distance of clutter from the robot's path
_MOVER_CLEARANCE_M = 0.9  # least distance of clutter from a mover's path


@dataclass(frozen=True, slots=True)
class Mover:
    """A mover on a straight line. At at_s it is ahead_m ahead and left_m to the left of the robot.

    course_deg: relative to the robot's heading at at_s; 180 comes towards it, 90 crosses to the left.
    starts_s, stops_s: stands until the first and from the second; with an ordinary acceleration (1.5 m/s^2).
    height_m: of a person.
    load_m: height of a robot's load.
    """

    kind: Kind
    ahead_m: float
    left_m: float
    course_deg: float
    speed_mps: float
    at_s: float = 2.0
    starts_s: float | None = None
    stops_s: float | None = None
    texture: Texture = "fine"
    height_m: float = 1.75
    load_m: float = 0.5


@dataclass(frozen=True, slots=True)
class _MoverPath:
    """A mover's straight path on the floor."""

    start: FloatArray
    end: FloatArray
    heading_deg: float


def side_by_side(
    leader: Mover, count: int, spacing_m: float = 0.75, stagger_m: float = 0.0
) -> tuple[Mover, ...]:
    """A group that walks abreast, each stagger_m behind the previous one; heights and textures differ."""
    course = math.radians(leader.course_deg)
    c, s = math.cos(course), math.sin(course)
    textures: tuple[Texture, ...] = ("fine", "coarse", "fine")
    return tuple(
        replace(
            leader,
            ahead_m=leader.ahead_m + index * (spacing_m * abs(s) - stagger_m * c),
            left_m=leader.left_m + index * (spacing_m * abs(c) - stagger_m * s),
            height_m=leader.height_m - 0.08 * index,
            texture=textures[index % len(textures)],
        )
        for index in range(count)
    )


def build(
    name: str,
    place: Literal["hall", "aisle", "workshop"],
    drive: ScriptedDrive,
    movers: Sequence[Mover],
    duration_s: float,
    seed: int,
) -> Scenario:
    """A scene with the movers, and clutter off their paths and the robot's."""
    generator = np.random.default_rng((seed, 7))
    mover_paths = [_mover_path(mover, drive, duration_s) for mover in movers]
    bodies: list[BodySpec] = [
        _mover_body(index, mover, mover_path)
        for index, (mover, mover_path) in enumerate(zip(movers, mover_paths, strict=True))
    ]
    course = np.array([_point(drive.pose(t_s), 0.0, 0.0) for t_s in np.linspace(0.0, duration_s, 17)])
    room, fixed, clutter = _PLACES[place](generator, course)
    bodies.extend(fixed)
    for body in clutter:
        middle = np.array([body.x_m, body.y_m])
        radius = _radius_m(body)
        free = all(
            _distance_m(middle, mover_path) > _MOVER_CLEARANCE_M + radius for mover_path in mover_paths
        )
        if free and np.hypot(*(course - middle).T).min() > _ROBOT_CLEARANCE_M + radius:
            bodies.append(body)
    return Scenario(
        name=name,
        path=PathSpec(segments=(LineSpec(kind="line", length_m=10.0),)),
        room=room,
        light=Light(
            ambient=float(generator.uniform(0.45, 0.65)), azimuth_deg=float(generator.uniform(0.0, 360.0))
        ),
        bodies=tuple(bodies),
    )


def _point(pose: PlanarPose, ahead_m: float, left_m: float) -> FloatArray:
    c, s = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    return np.array([pose.x_m + ahead_m * c - left_m * s, pose.y_m + ahead_m * s + left_m * c])


def _mover_path(mover: Mover, drive: ScriptedDrive, duration_s: float) -> _MoverPath:
    pose = drive.pose(mover.at_s)
    through = _point(pose, mover.ahead_m, mover.left_m)
    heading = pose.heading_rad + math.radians(mover.course_deg)
    along = np.array([math.cos(heading), math.sin(heading)])
    starts_s = 0.0 if mover.starts_s is None else mover.starts_s
    ends_s = duration_s + 1.0 if mover.stops_s is None else mover.stops_s
    start = through - along * mover.speed_mps * (mover.at_s - starts_s)
    return _MoverPath(start, start + along * mover.speed_mps * (ends_s - starts_s), math.degrees(heading))


def _mover_body(index: int, mover: Mover, mover_path: _MoverPath) -> BodySpec:
    gradual = mover.starts_s is not None or mover.stops_s is not None
    motion = MotionPlan(
        start_s=0.0 if mover.starts_s is None else mover.starts_s,
        accel_mps2=1.5 if gradual else _INSTANT_MPS2,
        steps=(
            Go(
                kind="go",
                x_m=float(mover_path.end[0]),
                y_m=float(mover_path.end[1]),
                speed_mps=mover.speed_mps,
            ),
        ),
    )
    heading_deg = math.remainder(mover_path.heading_deg, 360.0)
    name, x_m, y_m = f"{mover.kind} {index + 1}", float(mover_path.start[0]), float(mover_path.start[1])
    if mover.kind == "person":
        return Person(
            kind="person", name=name, x_m=x_m, y_m=y_m, heading_deg=heading_deg,
            texture=mover.texture, motion=motion, height_m=mover.height_m,
        )  # fmt: skip
    if mover.kind == "robot":
        return RobotBody(
            kind="robot", name=name, x_m=x_m, y_m=y_m, heading_deg=heading_deg,
            texture=mover.texture, motion=motion, load_height_m=mover.load_m,
        )  # fmt: skip
    return Crate(
        kind="crate", name=name, x_m=x_m, y_m=y_m, heading_deg=heading_deg, texture=mover.texture,
        motion=motion, length_m=0.8, width_m=0.6, height_m=0.95,
    )  # fmt: skip


def _distance_m(point: FloatArray, mover_path: _MoverPath) -> float:
    """Distance of a point from a path."""
    along = mover_path.end - mover_path.start
    fraction = float(np.clip((point - mover_path.start) @ along / max(float(along @ along), 1e-9), 0.0, 1.0))
    return float(np.hypot(*(point - mover_path.start - fraction * along)))


def _radius_m(body: BodySpec) -> float:
    """Radius of the circle around its footprint."""
    match body:
        case Column() | Pole():
            return 0.5 * body.diameter_m
        case Person():
            return 0.35
        case _:
            return 0.5 * math.hypot(body.length_m, body.width_m)


def _bounds(course: FloatArray, margin_m: float) -> tuple[float, float, float, float]:
    low, high = course.min(axis=0) - margin_m, course.max(axis=0) + margin_m
    return float(low[0]), float(high[0]), float(low[1]), float(high[1])


Place = tuple[Room, list[BodySpec], list[BodySpec]]


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


_PLACES = {"hall": _hall, "aisle": _aisle, "workshop": _workshop}


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
