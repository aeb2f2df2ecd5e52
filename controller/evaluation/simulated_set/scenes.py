"""The scenes of the simulated set: places with movers relative to the robot, and clutter off their paths."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from config.path import LineSpec, PathSpec
from config.scenario import (
    BodySpec,
    Column,
    Crate,
    Go,
    Light,
    MotionPlan,
    Person,
    Pole,
    RobotBody,
    Scenario,
    Texture,
)
from controller.evaluation.simulated_set.places import PLACES, PlaceName
from controller.evaluation.simulated_set.scripted_drive import ScriptedDrive
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
    place: PlaceName,
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
    room, fixed, clutter = PLACES[place](generator, course)
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
