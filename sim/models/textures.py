"""Procedural textures, always the same for the same key and seed, and their smaller versions.

A key is ``kind`` or ``kind/variant``. The meaning of the variant depends on the kind: a number that picks
another drawing, or sizes such as ``facade/1/5.40x3.20/2.70/3``.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from functools import lru_cache, partial

import cv2
import numpy as np
from numpy.typing import NDArray

from hal.types import ColourImage, FloatArray
from sim.models import paint_building, paint_goods, paint_movers
from sim.models.paint import Painter
from sim.models.paint_rack import facade

# Two steps of the pyramid halve a side, which is fine enough that a change of the step is not visible.
STEPS_PER_OCTAVE = 2


_PAINTERS: dict[str, Painter] = {
    **paint_goods.PAINTERS,
    **paint_building.PAINTERS,
    **paint_movers.PAINTERS,
}


@lru_cache(maxsize=256)
def draw(seed: int, key: str) -> ColourImage:
    """The texture of a key, (H, W, 3) uint8, BGR, read-only. Raises KeyError for an unknown kind."""
    kind, *variant = key.split("/")
    generator = np.random.default_rng((seed, zlib.crc32(key.encode())))
    if kind == "facade":
        image = facade(generator, tuple(variant), partial(draw, seed))
    else:
        image = _PAINTERS[kind](generator, tuple(variant))
    image.setflags(write=False)
    return image


@dataclass(frozen=True, slots=True, eq=False)
class Sheet:
    """A texture ready for warping.

    image: (H, W, 4) uint8, whole tiles with a rim of one texel around them.
    texture_to_pixel: (3, 3), from texture coordinates (a tile is 1 wide and 1 high) to pixels of image.
    """

    image: NDArray[np.uint8]
    texture_to_pixel: FloatArray


class TextureStore:
    """Textures by key, each drawn once; shrunk by any pair of steps along u and v, and tiled, on demand.

    Each axis is shrunk by itself, so that a floor seen at a shallow angle stays sharp across the view and
    does not alias along it.
    """

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._sheets: dict[tuple[str, int, int, int, int], Sheet] = {}

    def base(self, key: str) -> ColourImage:
        """The texture at full size, (H, W, 3) uint8, BGR, read-only. Raises KeyError for an unknown kind."""
        return draw(self._seed, key)

    def size(self, key: str) -> tuple[int, int]:
        """Width and height of the texture at full size."""
        height, width = self.base(key).shape[:2]
        return width, height

    def sheet(self, key: str, step_u: int, step_v: int, tiles_u: int, tiles_v: int) -> Sheet:
        """tiles_u x tiles_v copies, shrunk by 2**(step_u / 2) along u and by 2**(step_v / 2) along v."""
        cache_key = (key, step_u, step_v, tiles_u, tiles_v)
        sheet = self._sheets.get(cache_key)
        if sheet is None:
            sheet = self._sheets[cache_key] = self._make_sheet(*cache_key)
        return sheet

    def _make_sheet(self, key: str, step_u: int, step_v: int, tiles_u: int, tiles_v: int) -> Sheet:
        if tiles_u > 1 or tiles_v > 1:
            tile = self.sheet(key, step_u, step_v, 1, 1).image[1:-1, 1:-1]
            # Several tiles are part of a pattern that continues; a single tile ends at the edge of its face.
            return _sheet(np.tile(tile, (tiles_v, tiles_u, 1)), cv2.BORDER_WRAP, tile.shape)
        if step_u == step_v == 0:
            tile = np.asarray(cv2.cvtColor(self.base(key), cv2.COLOR_BGR2BGRA), dtype=np.uint8)
        else:
            tile = self._shrunk(key, step_u, step_v)
        return _sheet(tile, cv2.BORDER_REPLICATE, tile.shape)

    def _shrunk(self, key: str, step_u: int, step_v: int) -> NDArray[np.uint8]:
        """Shrink the nearest larger sheet at whole octaves, which is small already."""
        octave = STEPS_PER_OCTAVE
        whole_u, whole_v = step_u - step_u % octave, step_v - step_v % octave
        if (whole_u, whole_v) == (step_u, step_v):
            if step_v > 0:
                whole_v -= octave
            else:
                whole_u -= octave
        width, height = self.size(key)
        size = (
            max(1, round(width / 2.0 ** (step_u / octave))),
            max(1, round(height / 2.0 ** (step_v / octave))),
        )
        # A mean over the area needs no anti-aliasing filter before it.
        larger = self.sheet(key, whole_u, whole_v, 1, 1).image[1:-1, 1:-1]
        return np.asarray(cv2.resize(larger, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _sheet(image: NDArray[np.uint8], border: int, tile_shape: tuple[int, ...]) -> Sheet:
    rimmed = np.asarray(cv2.copyMakeBorder(image, 1, 1, 1, 1, border), dtype=np.uint8)
    height, width = tile_shape[:2]
    return Sheet(rimmed, np.array([[width, 0.0, 0.5], [0.0, height, 0.5], [0.0, 0.0, 1.0]]))


class TexelPool:
    """Sheets of one tile each, concatenated in one array of texels, so that many can be sampled at once."""

    def __init__(self, textures: TextureStore) -> None:
        self._textures = textures
        self._places: dict[tuple[str, int, int], tuple[int, int, int]] = {}
        self._used = 0
        # Four channels in one number: indexing these is many times faster than indexing rows of four.
        self.texels: NDArray[np.uint32] = np.zeros(1 << 16, np.uint32)

    def place(self, key: str, step_u: int, step_v: int) -> tuple[int, int, int]:
        """Where a sheet begins in texels, and its width and height with the rim."""
        cache_key = (key, step_u, step_v)
        place = self._places.get(cache_key)
        if place is None:
            place = self._places[cache_key] = self._add(self._textures.sheet(key, step_u, step_v, 1, 1).image)
        return place

    def _add(self, image: NDArray[np.uint8]) -> tuple[int, int, int]:
        height, width = image.shape[:2]
        begin, self._used = self._used, self._used + height * width
        if self._used > len(self.texels):
            grown = np.zeros(2 * self._used, np.uint32)
            grown[:begin] = self.texels[:begin]
            self.texels = grown
        self.texels[begin : self._used] = np.ascontiguousarray(image).view(np.uint32).reshape(-1)
        return begin, width, height
