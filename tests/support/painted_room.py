"""A painted room for perception to look at, at half the resolution, and a crate to put into it."""

from __future__ import annotations

from config.perception import FragmentSettings, PerceptionConfig
from tests.support.painted import MOUNT, Quad, Take, floor, vector, wall
from vision.percept import Percept
from vision.perception import Perception

# Half the resolution, everything counted in pixels halved with it.
SMALL = PerceptionConfig(grid_step_px=2, fragments=FragmentSettings(min_length_px=16, tile_px=20))
CRATE_M = vector(0.4, 0.6, 1.2)
SIDEWAYS = vector(0.0, -0.8, 0.0)
TOWARDS = vector(-0.9, 0.0, 0.0)


def perception(config: PerceptionConfig = SMALL) -> Perception:
    """Perception on a robot with the painted camera's mounting."""
    return Perception(config, MOUNT, body_height_m=0.8, clearance_m=0.05)


def room() -> list[Quad]:
    """Nothing but a floor with marks and a wall behind it."""
    return floor() + wall()


def look(take: Take, odometry: bool, config: PerceptionConfig = SMALL) -> list[Percept]:
    """All frames of a take, one after another; odometry: the true camera as its prior, or none."""
    eyes = perception(config)
    return [
        eyes.perceive(frame, camera if odometry else None, None)
        for frame, camera in zip(take.frames, take.cameras, strict=True)
    ]
