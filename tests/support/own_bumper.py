"""A robot that sees its own front bumper, painted: it moves with the camera."""

from __future__ import annotations

from collections.abc import Sequence

from config.own_parts import OwnPart
from config.perception import PerceptionConfig
from hal.geometry import camera_in_floor
from hal.types import CameraMount, PlanarPose, RgbdFrame
from tests.support.painted import FRAME_NS, MOUNT, VGA, Quad, box, paint, vector
from vision.perception import Perception

# The painted camera is 0.5 m high and level. It sees the bumper's upper side from 13 degrees below its axis
# on, down to the end of the image, and over it floor from 2.1 m on.
BUMPER = OwnPart(name="bumper", from_m=(0.40, -0.30, 0.20), to_m=(0.51, 0.30, 0.38))
HIDDEN_M = (0.51 - MOUNT.forward_m) * MOUNT.height_m / (MOUNT.height_m - 0.38)


def bumper(seed: int = 40, speed_mps: float = 0.0) -> list[Quad]:
    """Its faces, with marks."""
    (x, y, z), (to_x, to_y, to_z) = BUMPER.from_m, BUMPER.to_m
    size_m = vector(to_x - x, to_y - y, to_z - z)
    return box(vector(x, 0.5 * (y + to_y), z), size_m, seed, vector(speed_mps, 0.0, 0.0))


def eyes(
    *own_parts: OwnPart, config: PerceptionConfig | None = None, mount: CameraMount = MOUNT
) -> Perception:
    """The perception of this robot."""
    return Perception(config or PerceptionConfig(), mount, 0.8, 0.05, own_parts)


def frames_of(quads: Sequence[Quad], count: int, speed_mps: float = 0.0) -> list[RgbdFrame]:
    """count frames of a robot that drives at speed_mps, with its bumper in view."""
    frames = []
    for number in range(count):
        time_s = number * FRAME_NS * 1e-9
        camera = camera_in_floor(PlanarPose(speed_mps * time_s, 0.0, 0.0), MOUNT)
        frames.append(paint([*quads, *bumper(speed_mps=speed_mps)], camera, VGA, time_s, number))
    return frames
