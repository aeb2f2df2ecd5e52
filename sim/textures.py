"""Procedural textures, the same for the same key and seed, and their smaller versions.

A key is ``kind`` or ``kind/variant``; what a variant means is up to the kind (a number that picks another
drawing, or sizes such as ``facade/1/5.40x3.20/2.70/3``).
"""

from __future__ import annotations

import zlib
from collections.abc import Callable

import cv2
import numpy as np

from hal.types import ColourImage
from sim import paint

Painter = Callable[[np.random.Generator, tuple[str, ...]], ColourImage]

# Two steps of the pyramid halve a side: fine enough that a change of step is not seen.
STEPS_PER_OCTAVE = 2


class TextureStore:
    """Textures by key, each drawn once, and shrunk by any pair of steps along u and v when asked for.

    Shrinking each axis by itself keeps a floor seen at a shallow angle sharp across and calm along.
    """

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._shrunk: dict[tuple[str, int, int], ColourImage] = {}

    def base(self, key: str) -> ColourImage:
        """The texture itself, (H, W, 3) uint8, BGR. Raises KeyError for a kind that nobody paints."""
        return self.shrunk(key, 0, 0)

    def shrunk(self, key: str, step_u: int, step_v: int) -> ColourImage:
        """The texture with its width divided by 2**(step_u / 2) and its height by 2**(step_v / 2)."""
        image = self._shrunk.get((key, step_u, step_v))
        if image is None:
            image = self._draw(key) if step_u == step_v == 0 else self._shrink(key, step_u, step_v)
            self._shrunk[(key, step_u, step_v)] = image
        return image

    def _draw(self, key: str) -> ColourImage:
        kind, *variant = key.split("/")
        generator = np.random.default_rng((self._seed, zlib.crc32(key.encode())))
        return paint.PAINTERS[kind](generator, tuple(variant))

    def _shrink(self, key: str, step_u: int, step_v: int) -> ColourImage:
        image = self.base(key)
        height, width = image.shape[:2]
        size = (
            max(1, round(width / 2.0 ** (step_u / STEPS_PER_OCTAVE))),
            max(1, round(height / 2.0 ** (step_v / STEPS_PER_OCTAVE))),
        )
        # An area mean needs no anti-aliasing filter in front of it.
        shrunk: ColourImage = np.asarray(
            cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8
        )
        return shrunk
