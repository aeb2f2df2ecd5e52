"""The model of each kind of body of a scenario: its faces, and the footprint that counts for contact."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

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
    Texture,
    Wall,
)
from hal.types import FloatArray, Pose
from sim.models.mesh import Faces, box, join, prism
from sim.models.person import build_person, person_footprint, pose_person
from sim.models.rack import build_rack
from sim.models.vehicle import SENSOR_HEIGHT_M, build_robot
from sim.motion import MotionState

Articulation = Callable[[MotionState], tuple[Pose, ...]]
Outline = Callable[[MotionState], FloatArray]


@dataclass(frozen=True, slots=True, eq=False)
class BodyModel:
    """The model of one body. pose_parts and footprint depend on the state of motion.

    parts: faces, each in the part's own frame.
    z_m: lowest and highest point.
    pose_parts: the pose of every part in the body frame.
    footprint: the outline that counts for contact, a convex polygon (K, 2), counter-clockwise, in the body
        frame.
    """

    parts: tuple[Faces, ...]
    z_m: tuple[float, float]
    pose_parts: Articulation
    footprint: Outline


def rectangle(length_m: float, width_m: float) -> FloatArray:
    """The corners (4, 2) of a rectangle around the origin, counter-clockwise, length along x."""
    x, y = 0.5 * length_m, 0.5 * width_m
    return np.array([[x, -y], [x, y], [-x, y], [-x, -y]])


def regular_polygon(sides: int, radius_m: float) -> FloatArray:
    """Corners (sides, 2) on a circle around the origin, counter-clockwise, as in sim.models.mesh.prism."""
    angles = (np.arange(sides) + 0.5) * (2.0 * math.pi / sides)
    return np.stack([radius_m * np.cos(angles), radius_m * np.sin(angles)], axis=1)


def build_body(spec: BodySpec, seed: int) -> BodyModel:
    """The model of one body. The seed and the body's name pick the variants of its textures."""
    generator = np.random.default_rng((seed, zlib.crc32(spec.name.encode())))
    pick = int(generator.integers(6))
    match spec:
        case Crate():
            size = (spec.length_m, spec.width_m, spec.height_m)
            faces = box(size, _crate_texture(spec.texture, pick), (0.0, 0.0, spec.z_m))
            return _solid(faces, rectangle(spec.length_m, spec.width_m), spec.z_m, spec.height_m)
        case Shelf():
            size = (spec.length_m, spec.width_m, spec.height_m)
            faces = build_rack(spec, generator)
            return _solid(faces, rectangle(spec.length_m, spec.width_m), spec.z_m, spec.height_m)
        case Column():
            return _tube(spec, spec.sides, _column_texture(spec.texture))
        case Pole():
            return _tube(spec, 8, _pole_texture(spec.texture))
        case Pallet():
            height = spec.height_m + spec.load_height_m
            return _solid(_pallet(spec, pick), rectangle(spec.length_m, spec.width_m), spec.z_m, height)
        case Wall():
            size = (spec.length_m, spec.width_m, spec.height_m)
            faces = box(size, _wall_texture(spec.texture), (0.0, 0.0, spec.z_m))
            return _solid(faces, rectangle(spec.length_m, spec.width_m), spec.z_m, spec.height_m)
        case Beam():
            size = (spec.length_m, spec.width_m, spec.height_m)
            faces = box(size, _beam_texture(spec.texture), (0.0, 0.0, spec.z_m))
            return _solid(faces, rectangle(spec.length_m, spec.width_m), spec.z_m, spec.height_m)
        case Person():
            return BodyModel(
                parts=build_person(spec, generator),
                z_m=(spec.z_m, spec.z_m + spec.height_m),
                pose_parts=partial(pose_person, spec),
                footprint=partial(person_footprint, spec),
            )
        case RobotBody():
            parts, articulation = build_robot(spec, pick)
            top = spec.z_m + spec.height_m + max(spec.load_height_m, SENSOR_HEIGHT_M)
            outline = rectangle(spec.length_m, spec.width_m)
            return BodyModel(parts, (spec.z_m, top), articulation, lambda _: outline)


def _solid(faces: Faces, footprint_m: FloatArray, z_m: float, height_m: float) -> BodyModel:
    still = (Pose(np.eye(3), np.zeros(3)),)
    return BodyModel((faces,), (z_m, z_m + height_m), lambda _: still, lambda _: footprint_m)


def _tube(spec: Column | Pole, sides: int, texture: str) -> BodyModel:
    radius = 0.5 * spec.diameter_m
    z_m = (spec.z_m, spec.z_m + spec.height_m)
    cap = "plain/steel" if sides % 2 == 0 else None
    faces = prism(sides, (radius, radius), z_m, texture, cap=cap)
    return _solid(faces, regular_polygon(sides, radius), spec.z_m, spec.height_m)


def _pallet(spec: Pallet, pick: int) -> Faces:
    deck = box(
        (spec.length_m, spec.width_m, spec.height_m),
        {"side": "pallet", "all": "wood"} if spec.texture != "plain" else "plain/grey",
        (0.0, 0.0, spec.z_m),
    )
    if spec.load_height_m == 0.0:
        return deck
    load = box(
        (0.96 * spec.length_m, 0.94 * spec.width_m, spec.load_height_m),
        _crate_texture(spec.texture, pick),
        (0.0, 0.0, spec.z_m + spec.height_m),
    )
    return join([deck, load])


def _crate_texture(texture: Texture, pick: int) -> str | dict[str, str]:
    if texture == "fine":
        return {
            "front": f"cardboard/{pick}", "back": f"cardboard/{pick + 1}", "left": f"cardboard/{pick + 2}",
            "right": f"cardboard/{pick + 3}", "all": f"cardboard/{pick + 4}",
        }  # fmt: skip
    return "wood" if texture == "coarse" else "plain/grey"


def _column_texture(texture: Texture) -> str:
    return {"fine": "concrete-post", "coarse": "stripes", "plain": "plain/white"}[texture]


def _pole_texture(texture: Texture) -> str:
    return {"fine": "wheel", "coarse": "stripes", "plain": "plain/steel"}[texture]


def _wall_texture(texture: Texture) -> str:
    return {"fine": "bricks", "coarse": "painted-wall", "plain": "plain/white"}[texture]


def _beam_texture(texture: Texture) -> str:
    return {"fine": "wood", "coarse": "stripes", "plain": "plain/orange"}[texture]
