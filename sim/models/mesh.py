"""Flat four-cornered faces, and the few shapes from which everything is built."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Faces:
    """N planar convex quadrilaterals.

    corners_m: (N, 4, 3), top left, top right, bottom right, bottom left as seen from the outside.
    windows: (N, 4), texture coordinates (u0, v0) of the first and (u1, v1) of the third corner, in units of
        textures; beyond 0..1 the texture repeats.
    textures: N keys of sim.models.textures.
    """

    corners_m: FloatArray
    windows: FloatArray
    textures: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.textures)

    def moved(self, rotation: FloatArray, translation_m: FloatArray) -> Faces:
        """The same faces in an outer frame: rotation (3, 3), translation (3,)."""
        return Faces(self.corners_m @ rotation.T + translation_m, self.windows, self.textures)


def normals(corners_m: FloatArray) -> FloatArray:
    """Outward unit normals (N, 3) of corners (N, 4, 3)."""
    right = corners_m[:, 1] - corners_m[:, 0]
    down = corners_m[:, 3] - corners_m[:, 0]
    outward = np.cross(down, right)
    unit: FloatArray = outward / np.linalg.norm(outward, axis=1, keepdims=True)
    return unit


def join(parts: list[Faces]) -> Faces:
    """All faces of the parts, in order."""
    if not parts:
        return Faces(np.empty((0, 4, 3)), np.empty((0, 4)), ())
    return Faces(
        np.concatenate([part.corners_m for part in parts]),
        np.concatenate([part.windows for part in parts]),
        tuple(key for part in parts for key in part.textures),
    )


def quad(
    corners_m: list[tuple[float, float, float]],
    texture: str,
    window: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0),
) -> Faces:
    """One face from its four corners."""
    return Faces(np.array([corners_m], dtype=np.float64), np.array([window]), (texture,))


def box(
    size_m: tuple[float, float, float],
    textures: str | dict[str, str],
    centre_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
    skip: str = "",
) -> Faces:
    """A box of size (x, y, z). centre_m: the centre of its underside.

    textures: one key, or keys for "front" (+x), "back" (-x), "left" (+y), "right" (-y), "top" and
        "underside", with "side" (the first four) and "all" as fall-backs.
    skip: first letters of faces to leave out ("b" for back, "u" for underside, "f", "l", "r", "t").
    """
    hx, hy = 0.5 * size_m[0], 0.5 * size_m[1]
    cx, cy, z0 = centre_m
    z1 = z0 + size_m[2]
    x0, x1, y0, y1 = cx - hx, cx + hx, cy - hy, cy + hy
    corners = {
        "front": [(x1, y0, z1), (x1, y1, z1), (x1, y1, z0), (x1, y0, z0)],
        "back": [(x0, y1, z1), (x0, y0, z1), (x0, y0, z0), (x0, y1, z0)],
        "left": [(x1, y1, z1), (x0, y1, z1), (x0, y1, z0), (x1, y1, z0)],
        "right": [(x0, y0, z1), (x1, y0, z1), (x1, y0, z0), (x0, y0, z0)],
        "top": [(x0, y0, z1), (x0, y1, z1), (x1, y1, z1), (x1, y0, z1)],
        "underside": [(x1, y0, z0), (x1, y1, z0), (x0, y1, z0), (x0, y0, z0)],
    }
    return join(
        [quad(points, _key_for(side, textures)) for side, points in corners.items() if side[0] not in skip]
    )


def _key_for(side: str, textures: str | dict[str, str]) -> str:
    if isinstance(textures, str):
        return textures
    if side in textures:
        return textures[side]
    if side not in {"top", "underside"} and "side" in textures:
        return textures["side"]
    return textures["all"]


def prism(
    sides: int,
    radii_m: tuple[float, float],
    z_m: tuple[float, float],
    texture: str,
    taper: float = 1.0,
    cap: str | None = None,
) -> Faces:
    """An upright elliptic cylinder with flat sides. The texture goes once around it.

    sides: number of sides; must be even with a cap.
    radii_m: half axes along x and y at the bottom.
    z_m: bottom and top.
    taper: size of the top divided by that of the bottom.
    cap: texture of the top and the underside; None leaves both open.
    """
    angles = (np.arange(sides) + 0.5) * (2.0 * math.pi / sides)
    ring = np.stack([radii_m[0] * np.cos(angles), radii_m[1] * np.sin(angles)], axis=1)
    bottom = np.column_stack([ring, np.full(sides, z_m[0])])
    top = np.column_stack([ring * taper, np.full(sides, z_m[1])])
    following = np.roll(np.arange(sides), -1)
    corners = np.stack([top, top[following], bottom[following], bottom], axis=1)
    steps = np.arange(sides) / sides
    zeros = np.zeros(sides)
    windows = np.column_stack([steps, zeros, steps + 1.0 / sides, zeros + 1.0])
    wall = Faces(corners, windows, (texture,) * sides)
    if cap is None:
        return wall
    return join([wall, _cap(top, cap, upward=True), _cap(bottom, cap, upward=False)])


def _cap(ring: FloatArray, texture: str, upward: bool) -> Faces:
    """A polygon with an even number of corners, divided into strips."""
    count = len(ring)
    strips: list[NDArray[np.float64]] = []
    for k in range(count // 2 - 1):
        left, right = ring[k], ring[k + 1]
        far_left, far_right = ring[count - 1 - k], ring[count - 2 - k]
        strip = [far_left, left, right, far_right] if not upward else [left, far_left, far_right, right]
        strips.append(np.array(strip))
    fraction = np.arange(len(strips)) / len(strips)
    windows = np.column_stack([fraction * 0, fraction, fraction * 0 + 1, fraction + 1.0 / len(strips)])
    return Faces(np.array(strips), windows, (texture,) * len(strips))


def axis_rotation(axis: str, angle_rad: float) -> FloatArray:
    """A rotation (3, 3) about x, y or z, right-handed."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    if axis == "x":
        return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    if axis == "y":
        return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
