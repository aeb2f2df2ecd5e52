"""A decision maker that is shown what a test wants, and obstacles to show it."""

from __future__ import annotations

import math

import numpy as np

from config.decision import DecisionConfig
from config.robot import Robot
from controller.decision.decide import DecisionMaker
from controller.decision.decision import Decision
from controller.decision.situation import Situation
from controller.path.path import OnPath, Path
from hal.geometry import camera_in_floor
from hal.types import CameraMount, PlanarPose
from tests.support.floor_bodies import line_path
from tests.support.scenes import GOOD, STILL, free_space
from vision.scene import CameraHealth, FreeSpace, Obstacle, Scene

MOUNT = CameraMount(0.45, 0.0, 0.60, math.radians(4.0))
PATH = line_path(30.0)
STEP_NS = 20_000_000
AGE_NS = 60_000_000


def obstacle(
    x_m: float,
    y_m: float,
    vx_mps: float = 0.0,
    vy_mps: float = 0.0,
    *,
    robot_x_m: float = 0.0,
    age_s: float = 2.0,
    sigma_mps: float = 0.1,
    number: int = 5,
    size_m: tuple[float, float] = (0.5, 1.7),
) -> Obstacle:
    camera = camera_in_floor(PlanarPose(robot_x_m, 0.0, 0.0), MOUNT).inverse()
    return Obstacle(
        id=number,
        bbox_px=(0.0, 0.0, 1.0, 1.0),
        position_m=camera.apply(np.array([[x_m, y_m, size_m[1] / 2]]))[0],
        extent_m=np.array([size_m[0], size_m[1], 0.2]),
        velocity_mps=camera.rotation @ np.array([vx_mps, vy_mps, 0.0]),
        velocity_cov=np.eye(3) * sigma_mps**2,
        moving=vx_mps != 0.0 or vy_mps != 0.0,
        score=0.9,
        fragments=5,
        age_s=age_s,
        unseen_s=0.0,
    )


class Bench:
    """A decision maker that is shown what the test wants, one step after another."""

    def __init__(self, robot: Robot | None = None, config: DecisionConfig | None = None) -> None:
        self.maker = DecisionMaker(config or DecisionConfig(), robot or Robot(), MOUNT, 0.02)
        self.now_ns = 1_000_000_000
        self.frame = 0

    def scene(
        self,
        *obstacles: Obstacle,
        x_m: float = 0.0,
        free: FreeSpace | None = None,
        health: CameraHealth = GOOD,
        age_ns: int = AGE_NS,
    ) -> Scene:
        self.frame += 1
        return Scene(
            self.now_ns - age_ns,
            self.frame,
            obstacles,
            free or free_space(),
            STILL,
            health,
            PlanarPose(x_m, 0.0, 0.0),
        )

    def step(
        self,
        scene: Scene | None,
        v_mps: float = 1.0,
        a_mps2: float = 0.0,
        x_m: float = 0.0,
        d_m: float = 0.0,
        path: Path = PATH,
    ) -> Decision:
        self.now_ns += STEP_NS
        pose, on_path = PlanarPose(x_m, d_m, 0.0), OnPath(x_m, d_m, 0.0)
        return self.maker.step(Situation(scene, path, pose, on_path, v_mps, a_mps2, self.now_ns))

    def settle(
        self, *obstacles: Obstacle, v_mps: float = 1.0, x_m: float = 0.0, free: FreeSpace | None = None
    ) -> Decision:
        """The same scene for twenty frames."""
        for _ in range(20):
            decision = self.step(self.scene(*obstacles, x_m=x_m, free=free), v_mps, x_m=x_m)
        return decision
