"""Parts and surfaces as vision/depth/regions.py measures them, without a grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tests.support.grids import CAMERA
from vision.depth.regions import Regions


@dataclass(frozen=True)
class Body:
    """Centre x, y, z; width, height, depth in metres; cells."""

    x: float
    y: float = 0.0
    z: float = 4.0
    width: float = 0.4
    height: float = 1.6
    depth: float = 0.2
    cells: int = 200


PERSON = Body(0.0)
ARM = Body(0.45, y=-0.3, width=0.3, height=0.3, cells=90)  # 0.1 m from the person's box
CART = Body(0.0, y=0.2, z=1.0, width=0.6, height=0.4, cells=900)
MAST = Body(0.0, y=-0.3, z=1.7, width=0.2, height=0.6, depth=0.1, cells=100)  # 0.55 m behind the cart's front
FAR_WHEEL = Body(0.1, y=0.5, z=2.0, width=0.2, height=0.4, depth=0.1, cells=40)  # 0.85 m behind the front


def regions(*bodies: Body) -> Regions:
    """As if measured, with boxes in the image as the pinhole camera sees them."""
    bbox = [
        [
            CAMERA.cx + CAMERA.fx * (b.x - b.width / 2) / b.z,
            CAMERA.cy + CAMERA.fy * (b.y - b.height / 2) / b.z,
            CAMERA.cx + CAMERA.fx * (b.x + b.width / 2) / b.z,
            CAMERA.cy + CAMERA.fy * (b.y + b.height / 2) / b.z,
        ]
        for b in bodies
    ]
    return Regions(
        np.array([b.cells for b in bodies]),
        np.array([10 for _ in bodies]),
        np.array(bbox),
        np.array([[b.x, b.y, b.z] for b in bodies]),
        np.array([[b.width, b.height, b.depth] for b in bodies]),
        np.ones(len(bodies), np.bool_),
        np.ones(len(bodies), np.bool_),
        np.zeros(len(bodies), np.bool_),
    )
