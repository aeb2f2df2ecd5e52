"""What seems to arrive where the camera's motion was hardly known is no mover."""

from __future__ import annotations

from dataclasses import replace

import pytest

from config.perception import PerceptionConfig
from tests.support.detections import detection
from tests.support.grids import grid_of, wall
from vision.tracker import Tracker


def movers(blurred: set[int], arrives: int = 10, count: int = 24) -> list[int]:
    """Number of movers in each frame; a box stands 2 m before a wall from frame arrives on."""
    room, box = wall(4.0), wall(4.0)
    box[20:50, 40:70] = 2.0
    tracker, found = Tracker(PerceptionConfig(), body_height_m=1.5, clearance_m=0.05), []
    for frame in range(count):
        seen = detection(grid_of(room if frame < arrives else box), frame)
        scene = tracker.step(replace(seen, reckoned=False, blurred=frame in blurred), None).scene
        found.append(sum(obstacle.moving for obstacle in scene.obstacles))
    return found


def test_a_surface_that_arrives_moves() -> None:
    found = movers(blurred=set())
    assert sum(found[:11]) == 0, "one frame proves nothing"
    assert max(found) == 1


@pytest.mark.parametrize("blurred", [{9}, {9, 12, 17, 22}, set(range(10, 24))])
def test_not_while_a_frame_is_blurred_nor_a_moment_after(blurred: set[int]) -> None:
    """0.2 s are six frames; after those the box has stayed for too long to count as arrived."""
    found = movers(blurred)
    assert sum(found[: max(blurred) + 7]) == 0


def test_blur_before_a_restart_does_not_count() -> None:
    assert max(movers(blurred={0})) == 1
