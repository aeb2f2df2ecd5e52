"""What the materials look like: one small function for each, drawing with OpenCV."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from hal.types import ColourImage

Bgr = tuple[float, float, float]
Variant = tuple[str, ...]

CARDBOARD: tuple[Bgr, ...] = ((105, 145, 180), (120, 160, 196), (90, 128, 162), (140, 172, 200))
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
    """Smooth noise of unit standard deviation whose blobs are about cell_px wide; it repeats seamlessly."""
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
    """Rounded to bytes."""
    return np.asarray(np.clip(image + 0.5, 0, 255), dtype=np.uint8)


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
    return _worn_edges(generator, sheet)


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


def _worn_edges(generator: np.random.Generator, sheet: ColourImage) -> ColourImage:
    height, width = sheet.shape[:2]
    rim = np.minimum.reduce(
        [
            np.arange(height)[:, None] + np.zeros(width)[None],
            np.arange(height)[::-1, None] + np.zeros(width)[None],
            np.arange(width)[None] + np.zeros(height)[:, None],
            np.arange(width)[None, ::-1] + np.zeros(height)[:, None],
        ]
    )
    worn = 1.0 - 0.18 * np.exp(-rim / 5.0) * (0.7 + 0.3 * noise(generator, height, width, 14))
    return finish(sheet * worn[:, :, None].astype(np.float32))


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


def concrete(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """A worn warehouse floor, 4 m square, with joints, scuffs and small stains."""
    size = 1024
    base = surface(
        generator, size, size, (128, 132, 134), (300, 4.0), (110, 3.5), (30, 2.0), (8, 2.0), (2, 2.5)
    )
    for _ in range(16):
        _scuff(generator, base)
    for _ in range(40):
        centre = tuple(int(c) for c in generator.integers(20, size - 20, 2))
        shade = np.zeros((size, size), np.float32)
        cv2.ellipse(
            shade, centre, (int(generator.integers(2, 14)), int(generator.integers(2, 10))),
            float(generator.uniform(0, 180)), 0, 360, 1.0, -1, cv2.LINE_8,
        )  # fmt: skip
        window = cv2.GaussianBlur(shade, (0, 0), 2.0)
        base -= (window * generator.uniform(-12, 22))[:, :, None]
    base[:2] *= 0.6
    base[:, :2] *= 0.6
    return finish(base)


def _scuff(generator: np.random.Generator, base: NDArray[np.float32]) -> None:
    size = base.shape[0]
    mark = np.zeros(base.shape[:2], np.float32)
    u, v = (int(c) for c in generator.integers(0, size, 2))
    angle, length = generator.normal(0.0, 0.35), generator.uniform(60, 420)
    points = [
        (int(u + s * length * np.cos(angle)), int(v + s * length * np.sin(angle) + 14 * s * s))
        for s in np.linspace(0.0, 1.0, 9)
    ]
    cv2.polylines(mark, [np.array(points)], False, 1.0, int(generator.integers(1, 7)), cv2.LINE_8)
    streak = cv2.GaussianBlur(mark, (0, 0), 1.6)
    base -= (streak * generator.uniform(6, 20))[:, :, None]


def smooth_floor(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """Coated floor with hardly anything to hold on to."""
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


def roof(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """The ceiling from below, 4 m square: sheet metal, a girder, a row of lamps."""
    image = surface(generator, 256, 256, (110, 112, 112), (90, 3.0))
    image[:, ::16] *= 0.9
    image[:18] *= 0.6
    image[110:124, 60:196] = (250, 250, 246)
    return finish(cv2.GaussianBlur(image, (0, 0), 0.8).astype(np.float32))


def facade(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """Goods standing in a rack, seen from the aisle: variant (number, LxH in m, bay in m, levels)."""
    per_m = 200
    length_m, height_m = (float(part) for part in variant[1].split("x"))
    bay_m, levels = float(variant[2]), int(variant[3])
    height, width = round(height_m * per_m), round(length_m * per_m)
    image = surface(generator, height, width, (34, 36, 38), (60, 3.0))
    level_px, bay_px = height / levels, bay_m * per_m
    for level in range(levels):
        ground = round((level + 1) * level_px) - 14
        u = 12.0
        while u < width - 60:
            wide = min(float(generator.uniform(0.35, 1.1)) * per_m, width - 12 - u)
            tall = float(generator.uniform(0.45, 0.88)) * level_px
            if generator.random() < 0.88 and wide > 30:
                _goods(generator, image, (round(u), round(ground - tall), round(wide), round(tall)))
            u += wide + float(generator.uniform(2, 26))
        image[ground : ground + 14] = np.array(PAINTS["dark"], np.float32)
        # The level above keeps the light off the goods' upper parts.
        top = ground - round(level_px) + 14
        fade = np.linspace(0.5, 1.0, round(0.5 * level_px), dtype=np.float32)[:, None, None]
        stop = max(top, 0) + len(fade)
        image[max(top, 0) : stop] *= fade[: image[max(top, 0) : stop].shape[0]]
    for u in np.arange(0.0, width, bay_px):
        image[:, max(0, int(u) - 4) : int(u) + 4] *= 0.5
    return finish(image)


def _goods(
    generator: np.random.Generator, image: NDArray[np.float32], place: tuple[int, int, int, int]
) -> None:
    u, v, wide, tall = place
    kind = generator.random()
    if kind < 0.7:
        sheet = cardboard(generator, ())
    elif kind < 0.85:
        sheet = wood(generator, ())
    else:
        colour = str(generator.choice(["blue", "grey", "green", "white", "red"]))
        sheet = coarse(generator, (colour,))
    across, up = max(1, round(wide / (0.9 * tall))), 2 if tall > 110 and generator.random() < 0.5 else 1
    tile = cv2.resize(sheet, (max(2, wide // across), max(2, tall // up)), interpolation=cv2.INTER_AREA)
    patch = np.tile(tile, (up, across, 1)).astype(np.float32)
    patch *= np.float32(generator.uniform(0.72, 0.95))
    target = image[v : v + patch.shape[0], u : u + patch.shape[1]]
    target[...] = patch[: target.shape[0], : target.shape[1]]


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


def stripes(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """Yellow and black warning stripes."""
    v, u = np.mgrid[0:128, 0:128]
    band = (((u + v) // 32) % 2)[:, :, None]
    image = np.where(band == 0, np.array(PAINTS["yellow"]), np.array(PAINTS["black"])).astype(np.float32)
    return finish(cv2.GaussianBlur(image, (0, 0), 1.0).astype(np.float32))


def post(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """A rack's blue post with its rows of holes, floor to top."""
    image = surface(generator, 640, 24, PAINTS["blue"], (20, 3.0))
    for v in range(6, 640, 16):
        image[v : v + 5, 9:15] *= 0.35
    return finish(image)


