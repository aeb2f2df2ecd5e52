"""A plate as wide and high as a person, which walks past the camera at SPEED_MPS."""

from __future__ import annotations

from hal.types import FloatArray
from tests.support.detections import FRAME_NS
from tests.support.grids import plate
from vision.percept import Percept
from vision.scene import Obstacle

FRAME_S = FRAME_NS * 1e-9
SPEED_MPS = 0.8


def moving(percept: Percept) -> list[Obstacle]:
    return [one for one in percept.scene.obstacles if one.moving]


def way_m(frame: int) -> float:
    return SPEED_MPS * frame * FRAME_S


def walker(x_m: float, depth_m: float = 4.0) -> FloatArray:
    """0.5 m wide, 1.6 m high."""
    return plate(depth_m, (x_m - 0.25, x_m + 0.25), (-0.6, 1.0))
