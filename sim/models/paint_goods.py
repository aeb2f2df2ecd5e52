"""Textures of crates, cartons, pallets and paint."""

from __future__ import annotations

import cv2
import numpy as np

from hal.types import ColourImage
from sim.models.paint import PAINTS, Bgr, Painter, Variant, finish, noise, surface

CARDBOARD: tuple[Bgr, ...] = ((105, 145, 180), (120, 160, 196), (90, 128, 162), (140, 172, 200))


def plain(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """Paint or wrapped plastic: nothing to track."""
    return finish(surface(generator, 64, 64, PAINTS[variant[0]], (32, 0.8)))


def coarse(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """Large patches of two or three colours."""
    colour = PAINTS[variant[0]]
    image = surface(generator, 192, 192, colour, (64, 4.0), (16, 1.5))
    blobs = noise(generator, 192, 192, 70)
    image[blobs > 0.5] *= 0.62
    image[blobs < -0.7] *= 1.25
    return finish(cv2.GaussianBlur(image, (0, 0), 1.0).astype(np.float32))


def cardboard(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """A printed carton: tape, label, bar code, writing."""
    size = 320
    colour = CARDBOARD[int(generator.integers(len(CARDBOARD)))]
    image = surface(generator, size, size, colour, (90, 5.0), (12, 2.0), (3, 1.5))
    image += 2.5 * noise(generator, size, size, 5).mean(axis=0)[None, :, None]
    tape_v = int(size * generator.uniform(0.42, 0.58))
    image[tape_v - 14 : tape_v + 14] = image[tape_v - 14 : tape_v + 14] * 0.88 + 18
    image[tape_v - 1 : tape_v + 1] *= 0.7
    sheet = finish(image)
    _label(generator, sheet)
    ink = tuple(float(c) for c in generator.uniform(20, 70, 3))
    word = str(generator.choice(["FRAGILE", "TOP LOAD", "LOT 4417", "KS-220", "HANDLE", "NETTO 12"]))
    cv2.putText(
        sheet, word, (int(generator.integers(12, 70)), int(generator.choice([52, 296]))),
        cv2.FONT_HERSHEY_SIMPLEX, 1.1, ink, 3, cv2.LINE_AA,
    )  # fmt: skip
    for k in range(2):
        u = int(generator.integers(200, 250)) + 34 * k
        cv2.arrowedLine(sheet, (u, 120), (u, 78), ink, 4, cv2.LINE_AA, tipLength=0.4)
    return _worn_edges(sheet)


def _label(generator: np.random.Generator, sheet: ColourImage) -> None:
    u, v = int(generator.integers(20, 150)), int(generator.integers(185, 215))
    width, height = int(generator.integers(100, 150)), int(generator.integers(60, 80))
    cv2.rectangle(sheet, (u, v), (u + width, v + height), (228, 232, 233), -1)
    for row in range(v + 8, v + height // 2, 7):
        cv2.line(sheet, (u + 6, row), (u + int(generator.integers(40, width - 6)), row), (70, 70, 70), 2)
    bar = u + 8
    while bar < u + width - 8:
        wide = int(generator.integers(1, 4))
        cv2.rectangle(sheet, (bar, v + height // 2 + 4), (bar + wide, v + height - 6), (30, 30, 30), -1)
        bar += wide + int(generator.integers(2, 5))


def _worn_edges(sheet: ColourImage) -> ColourImage:
    height, width = sheet.shape[:2]
    u, v = np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32)
    rim = np.minimum(np.minimum(u, u[::-1])[None, :], np.minimum(v, v[::-1])[:, None])
    worn = np.float32(1.0) - np.float32(0.15) * np.exp(rim / np.float32(-5.0))
    return finish(sheet.astype(np.float32) * worn[:, :, None])


def wood(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """Rough boards, lying along u."""
    height, width, boards = 240, 320, 4
    image = surface(generator, height, width, (115, 160, 190), (60, 6.0))
    for k in range(boards):
        rows = slice(k * height // boards, (k + 1) * height // boards)
        tone = generator.uniform(-18, 18)
        grain = noise(generator, width, height // boards, 4).T
        grain = np.asarray(cv2.GaussianBlur(grain, (0, 0), sigmaX=18, sigmaY=0.8), dtype=np.float32)
        image[rows] += (tone + 9.0 * grain / max(float(grain.std()), 1e-6))[:, :, None]
        image[rows.start : rows.start + 3] *= 0.45
        for u in (12, width - 12):
            cv2.circle(image, (u, rows.start + height // boards // 2), 2, (60, 62, 66), -1)
    return finish(image)


def pallet_side(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """A pallet from the side: boards, blocks and dark gaps."""
    image = surface(generator, 64, 320, (105, 150, 180), (20, 6.0), (4, 4.0))
    for u0, u1 in ((45, 135), (185, 275)):
        image[18:50, u0:u1] *= 0.22
    image[16:18] *= 0.5
    image[50:52] *= 0.5
    return finish(image)


PAINTERS: dict[str, Painter] = {
    "plain": plain,
    "coarse": coarse,
    "cardboard": cardboard,
    "wood": wood,
    "pallet": pallet_side,
}
