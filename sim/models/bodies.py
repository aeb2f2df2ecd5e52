"""The faces of each kind of body of a scenario. Its footprint and heights: outlines.py."""

from __future__ import annotations

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
from hal.types import Pose
from sim.models.mesh import Faces, box, join, prism
from sim.models.outlines import POLE_SIDES
from sim.models.person import build_person, pose_person
from sim.models.rack import build_rack
from sim.models.vehicle import build_robot
from sim.motion import MotionState

Articulation = Callable[[MotionState], tuple[Pose, ...]]


@dataclass(frozen=True, slots=True, eq=False)
class BodyModel:
    """The faces of one body.

    parts: faces, each in the part's own frame.
    pose_parts: the pose of every part in the body frame, in a state of motion.
    """

    parts: tuple[Faces, ...]
    pose_parts: Articulation


def build_body(spec: BodySpec, seed: int) -> BodyModel:
    """The model of one body. The seed and the body's name pick the variants of its textures."""
    generator = np.random.default_rng((seed, zlib.crc32(spec.name.encode())))
    pick = int(generator.integers(6))
    match spec:
        case Person():
            return BodyModel(build_person(spec, generator), partial(pose_person, spec))
        case RobotBody():
            return BodyModel(*build_robot(spec, pick))
        case Crate():
            return _solid(_cuboid(spec, _crate_texture(spec.texture, pick)))
        case Shelf():
            return _solid(build_rack(spec, generator))
        case Column():
            return _solid(_tube(spec, spec.sides, _column_texture(spec.texture)))
        case Pole():
            return _solid(_tube(spec, POLE_SIDES, _pole_texture(spec.texture)))
        case Pallet():
            return _solid(_pallet(spec, pick))
        case Wall():
            return _solid(_cuboid(spec, _wall_texture(spec.texture)))
        case Beam():
            return _solid(_cuboid(spec, _beam_texture(spec.texture)))


def _solid(faces: Faces) -> BodyModel:
    """A body of one part, which does not move in the body frame."""
    still = (Pose(np.eye(3), np.zeros(3)),)
    return BodyModel((faces,), lambda _: still)


def _cuboid(spec: Crate | Wall | Beam, texture: str | dict[str, str]) -> Faces:
    return box((spec.length_m, spec.width_m, spec.height_m), texture, (0.0, 0.0, spec.z_m))


def _tube(spec: Column | Pole, sides: int, texture: str) -> Faces:
    radius = 0.5 * spec.diameter_m
    cap = "plain/steel" if sides % 2 == 0 else None
    return prism(sides, (radius, radius), (spec.z_m, spec.z_m + spec.height_m), texture, cap=cap)


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
