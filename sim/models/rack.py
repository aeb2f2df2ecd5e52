"""The model of a pallet rack: posts, beams, goods painted on planes inside, and some boxes in front of
these."""

from __future__ import annotations

import math

import numpy as np

from config.scenario import Shelf
from sim.models.mesh import Faces, box, join, quad

# Side of a post, height of a beam, and how far the goods stand behind the front: as in usual pallet racks.
_POST_M, _BEAM_M, _RECESS_M = 0.10, 0.11, 0.16


def build_rack(spec: Shelf, generator: np.random.Generator) -> Faces:
    """All faces of the rack in its body frame."""
    level_m = spec.height_m / spec.levels
    parts = [_goods_planes(spec, generator), _beams(spec, level_m), _posts(spec)]
    parts.extend(_boxes(spec, generator, level_m))
    return join(parts)


def _goods_planes(spec: Shelf, generator: np.random.Generator) -> Faces:
    x, y = 0.5 * spec.length_m, 0.5 * spec.width_m - min(_RECESS_M, 0.3 * spec.width_m)
    z0, z1 = spec.z_m, spec.z_m + spec.height_m
    sizes = f"{spec.length_m:.2f}x{spec.height_m:.2f}/{spec.bay_m:.2f}/{spec.levels}"
    ends = f"{2 * y:.2f}x{spec.height_m:.2f}/{spec.bay_m:.2f}/{spec.levels}"
    keys = [str(int(n)) for n in generator.integers(8, size=3)]
    if spec.texture != "fine":
        material = "wood" if spec.texture == "coarse" else "plain/grey"
        return box((spec.length_m, 2 * y, spec.height_m), material, (0.0, 0.0, z0))
    return join(
        [
            quad([(x, y, z1), (-x, y, z1), (-x, y, z0), (x, y, z0)], f"facade/{keys[0]}/{sizes}"),
            quad([(-x, -y, z1), (x, -y, z1), (x, -y, z0), (-x, -y, z0)], f"facade/{keys[1]}/{sizes}"),
            quad([(x, -y, z1), (x, y, z1), (x, y, z0), (x, -y, z0)], f"facade/{keys[2]}/{ends}"),
            quad([(-x, y, z1), (-x, -y, z1), (-x, -y, z0), (-x, y, z0)], f"facade/{keys[2]}/{ends}"),
        ]
    )


def _beams(spec: Shelf, level_m: float) -> Faces:
    """One pair of beams under each level except the lowest, and one at the top."""
    beams = []
    for level in range(1, spec.levels + 1):
        z = spec.z_m + level * level_m - _BEAM_M
        for side in (-1.0, 1.0):
            centre = (0.0, side * (0.5 * spec.width_m - 0.04), z)
            beams.append(box((spec.length_m, 0.06, _BEAM_M), "plain/orange", centre, skip="fb"))
    return join(beams)


def _posts(spec: Shelf) -> Faces:
    posts = []
    bays = max(1, math.ceil(spec.length_m / spec.bay_m - 1e-9))
    for x in np.linspace(-0.5, 0.5, bays + 1) * (spec.length_m - _POST_M):
        for side in (-1.0, 1.0):
            centre = (float(x), side * 0.5 * (spec.width_m - _POST_M), spec.z_m)
            posts.append(box((_POST_M, _POST_M, spec.height_m), "post", centre, skip="u"))
    return join(posts)


def _boxes(spec: Shelf, generator: np.random.Generator, level_m: float) -> list[Faces]:
    """Boxes on both sides, whose fronts are in front of the painted goods."""
    places = max(1, math.floor(spec.length_m / 0.9))
    boxes = []
    for level in range(min(spec.levels, 2)):
        for side in (-1.0, 1.0):
            for place in range(places):
                chosen, share_x, share_z, slide = generator.random(4)
                key = int(generator.integers(9))
                if chosen > spec.goods * (0.5 if level == 0 else 0.3):
                    continue
                size = (0.45 + 0.35 * share_x, 0.5 * spec.width_m - 0.06, (0.4 + 0.35 * share_z) * level_m)
                x = (place + 0.5) * spec.length_m / places - 0.5 * spec.length_m
                y = side * (0.5 * spec.width_m - 0.5 * size[1] - 0.01 - 0.05 * slide)
                z = spec.z_m + level * level_m
                boxes.append(box(size, _goods_texture(spec, key), (float(x), y, z), skip="u"))
    return boxes


def _goods_texture(spec: Shelf, key: int) -> str:
    if spec.texture == "plain":
        return "plain/white"
    if spec.texture == "coarse":
        return f"coarse/{('blue', 'green', 'grey')[key % 3]}"
    return f"cardboard/{key}"
