"""A sight of a straight path, looked at scene by scene."""

from __future__ import annotations

import math

import numpy as np

from config.decision import DecisionConfig
from config.robot import Body
from controller.decision.bodies import Bodies, no_bodies
from controller.decision.corridor import Corridor
from controller.decision.sight import Sight
from controller.decision.surfaces import surfaces_of
from hal.types import CameraMount, FloatArray, PlanarPose
from tests.support.floor_bodies import line_path
from vision.scene import FreeSpace

BODY = Body(width_m=0.8, length_m=1.0, rear_m=0.5)
MOUNT = CameraMount(0.4, 0.0, 0.60, 0.0)
FRAME_NS = 33_000_000
BANDS = 61
BEARING = np.linspace(-0.6, 0.6, BANDS)


def free(nearest_m: FloatArray | float = math.inf, known_m: FloatArray | float = 10.0) -> FreeSpace:
    return FreeSpace(
        BEARING, 0.01, np.full(BANDS, nearest_m) * np.ones(BANDS), np.full(BANDS, known_m) * np.ones(BANDS)
    )


class Watch:
    """A sight of a straight path of 20 m, looked at once a frame from wherever the robot is."""

    def __init__(self, config: DecisionConfig | None = None) -> None:
        self.sight = Sight(Corridor(line_path(), BODY), MOUNT, config or DecisionConfig(), 0.0)
        self.frame = 0

    def look(
        self,
        seen: FreeSpace,
        s_m: float = 0.0,
        times: int = 1,
        explained: Bodies | None = None,
        standing: bool = False,
    ) -> Sight:
        for _ in range(times):
            self.frame += 1
            pose = PlanarPose(s_m, 0.0, 0.0)
            self.sight.look(
                seen,
                surfaces_of(seen, pose, MOUNT),
                pose,
                s_m,
                self.frame * FRAME_NS,
                explained or no_bodies(0),
                standing,
            )
        return self.sight
