"""Parts and surfaces as vision/regions.py measures them, without a grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tests.support.grids import CAMERA
from vision.regions import Regions


@dataclass(frozen=True)
class Body:
    """Centre x, y, z; width, height, depth in metres; cells."""

    x: float
    y: float = 0.0
    z: float = 4.0
    width: float = 0.4
    height: float = 1.6
    deep: float = 0.2
    cells: int = 200


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
        np.array([[b.width, b.height, b.deep] for b in bodies]),
        np.ones(len(bodies), np.bool_),
        np.ones(len(bodies), np.bool_),
        np.zeros(len(bodies), np.bool_),
    )
