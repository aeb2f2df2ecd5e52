"""Tracking of something that stands and shows nothing but an edge, along which its fragments slide."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from config.perception import PerceptionConfig
from tests.support.detections import detection
from tests.support.grids import CAMERA, grid_of, nearest, wall
from tests.support.point_motion import static_miss
from tests.support.walker import moving, walker
from vision.detection import unknown_residuals
from vision.tracker import Tracker

LAG_S = 0.25


def frames_moving(second_edge_m: float) -> int:
    """Of 15, in how many something moves, if all ends on a plate 4 m away slide at 0.8 m/s to the right.

    They lie on its middle row, every second one second_edge_m below it.
    """
    at_m = np.column_stack((np.linspace(-0.2, 0.2, 8), np.tile([0.0, second_edge_m], 4)))
    static = np.column_stack((at_m, np.full(8, 4.0)))
    ray = (at_m + np.array([0.8 * LAG_S, 0.0])) / 4.0
    motion = replace(
        unknown_residuals(8),
        static_m=static,
        ray=ray,
        lag_s=np.full(8, LAG_S),
        residual_m=static_miss(static, ray),
        covariance=np.tile([1e-4, 0.0, 1e-4], (8, 1)),
        depth_effect=np.zeros((8, 2)),
        static_chi2=np.full(8, 400.0),
        usable=np.ones(8, np.bool_),
    )
    ends_px = np.column_stack((CAMERA.cx + CAMERA.fx * ray[:, 0], CAMERA.cy + CAMERA.fy * ray[:, 1]))
    tracker = Tracker(PerceptionConfig(), body_height_m=1.5, clearance_m=0.05)
    count = 0
    for k in range(15):
        seen = replace(
            detection(grid_of(nearest(walker(0.0), wall(8.0))), k),
            ids=np.arange(4),
            ends_px=ends_px.reshape(4, 2, 2).astype(np.float32),
            near_m=np.full((4, 2), 4.0, np.float32),
            age_frames=np.full(4, 3, np.intp),
            motion=motion,
        )
        count += bool(moving(tracker.step(seen, None)))
    return count


@pytest.mark.parametrize(("second_edge_m", "moves"), [(0.0, False), (0.3, True)])
def test_ends_that_slide_along_one_edge_move_nothing(second_edge_m: float, moves: bool) -> None:
    """On two edges eight ends alike are a motion."""
    assert (frames_moving(second_edge_m) > 0) == moves
