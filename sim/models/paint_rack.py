"""The texture of a rack with goods in it, painted on one plane."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from hal.types import ColourImage
from sim.models.paint import PAINTS, Variant, finish, surface

_PX_PER_M = 200  # a texel is 5 mm, the camera's pixel at 2 to 3 m
_BOARD_PX = 14  # thickness of a level

Draw = Callable[[str], ColourImage]


def facade(generator: np.random.Generator, variant: Variant, draw: Draw) -> ColourImage:
    """A rack seen from the aisle. variant: (number, LxH in m, bay in m, levels). draw: gives other textures
    by key."""
    length_m, height_m = (float(part) for part in variant[1].split("x"))
    bay_m, levels = float(variant[2]), int(variant[3])
    height, width = round(height_m * _PX_PER_M), round(length_m * _PX_PER_M)
    image = surface(generator, height, width, (34, 36, 38), (60, 3.0))
    level_px = height / levels
    for level in range(levels):
        ground = round((level + 1) * level_px) - _BOARD_PX
        _fill_level(generator, image, ground, level_px, draw)
        image[ground : ground + _BOARD_PX] = np.array(PAINTS["dark"], np.float32)
        # The level above shades the upper part of the goods.
        top = max(ground - round(level_px) + _BOARD_PX, 0)
        fade = np.linspace(0.5, 1.0, round(0.5 * level_px), dtype=np.float32)[:, None, None]
        shaded = image[top : top + len(fade)]
        shaded *= fade[: len(shaded)]
    for u in np.arange(0.0, width, bay_m * _PX_PER_M):
        image[:, max(0, int(u) - 4) : int(u) + 4] *= 0.5
    return finish(image)


def _fill_level(
    generator: np.random.Generator, image: NDArray[np.float32], ground: int, level_px: float, draw: Draw
) -> None:
    """Goods side by side on one level, with most places taken."""
    end, u = image.shape[1] - 12.0, 12.0
    while u < end - 48:
        wide = round(min(float(generator.uniform(0.35, 1.1)) * _PX_PER_M, end - u))
        tall = round(float(generator.uniform(0.45, 0.88)) * level_px)
        if generator.random() < 0.88 and wide > 30:
            patch = _pile(generator, wide, tall, draw)
            image[ground - len(patch) : ground, round(u) : round(u) + patch.shape[1]] = patch
        u += wide + float(generator.uniform(2, 26))


def _pile(generator: np.random.Generator, wide: int, tall: int, draw: Draw) -> NDArray[np.float32]:
    """Equal boxes side by side and stacked, at most wide x tall pixels together."""
    kind, stacked, shade = generator.random(), generator.random(), generator.uniform(0.72, 0.95)
    key = f"cardboard/{generator.integers(9)}"
    if kind > 0.85:
        key = f"coarse/{generator.choice(['blue', 'grey', 'green', 'white', 'red'])}"
    elif kind > 0.7:
        key = "wood"
    across, up = max(1, round(wide / (0.9 * tall))), 2 if tall > 110 and stacked < 0.5 else 1
    box = cv2.resize(draw(key), (max(2, wide // across), max(2, tall // up)), interpolation=cv2.INTER_AREA)
    pile: NDArray[np.float32] = np.tile(box, (up, across, 1)).astype(np.float32) * np.float32(shade)
    return pile
