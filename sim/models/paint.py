"""Common parts of all textures: colours, smooth noise, and rounding to bytes."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from hal.types import ColourImage

Bgr = tuple[float, float, float]
Variant = tuple[str, ...]
Painter = Callable[[np.random.Generator, Variant], ColourImage]

PAINTS: dict[str, Bgr] = {
    "grey": (150, 150, 150),
    "white": (215, 218, 220),
    "blue": (150, 95, 45),
    "orange": (45, 115, 225),
    "yellow": (50, 190, 230),
    "red": (55, 55, 190),
    "green": (80, 130, 70),
    "dark": (58, 56, 55),
    "black": (30, 30, 30),
    "steel": (165, 168, 165),
    "skin": (125, 155, 200),
}


def noise(generator: np.random.Generator, height: int, width: int, cell_px: float) -> NDArray[np.float32]:
    """Smooth noise of unit standard deviation with blobs of about cell_px; it tiles seamlessly."""
    rows, columns = max(2, round(height / cell_px)), max(2, round(width / cell_px))
    grid = generator.standard_normal((rows, columns)).astype(np.float32)
    pad = 2
    padded = np.pad(grid, pad, mode="wrap")
    scale_v, scale_u = height / rows, width / columns
    size = (round((columns + 2 * pad) * scale_u), round((rows + 2 * pad) * scale_v))
    smooth = np.asarray(cv2.resize(padded, size, interpolation=cv2.INTER_CUBIC))
    top, left = round(pad * scale_v), round(pad * scale_u)
    cut = smooth[top : top + height, left : left + width]
    return np.asarray((cut - cut.mean()) / max(float(cut.std()), 1e-6), dtype=np.float32)


def surface(
    generator: np.random.Generator, height: int, width: int, colour: Bgr, *layers: tuple[float, float]
) -> NDArray[np.float32]:
    """An even colour with layers of noise, each (blob size in px, strength in grey levels)."""
    grey = np.zeros((height, width), np.float32)
    for cell_px, strength in layers:
        grey += strength * noise(generator, height, width, cell_px)
    return grey[:, :, None] + np.array(colour, np.float32)


def finish(image: NDArray[np.float32]) -> ColourImage:
    """The image, rounded to bytes."""
    return np.asarray(np.clip(image + 0.5, 0, 255), dtype=np.uint8)
