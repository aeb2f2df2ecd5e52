"""The scan of free space of single painted frames, some of whose image columns a test tampers with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from config.perception import PerceptionConfig
from hal.geometry import camera_in_floor
from hal.types import CameraMount, PlanarPose, RgbdFrame
from tests.support.painted import MOUNT, VGA, Quad, paint, plain
from vision.perception import Perception
from vision.scene import FreeSpace

HERE = PlanarPose(0.0, 0.0, 0.0)
CENTRE = slice(220, 420)  # image columns that are tampered with
ROBOT_HEIGHT_M = 0.8


def bare(quads: Sequence[Quad]) -> list[Quad]:
    """The same without texture: no fragments are found on them."""
    return [replace(one, texture=plain()) for one in quads]


def frame_of(quads: Sequence[Quad], mount: CameraMount = MOUNT, noise: float = 0.0) -> RgbdFrame:
    """What a camera sees of bare quads. noise: sigma of depth, per metre."""
    return paint(bare(quads), camera_in_floor(HERE, mount), VGA, depth_sigma_per_m=noise)


def eyes_on(mount: CameraMount) -> Perception:
    """The perception of a robot ROBOT_HEIGHT_M high."""
    return Perception(PerceptionConfig(), mount, ROBOT_HEIGHT_M, clearance_m=0.05)


def space_of(frame: RgbdFrame, mount: CameraMount = MOUNT) -> FreeSpace:
    """The scan of a single frame."""
    return eyes_on(mount).perceive(frame, None, None).scene.free_space


def inside(space: FreeSpace, columns: slice = CENTRE) -> NDArray[np.bool_]:
    """Bands that lie within the tampered columns as a whole."""
    left, right = ((c - VGA.cx) / VGA.fx for c in (columns.start, columns.stop))
    half = space.half_width_tan
    result: NDArray[np.bool_] = (space.bearing_tan - half >= left) & (space.bearing_tan + half <= right)
    return result


def outside(space: FreeSpace, columns: slice = CENTRE) -> NDArray[np.bool_]:
    """Bands that lie beside the tampered columns as a whole."""
    left, right = ((c - VGA.cx) / VGA.fx for c in (columns.start, columns.stop))
    half = space.half_width_tan
    result: NDArray[np.bool_] = (space.bearing_tan + half <= left) | (space.bearing_tan - half >= right)
    return result
