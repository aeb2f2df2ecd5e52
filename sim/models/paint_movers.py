"""Textures of clothes, faces, machines and their wheels."""

from __future__ import annotations

import cv2
import numpy as np

from hal.types import ColourImage
from sim.models.paint import PAINTS, Bgr, Painter, Variant, finish, noise, surface


def cloth(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """Trousers and sleeves: folds and weave."""
    colour = {"jeans": (110, 75, 55), "dark": (62, 58, 56), "khaki": (90, 120, 135), "shirt": (140, 110, 90)}
    image = surface(generator, 128, 128, colour[variant[0]], (26, 9.0), (9, 5.0), (2, 4.0))
    return finish(image)


def vest(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """A high-visibility vest, once around the body."""
    colour: Bgr = (50, 225, 205) if variant[0] == "yellow" else (40, 120, 245)
    image = surface(generator, 160, 256, colour, (30, 10.0), (8, 5.0), (2, 3.0))
    for v in (82, 118):
        image[v : v + 14] = np.array((205, 208, 205), np.float32)
    for u in (40, 88, 168, 216):
        image[:82, u - 6 : u + 6] = np.array((200, 204, 200), np.float32)
    image[:, 62:66] *= 0.5
    return finish(cv2.GaussianBlur(image, (0, 0), 0.8).astype(np.float32))


def head(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """Skin with dark hair around and at the back; the face looks along u = 0."""
    image = surface(generator, 64, 128, (125, 155, 200), (20, 4.0))
    u = np.arange(128)
    back = (u > 26) & (u < 102)
    image[:, back] = np.array((35, 42, 52), np.float32)
    image[:18] = np.array((35, 42, 52), np.float32)
    image += 3.0 * noise(generator, 64, 128, 4)[:, :, None]
    for eye in (8, 120):
        image[28:32, eye - 3 : eye + 3] *= 0.35
    return finish(image)


def panel(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """A machine's cover: colour, seam lines, a stripe, vents, stickers."""
    height, width = 160, 320
    image = surface(generator, height, width, PAINTS[variant[0]], (80, 3.0), (3, 1.0))
    image[height // 2 - 10 : height // 2 + 10] = np.array(PAINTS[variant[1]], np.float32)
    sheet = finish(image)
    for u in (80, 240):
        cv2.line(sheet, (u, 0), (u, height), (60, 60, 60), 2)
    for k in range(6):
        cv2.line(sheet, (20, 20 + 7 * k), (66, 20 + 7 * k), (45, 45, 45), 2)
    cv2.rectangle(sheet, (130, 100), (200, 145), (40, 200, 235), -1)
    cv2.putText(sheet, "AGV 07", (96, 48), cv2.FONT_HERSHEY_SIMPLEX, 1.0, (40, 40, 40), 3, cv2.LINE_AA)
    return sheet


def wheel(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """A rubber tyre around, with a tread that shows its turning."""
    image = surface(generator, 32, 256, (38, 38, 38), (6, 3.0))
    image[:, ::16] *= 1.7
    return finish(image)


def hub(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """A wheel's flank: rubber, rim and a mark that shows its turning."""
    image = surface(generator, 64, 64, (40, 40, 40), (8, 2.0))
    cv2.circle(image, (32, 32), 18, (150, 152, 150), -1)
    cv2.circle(image, (32, 32), 6, (60, 60, 60), -1)
    cv2.rectangle(image, (30, 14), (34, 26), (60, 60, 60), -1)
    return finish(image)


PAINTERS: dict[str, Painter] = {
    "cloth": cloth,
    "vest": vest,
    "head": head,
    "panel": panel,
    "wheel": wheel,
    "hub": hub,
}
