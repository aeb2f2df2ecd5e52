"""The simulated camera's picture of a world: colour, exact inverse depth, and which face is where."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from config.scenario import Light
from hal.types import ColourImage, FloatArray, Intrinsics, Pose
from sim.antialias import smooth_edges
from sim.raster import Drawn, Float32Image, LabelImage, Rasteriser
from sim.textures import STEPS_PER_OCTAVE, TextureStore
from sim.world import Geometry, World

# One pyramid step serves a part of a face over which the distance changes by this factor at most.
_DEPTH_RATIO = 1.4
_EMISSIVE = frozenset({"roof"})


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """What one exposure sees. The arrays belong to the renderer: the next render overwrites them.

    colour (H, W, 3) uint8 BGR, without noise. inverse_depth (H, W) float32 in 1/m, exact; 0: nothing.
    labels (H, W) uint16: 0 is nothing, k + 1 the k-th face of drawn.
    """

    colour: ColourImage
    inverse_depth: Float32Image
    labels: LabelImage
    drawn: Drawn
    geometry: Geometry

    def instance_mask(self) -> LabelImage:
        """(H, W) uint16: the id of the body at each pixel (sim.world.BUILDING_ID for the building)."""
        owner = np.concatenate([[0], self.geometry.body[self.drawn.face]]).astype(np.uint16)
        return owner[self.labels]


class Renderer:
    """Draws one world through one pinhole camera; keeps textures and buffers between pictures."""

    def __init__(self, world: World, intrinsics: Intrinsics) -> None:
        self.world = world
        self.intrinsics = intrinsics
        self._raster = Rasteriser(intrinsics)
        self._textures = TextureStore(world.seed)
        shape = (intrinsics.height, intrinsics.width)
        self._colour: ColourImage = np.zeros((*shape, 3), np.uint8)
        self._patch = np.empty(shape[0] * shape[1] * 3, np.uint8)
        self._mask = np.empty(shape[0] * shape[1], np.bool_)
        self._light = _light_direction(world.scenario.light)

    def render(self, t_s: float, camera: Pose) -> Picture:
        """The world at t_s from camera (optical frame in the floor's frame)."""
        geometry = self.world.geometry(t_s)
        drawn = self._raster.draw(geometry, camera)
        gains = self._gains(geometry, drawn)
        for number in range(len(drawn)):
            self._paint(number, drawn, geometry, gains[number])
        smooth_edges(self._colour, self._raster.labels, self._raster.inverse_depth, drawn)
        return Picture(self._colour, self._raster.inverse_depth, self._raster.labels, drawn, geometry)

    def _gains(self, geometry: Geometry, drawn: Drawn) -> list[float]:
        """How bright each face is: an ambient share, and one that depends on its direction."""
        light = self.world.scenario.light
        towards = geometry.normals[drawn.face] @ self._light
        direct = np.maximum(towards, 0.0) + 0.25 * np.maximum(-towards, 0.0)
        gains: list[float] = (light.exposure * (light.ambient + (1.0 - light.ambient) * direct)).tolist()
        return gains

    def _paint(self, number: int, drawn: Drawn, geometry: Geometry, gain: float) -> None:
        """Fill the pixels that show this face, and only the rectangle around them."""
        u0, v0, u1, v1 = drawn.bounds[number].tolist()
        mask = self._mask[: (v1 - v0) * (u1 - u0)].reshape(v1 - v0, u1 - u0)
        np.equal(self._raster.labels[v0:v1, u0:u1], number + 1, out=mask)
        seen = mask.view(np.uint8)
        du, dv, width, height = cv2.boundingRect(seen)
        if width == 0:
            return
        face = int(drawn.face[number])
        key = self.world.textures[int(geometry.texture[face])]
        to_uv = _window_matrix(geometry.windows[face]) @ drawn.to_plane[number]
        for part in _split(drawn.to_plane[number, 2], (u0 + du, v0 + dv, u0 + du + width, v0 + dv + height)):
            left, top, right, bottom = part
            self._paint_part(key, to_uv, part, gain, seen[top - v0 : bottom - v0, left - u0 : right - u0])

    def _paint_part(
        self,
        key: str,
        to_uv: FloatArray,
        part: tuple[int, int, int, int],
        gain: float,
        mask: NDArray[np.uint8],
    ) -> None:
        left, top, right, bottom = part
        steps = _pyramid_steps(to_uv, 0.5 * (left + right - 1), 0.5 * (top + bottom - 1), self._size(key))
        texture = self._textures.shrunk(key, *steps)
        height, width = texture.shape[:2]
        a = to_uv[0] * width - 0.5 * to_uv[2]
        b = to_uv[1] * height - 0.5 * to_uv[2]
        matrix = np.stack([a, b, to_uv[2]])
        matrix[:, 2] += matrix[:, 0] * left + matrix[:, 1] * top
        shape = (bottom - top, right - left, 3)
        patch = self._patch[: shape[0] * shape[1] * 3].reshape(shape)
        cv2.warpPerspective(
            texture, matrix, (shape[1], shape[0]), dst=patch,
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, borderMode=cv2.BORDER_WRAP,
        )  # fmt: skip
        cv2.convertScaleAbs(patch, dst=patch, alpha=gain)
        cv2.copyTo(patch, mask, self._colour[top:bottom, left:right])

    def _size(self, key: str) -> tuple[int, int]:
        height, width = self._textures.base(key).shape[:2]
        return width, height


def _light_direction(light: Light) -> FloatArray:
    """Unit vector towards the light: from above, and somewhat from the side."""
    azimuth = math.radians(light.azimuth_deg)
    direction = np.array([0.62 * math.cos(azimuth), 0.62 * math.sin(azimuth), 0.78])
    unit: FloatArray = direction / np.linalg.norm(direction)
    return unit


def _window_matrix(window: FloatArray) -> FloatArray:
    """From (s, t) on the face to (u, v) in textures."""
    u0, v0, u1, v1 = window
    return np.array([[u1 - u0, 0.0, u0], [0.0, v1 - v0, v0], [0.0, 0.0, 1.0]])


def _split(inverse_depth: FloatArray, bounds: tuple[int, int, int, int]) -> list[tuple[int, int, int, int]]:
    """Cut a rectangle along the direction in which the distance changes most."""
    u0, v0, u1, v1 = bounds
    a, b, c = inverse_depth.tolist()
    along_u = abs(a) * (u1 - u0) > abs(b) * (v1 - v0)
    slope, first, last = (a, u0, u1) if along_u else (b, v0, v1)
    other = b * 0.5 * (v0 + v1) if along_u else a * 0.5 * (u0 + u1)
    near, far = slope * first + other + c, slope * last + other + c
    low, high = max(min(near, far), 1.0 / 60.0), max(near, far, 1.0 / 60.0)
    count = math.ceil(math.log(high / low) / math.log(_DEPTH_RATIO) - 1e-9)
    if count < 2:
        return [bounds]
    steps = [low * (high / low) ** (k / count) for k in range(1, count)]
    cuts = sorted(
        {min(max(round((step - other - c) / slope), first), last) for step in steps} | {first, last}
    )
    pairs = itertools.pairwise(cuts)
    return [(i, v0, j, v1) if along_u else (u0, i, u1, j) for i, j in pairs]


def _pyramid_steps(to_uv: FloatArray, u: float, v: float, size: tuple[int, int]) -> tuple[int, int]:
    """The steps at which one pixel at (u, v) covers about one texel along each axis of the texture."""
    (a0, a1, a2), (b0, b1, b2), (c0, c1, c2) = to_uv.tolist()
    z = 1.0 / max(c0 * u + c1 * v + c2, 1e-6)
    s, t = (a0 * u + a1 * v + a2) * z, (b0 * u + b1 * v + b2) * z
    across = math.hypot(a0 - s * c0, a1 - s * c1) * z * size[0]
    down = math.hypot(b0 - t * c0, b1 - t * c1) * z * size[1]
    return _step(across, size[0]), _step(down, size[1])


def _step(texels: float, size: int) -> int:
    """How often to shrink by the square root of two so that texels become one; never below one texel."""
    wanted = round(STEPS_PER_OCTAVE * math.log2(max(texels, 1.0)))
    return min(wanted, int(STEPS_PER_OCTAVE * math.log2(size)))