def concrete_post(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """A pillar: rough concrete with a warning band near the floor."""
    image = surface(generator, 512, 256, (150, 154, 156), (80, 6.0), (16, 4.0), (4, 5.0), (2, 3.0))
    v, u = np.mgrid[0:90, 0:256]
    band = (((u + v) // 32) % 2)[:, :, None]
    image[410:500] = np.where(band == 0, np.array(PAINTS["yellow"]), np.array(PAINTS["black"]))
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


def hub(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """A wheel's flank: rubber, rim and a mark that shows its turning."""
    image = surface(generator, 64, 64, (40, 40, 40), (8, 2.0))
    cv2.circle(image, (32, 32), 18, (150, 152, 150), -1)
    cv2.circle(image, (32, 32), 6, (60, 60, 60), -1)
    cv2.rectangle(image, (30, 14), (34, 26), (60, 60, 60), -1)
    return finish(image)


def tape(generator: np.random.Generator, variant: Variant) -> ColourImage:
    """A marking on the floor, 2 m of it, worn by wheels."""
    image = surface(generator, 32, 512, PAINTS[variant[0]], (20, 4.0), (3, 2.0))
    worn = noise(generator, 32, 512, 6) + 0.8 * noise(generator, 32, 512, 40)
    image[worn > 2.2] = np.array((128, 134, 136), np.float32)
    return finish(cv2.GaussianBlur(image, (0, 0), 0.7).astype(np.float32))


PAINTERS: dict[str, Callable[[np.random.Generator, Variant], ColourImage]] = {
    "plain": plain,
    "coarse": coarse,
    "cardboard": cardboard,
    "wood": wood,
    "pallet": pallet_side,
    "concrete": concrete,
    "smooth-floor": smooth_floor,
    "painted-wall": painted_wall,
    "roof": roof,
    "facade": facade,
    "cloth": cloth,
    "vest": vest,
    "head": head,
    "panel": panel,
    "wheel": wheel,
    "stripes": stripes,
    "post": post,
    "concrete-post": concrete_post,
    "bricks": bricks,
    "hub": hub,
    "tape": tape,
    "patchy-floor": patchy_floor,
}
