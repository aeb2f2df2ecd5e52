"""What is wrong for a moment is over after it: odometry that is none."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from config.perception import FragmentSettings, PerceptionConfig
from hal.types import Pose
from tests.support.painted import MOUNT, QVGA, Take, box, drive, floor, record, vector, wall
from vision.perception import Perception
from vision.scene import CameraCondition

SMALL = PerceptionConfig(grid_step_px=2, fragments=FragmentSettings(min_length_px=16, tile_px=20))
COUNT = 14
NAN = float("nan")


@cache
def room() -> Take:
    crate = box(vector(3.5, 0.3, 0.0), vector(0.4, 0.6, 1.2), 10)
    return record(floor() + wall() + crate, drive(0.4), COUNT, QVGA)


def perception() -> Perception:
    return Perception(SMALL, MOUNT, 0.8, 0.05)


@pytest.mark.parametrize(
    "wrong", [Pose(np.full((3, 3), NAN), np.full(3, NAN)), Pose(np.eye(3), np.array([NAN, 0.0, 0.0]))]
)
def test_odometry_that_is_none_for_a_frame_is_none_for_that_frame_only(wrong: Pose) -> None:
    eyes, take = perception(), room()
    odometry = [wrong if k == 6 else camera for k, camera in enumerate(take.cameras)]
    seen = [eyes.perceive(frame, pose, None).scene for frame, pose in zip(take.frames, odometry, strict=True)]
    for scene in seen[3:]:
        assert scene.health.condition is CameraCondition.GOOD
        assert np.isfinite(scene.ego_motion.motion.translation_m).all()
        assert len(scene.obstacles) == 2  # crate and wall
