"""The memory of bodies out of view, scene by scene, of a robot that drives straight on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from controller.decision.bodies import Bodies, no_bodies
from controller.decision.out_of_view import OutOfView
from controller.decision.view_edges import view_from
from hal.types import CameraMount, PlanarPose
from vision.scene import FreeSpace

MOUNT = CameraMount(0.4, 0.0, 0.60, 0.0)
EDGE = 0.5
VIEW = view_from(PlanarPose(0.0, 0.0, 0.0), MOUNT, EDGE, near_m=1.3, up_tan=np.inf)
FRAME_NS = 100_000_000
BANDS = np.linspace(-EDGE + 0.025, EDGE - 0.025, 20)
NOTHING_SEEN = FreeSpace(BANDS, 0.025, np.full(20, np.inf), np.zeros(20))
ALL_SEEN = FreeSpace(BANDS, 0.025, np.full(20, np.inf), np.full(20, 8.0))


class Recall:
    def __init__(self) -> None:
        self.memory = OutOfView(1.5)
        self.before = no_bodies(0)
        self.now_ns = 0

    def see(
        self, bodies: Bodies | None, x_m: float, standing: bool = False, free: FreeSpace = NOTHING_SEEN
    ) -> list[int]:
        """One scene from a robot at x_m; returns the ids of what is remembered besides it."""
        return [int(one) for one in self.recall(bodies, x_m, free, standing).ids]

    def recall(self, bodies: Bodies | None, x_m: float, free: FreeSpace, standing: bool = False) -> Bodies:
        """The same; returns what is remembered."""
        self.now_ns += FRAME_NS
        seen = replace(bodies if bodies is not None else no_bodies(0), captured_ns=self.now_ns)
        kept = self.memory.update(self.before, seen, replace(VIEW, x_m=x_m), standing, free)
        self.before = seen
        return kept
