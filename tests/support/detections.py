"""Detections without images: exact depth grids, a camera whose motion is known, no fragments."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from config.perception import PerceptionConfig
from hal.types import FloatArray, Pose
from tests.support.grids import CAMERA, grid_of
from tests.support.scenes import GOOD
from vision.depth.depth_grid import DepthGrid
from vision.detection import Detection, unknown_residuals
from vision.percept import Percept
from vision.scene import EgoMotion
from vision.tracker import Tracker

FRAME_NS = 33_333_333
START_NS = 1_000_000_000
AT_ORIGIN = Pose(np.eye(3), np.zeros(3))


def detection(
    grid: DepthGrid, frame: int = 0, pose: Pose = AT_ORIGIN, motion_known: bool = True, source: str = "visual"
) -> Detection:
    """Frame 0 begins anew, the others follow at 30 Hz with a camera that stands still."""
    first = frame == 0
    dt_s = 0.0 if first else FRAME_NS * 1e-9
    return Detection(
        captured_ns=START_NS + frame * FRAME_NS,
        sequence=frame,
        dt_s=dt_s,
        camera=CAMERA,
        grid=grid,
        ids=np.empty(0, np.int64),
        ends_px=np.empty((0, 2, 2), np.float32),
        near_m=np.empty((0, 2), np.float32),
        age_frames=np.empty(0, np.intp),
        motion=unknown_residuals(0),
        pose=pose,
        ego_motion=EgoMotion(AT_ORIGIN, dt_s, "none" if first else source, 0.9, 0.001, 0.0005),
        health=GOOD,
        restarted=first,
        motion_known=motion_known and not first,
        reckoned=True,
        blurred=False,
    )


def track(
    depths_m: Sequence[FloatArray], up: FloatArray | None = None, camera_height_m: float = 1.0
) -> list[Percept]:
    """What the tracker makes of one exact depth grid a frame."""
    tracker = Tracker(PerceptionConfig(), body_height_m=1.5, clearance_m=0.05)
    return [
        tracker.step(detection(grid_of(depth_m, up, camera_height_m), frame), None)
        for frame, depth_m in enumerate(depths_m)
    ]
