"""A fixed scene with ten obstacles, as in a busy hall, for measuring the control step."""

from __future__ import annotations

import numpy as np

from hal.types import PlanarPose, Pose
from vision.scene import CameraCondition, CameraHealth, EgoMotion, FreeSpace, Obstacle, Scene

OBSTACLES = 10
_BANDS = 80
_HALF_VIEW_TAN = 0.52
_RANGE_M = 10.0

# x right, z forward (m), and velocity over ground along them (m/s): static obstacles on both sides, and
# movers that go the robot's way, cross far ahead, and come towards it beside its path.
_LAYOUT = (
    (-1.4, 2.5, 0.0, 0.0),
    (1.3, 3.0, 0.0, 0.0),
    (-1.8, 4.5, 0.0, 0.0),
    (1.9, 5.0, 0.0, 0.0),
    (-1.2, 7.5, 0.0, 0.0),
    (1.5, 6.0, 0.0, -0.8),
    (-1.6, 8.5, 0.1, -1.2),
    (-3.2, 8.0, 1.1, 0.0),
    (3.5, 9.0, -0.9, 0.2),
    (1.7, 4.0, 0.0, 0.9),
)


def busy_scene(captured_ns: int, sequence: int, robot_pose: PlanarPose | None) -> Scene:
    """A scene of OBSTACLES obstacles beside a free path, at the same places in every frame."""
    age_s = 0.5 + sequence / 30.0
    obstacles = tuple(
        _obstacle(index + 1, x_m, z_m, vx_mps, vz_mps, age_s)
        for index, (x_m, z_m, vx_mps, vz_mps) in enumerate(_LAYOUT)
    )
    half_width = _HALF_VIEW_TAN / _BANDS
    bearings = np.linspace(-_HALF_VIEW_TAN + half_width, _HALF_VIEW_TAN - half_width, _BANDS)
    free = FreeSpace(bearings, half_width, np.full(_BANDS, np.inf), np.full(_BANDS, _RANGE_M))
    ego = EgoMotion(Pose(np.eye(3), np.zeros(3)), 1.0 / 30.0, "odometry", float("nan"), 0.01, 0.01)
    health = CameraHealth(CameraCondition.GOOD, "", 0.9)
    return Scene(captured_ns, sequence, obstacles, free, ego, health, robot_pose)


def _obstacle(id_: int, x_m: float, z_m: float, vx_mps: float, vz_mps: float, age_s: float) -> Obstacle:
    u, half_px = 320.0 + 610.0 * x_m / z_m, 150.0 / z_m
    moving = vx_mps != 0.0 or vz_mps != 0.0
    return Obstacle(
        id=id_,
        bbox_px=(u - half_px, 240.0 - half_px, u + half_px, 240.0 + half_px),
        position_m=np.array([x_m, 0.0, z_m]),
        extent_m=np.array([0.5, 1.2, 0.4]),
        velocity_mps=np.array([vx_mps, 0.0, vz_mps]),
        velocity_cov=np.diag([0.02, 0.02, 0.05]),
        moving=moving,
        score=0.9,
        fragments=8,
        age_s=age_s,
        unseen_s=0.0,
    )
