"""Scenes and chassis states made of known numbers, for tests of what comes after perception."""

from __future__ import annotations

import math

import numpy as np

from hal.types import ChassisMode, ChassisState, PlanarPose, Pose, Setpoint
from vision.scene import (
    CameraCondition,
    CameraHealth,
    EgoMotion,
    FreeSpace,
    Obstacle,
    Scene,
)

ORIGIN = PlanarPose(0.0, 0.0, 0.0)
GOOD = CameraHealth(CameraCondition.GOOD, "", 0.95)
STILL = EgoMotion(Pose(np.eye(3), np.zeros(3)), 0.033, "visual", 0.9, 0.01, 0.002)


def free_space(known_m: float = 10.0, nearest_m: float = math.inf, bands: int = 60) -> FreeSpace:
    """The same distance in every direction of a 55 degree view."""
    return FreeSpace(
        np.linspace(-0.52, 0.52, bands),
        0.52 / bands,
        np.full(bands, nearest_m),
        np.full(bands, known_m),
    )


def scene(
    captured_ns: int = 0,
    sequence: int = 0,
    obstacles: tuple[Obstacle, ...] = (),
    space: FreeSpace | None = None,
    health: CameraHealth = GOOD,
    pose: PlanarPose | None = ORIGIN,
) -> Scene:
    """A scene; by default everything ahead is free."""
    return Scene(captured_ns, sequence, obstacles, space or free_space(), STILL, health, pose)


def obstacle(
    number: int = 1,
    position_m: tuple[float, float, float] = (0.0, 0.0, 5.0),
    velocity_mps: tuple[float, float, float] = (0.0, 0.0, 0.0),
    moving: bool = False,
    score: float = 0.9,
) -> Obstacle:
    """An obstacle in the optical frame, half a metre wide."""
    return Obstacle(
        id=number,
        bbox_px=(300.0, 200.0, 340.0, 300.0),
        position_m=np.array(position_m),
        extent_m=np.array([0.5, 1.0, 0.3]),
        velocity_mps=np.array(velocity_mps),
        velocity_cov=0.01 * np.eye(3),
        moving=moving,
        score=score,
        fragments=12,
        age_s=1.0,
        unseen_s=0.0,
    )


def chassis_state(
    stamp_ns: int = 0,
    mode: ChassisMode = ChassisMode.ARMED,
    v_mps: float = 0.0,
    pose: PlanarPose = ORIGIN,
    reason: str = "",
    sent: Setpoint | None = None,
) -> ChassisState:
    """A base that has just answered."""
    return ChassisState(stamp_ns, mode, reason, stamp_ns, v_mps, 0.0, pose, 48.0, (), sent)
