"""What detect yields and track reads: fragments, the residuals of their ends, and what these are worth."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hal.types import Intrinsics, Pose
from vision.camera.health import worsened
from vision.depth.depth_grid import DepthGrid
from vision.motion.velocities import PointMotion
from vision.scene import CameraCondition, CameraHealth, EgoMotion

# Without odometry, at least this share of the fragments must fit one motion of the camera.
LEAST_AGREEMENT = 0.45
# Of a frame that was not compared with the one before.
MOTION_NOT_KNOWN = EgoMotion(
    motion=Pose(np.eye(3), np.zeros(3)),
    dt_s=0.0,
    source="none",
    inlier_ratio=math.nan,
    sigma_translation_m=math.inf,
    sigma_rotation_rad=math.inf,
)


@dataclass(frozen=True, slots=True, eq=False)
class Detection:
    """What one frame yields before anything is called an obstacle.

    N fragments: ids (N,), ends_px (N, 2, 2), near_m (N, 2), age_frames (N,). motion: residuals of the
    2N ends, both ends of a fragment next to each other. pose: the camera in the fixed frame; restarted:
    the fixed frame has begun anew, what was tracked before cannot be compared. motion_known: the camera's
    own motion is known well enough to call anything else moving. reckoned: odometry says it, too.
    """

    captured_ns: int
    sequence: int
    dt_s: float
    camera: Intrinsics
    grid: DepthGrid
    ids: NDArray[np.int64]
    ends_px: NDArray[np.float32]
    near_m: NDArray[np.float32]
    age_frames: NDArray[np.intp]
    motion: PointMotion
    pose: Pose
    ego_motion: EgoMotion
    health: CameraHealth
    restarted: bool
    motion_known: bool
    reckoned: bool


def camera_health(health: CameraHealth, ego: EgoMotion, blurred: bool) -> CameraHealth:
    """What the ego-motion tells of the camera. blurred: without odometry, most fragments fit no motion."""
    if blurred:
        reason = (
            f"only {ego.inlier_ratio:.0%} of the fragments fit one motion of the camera:"
            " is depth aligned with colour, in place and in time?"
        )
        return worsened(health, CameraCondition.DEGRADED, reason)
    if ego.source == "visual":
        return health
    if ego.source == "disputed":
        reason = (
            "the images and the odometry tell of two motions of the camera:"
            " do the tracks slip, or is the odometry wrong?"
        )
        return worsened(health, CameraCondition.DEGRADED, reason)
    if ego.source == "odometry":
        reason = "too few static fragments: the camera's motion rests on the odometry alone"
        return worsened(health, CameraCondition.DEGRADED, reason)
    reason = "the camera's motion is not known: too few static fragments agree, and there is no odometry"
    return worsened(health, CameraCondition.UNTRUSTWORTHY, reason)


def no_motion(count: int) -> PointMotion:
    """Residuals of count ends of which nothing is known."""
    return PointMotion(
        static_m=np.tile(np.array([0.0, 0.0, 1.0]), (count, 1)),
        ray=np.zeros((count, 2)),
        lag_s=np.zeros(count),
        miss_m=np.zeros((count, 2)),
        covariance=np.ones((count, 3)) * np.array([1.0, 0.0, 1.0]),
        depth_effect=np.zeros((count, 2)),
        depth_step_m=np.full(count, np.nan),
        depth_step_sigma_m=np.ones(count),
        depth_lag_s=np.zeros(count),
        static_chi2=np.zeros(count),
        usable=np.zeros(count, np.bool_),
    )
