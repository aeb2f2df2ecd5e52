"""Textures of floors, walls, the roof, pillars, racks and markings."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from hal.types import ColourImage
from sim.models.paint import PAINTS, Painter, Variant, finish, noise, surface


def concrete(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """A worn warehouse floor, 4 m square, with joints, scuffs and small stains."""
    size = 1024
    base = surface(
        generator, size, size, (128, 132, 134), (300, 4.0), (110, 3.5), (30, 2.0), (8, 2.0), (2, 2.5)
    )
    base -= cv2.GaussianBlur(_marks(generator, size), (0, 0), 1.7)[:, :, None]
    base[:2] *= 0.6
    base[:, :2] *= 0.6
    return finish(base)


def _marks(generator: np.random.Generator, size: int) -> NDArray[np.float32]:
    """How much darker scuffs of wheels and small stains make the floor."""
    marks = np.zeros((size, size), np.float32)
    for _ in range(16):
        u, v = (int(c) for c in generator.integers(0, size, 2))
        angle, length = generator.normal(0.0, 0.35), generator.uniform(60, 420)
        points = [
            (int(u + s * length * np.cos(angle)), int(v + s * length * np.sin(angle) + 14 * s * s))
            for s in np.linspace(0.0, 1.0, 9)
        ]
        darker = float(generator.uniform(6, 20))
        cv2.polylines(marks, [np.array(points)], False, darker, int(generator.integers(1, 7)), cv2.LINE_8)
    for _ in range(40):
        centre = tuple(int(c) for c in generator.integers(20, size - 20, 2))
        axes = (int(generator.integers(2, 14)), int(generator.integers(2, 10)))
        darker, turn = float(generator.uniform(-12, 22)), float(generator.uniform(0, 180))
        cv2.ellipse(marks, centre, axes, turn, 0, 360, darker, -1, cv2.LINE_8)
    return marks


def smooth_floor(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """A coated floor with hardly any texture to track."""
    return finish(surface(generator, 512, 512, (132, 134, 134), (200, 3.0), (60, 1.5)))


def patchy_floor(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """Concrete repaired in large patches."""
    image = surface(generator, 512, 512, (128, 132, 134), (200, 3.0), (30, 2.0), (2, 1.5))
    for _ in range(7):
        u, v = (int(c) for c in generator.integers(0, 400, 2))
        wide, tall = (int(c) for c in generator.integers(50, 200, 2))
        image[v : v + tall, u : u + wide] += generator.uniform(-18, 14)
    return finish(image)


def painted_wall(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """Cladding, 4 m wide: a light upper part, a grey lower band, joints."""
    height, width = 480, 320
    image = surface(generator, height, width, (196, 202, 204), (120, 3.0), (20, 1.0))
    image[int(0.76 * height) :] *= 0.74
    for u in range(0, width, 80):
        image[:, u : u + 2] *= 0.82
    image[int(0.76 * height) : int(0.76 * height) + 3] *= 0.8
    return finish(image)


def bricks(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """A brick wall."""
    image = surface(generator, 240, 480, (150, 160, 165), (8, 3.0))
    for row in range(12):
        for column in range(-1, 8):
            u = column * 60 + (30 if row % 2 else 0)
            tone = np.array((72, 88, 150), np.float32) * generator.uniform(0.8, 1.15)
            patch = image[row * 20 + 2 : row * 20 + 19, max(u + 2, 0) : max(u + 58, 0)]
            patch[...] = 0.25 * patch + 0.75 * tone
    image += 4.0 * noise(generator, 240, 480, 3)[:, :, None]
    return finish(image)


def roof(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """The ceiling from below, 4 m square: sheet metal, a girder, a row of lamps."""
    image = surface(generator, 256, 256, (110, 112, 112), (90, 3.0))
    image[:, ::16] *= 0.9
    image[:18] *= 0.6
    image[110:124, 60:196] = (250, 250, 246)
    return finish(cv2.GaussianBlur(image, (0, 0), 0.8).astype(np.float32))


def concrete_post(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """A pillar: rough concrete with a warning band near the floor."""
    image = surface(generator, 512, 256, (150, 154, 156), (80, 6.0), (16, 4.0), (4, 5.0), (2, 3.0))
    v, u = np.mgrid[0:90, 0:256]
    band = (((u + v) // 32) % 2)[:, :, None]
    image[410:500] = np.where(band == 0, np.array(PAINTS["yellow"]), np.array(PAINTS["black"]))
    return finish(image)


def post(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """A rack's blue post with its rows of holes, floor to top."""
    image = surface(generator, 640, 24, PAINTS["blue"], (20, 3.0))
    for v in range(6, 640, 16):
        image[v : v + 5, 9:15] *= 0.35
    return finish(image)


def stripes(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """Yellow and black warning stripes."""
    v, u = np.mgrid[0:128, 0:128]
    band = (((u + v) // 32) % 2)[:, :, None]
    image = np.where(band == 0, np.array(PAINTS["yellow"]), np.array(PAINTS["black"])).astype(np.float32)
    return finish(cv2.GaussianBlur(image, (0, 0), 1.0).astype(np.float32))


def tape(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """A marking on the floor, 2 m of it, worn by wheels."""
    image = surface(generator, 32, 512, PAINTS[variant[0]], (20, 4.0), (3, 2.0))
    worn = noise(generator, 32, 512, 6) + 0.8 * noise(generator, 32, 512, 40)
    image[worn > 2.2] = np.array((128, 134, 136), np.float32)
    return finish(cv2.GaussianBlur(image, (0, 0), 0.7).astype(np.float32))


PAINTERS: dict[str, Painter] = {
    "concrete": concrete,
    "smooth-floor": smooth_floor,
    "patchy-floor": patchy_floor,
    "painted-wall": painted_wall,
    "bricks": bricks,
    "roof": roof,
    "concrete-post": concrete_post,
    "post": post,
    "stripes": stripes,
    "tape": tape,
}
