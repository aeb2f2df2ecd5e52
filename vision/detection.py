"""Detection, the result of detect and the input of track: fragments, residuals of their ends, ego-motion."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from hal.records import record
from hal.types import FloatArray, Integers, Intrinsics, Pose
from vision.depth.depth_grid import DepthGrid
from vision.ego_motion.camera_motion import MIN_AGREEMENT, CameraEstimate
from vision.ego_motion.motion_prior import MotionPrior
from vision.motion.velocities import EndResiduals
from vision.scene import CameraHealth, EgoMotion, SeenFloor


@record(frozen=True, slots=True, eq=False)
class CameraMotion:
    """The camera's motion since the frame before, and what is to be thought of it.

    ego: the motion.
    known: it is known well enough to call anything else moving.
    reckoned: odometry supports it.
    blurred: few fragments fit one motion of the camera under the assumed noise; never with odometry.
    """

    ego: EgoMotion
    known: bool
    reckoned: bool
    blurred: bool


# Of a frame that was not compared with the one before.
NOT_COMPARED = CameraMotion(
    EgoMotion(
        motion=Pose(np.eye(3), np.zeros(3)),
        dt_s=0.0,
        source="none",
        inlier_ratio=math.nan,
        sigma_translation_m=math.inf,
        sigma_rotation_rad=math.inf,
    ),
    known=False,
    reckoned=False,
    blurred=False,
)


@record(frozen=True, slots=True, eq=False)
class Detection:
    """What detect finds in one frame, with N fragments, before anything is called an obstacle.

    captured_ns, sequence: of the frame.
    dt_s: since the frame before; 0.0 where the two were not compared.
    camera: intrinsics of the colour image.
    grid: coarse grid of depth.
    ids: of the fragments, (N,).
    ends_px: their end points (u, v), (N, 2, 2).
    near_m: depth of the near surface at the ends, NaN where there is none, (N, 2).
    age_frames: frames since they were found, (N,).
    motion: residuals of the 2N ends; the two ends of a fragment are adjacent.
    pose: the camera in the fixed frame.
    ego_motion: motion of the camera since the frame before.
    health: condition of the camera.
    restarted: the fixed frame has begun anew, so earlier positions cannot be compared.
    motion_known: the camera's own motion is known well enough to call anything else moving.
    reckoned: odometry supports that motion.
    blurred: few fragments fit one motion of the camera under the assumed noise; never with odometry.
    floor: the newest look of the check of the mounting; None before the first, or without a mounting.
    """

    captured_ns: int
    sequence: int
    dt_s: float
    camera: Intrinsics
    grid: DepthGrid
    ids: Integers
    ends_px: Annotated[NDArray[np.float32], "float32[:, :, :]"]
    near_m: Annotated[NDArray[np.float32], "float32[:, :]"]
    age_frames: Integers
    motion: EndResiduals
    pose: Pose
    ego_motion: EgoMotion
    health: CameraHealth
    restarted: bool
    motion_known: bool
    reckoned: bool
    blurred: bool
    floor: SeenFloor | None = None

    @property
    def floor_normal(self) -> FloatArray | None:
        """(3,) the floor's normal in the fixed frame; None where the floor is not known."""
        return None if self.grid.up is None else np.asarray(self.pose.rotation @ self.grid.up)


def camera_motion_of(found: CameraEstimate, step: Pose, dt_s: float, prior: MotionPrior) -> CameraMotion:
    """The CameraMotion of an estimate. step: the camera's motion in dt_s."""
    variance = found.covariance.diagonal()
    ego = EgoMotion(
        motion=step,
        dt_s=dt_s,
        source="visual" if found.visual else "disputed" if found.disputed else prior.source,
        inlier_ratio=found.inlier_ratio,
        sigma_translation_m=float(np.sqrt(variance[3:6].sum())),
        sigma_rotation_rad=float(np.sqrt(variance[:3].sum())),
    )
    reckoned = prior.source != "none"
    blurred = found.visual and not reckoned and found.inlier_ratio < MIN_AGREEMENT
    known = ego.source in ("visual", "odometry") and (found.noisy or not blurred)
    return CameraMotion(ego, known, reckoned, blurred)


def unknown_residuals(count: int) -> EndResiduals:
    """Residuals of count ends of which nothing is known: none is usable."""
    return EndResiduals(
        static_m=np.tile(np.array([0.0, 0.0, 1.0]), (count, 1)),
        ray=np.zeros((count, 2)),
        lag_s=np.zeros(count),
        residual_m=np.zeros((count, 2)),
        covariance=np.ones((count, 3)) * np.array([1.0, 0.0, 1.0]),
        depth_effect=np.zeros((count, 2)),
        depth_step_m=np.full(count, np.nan),
        depth_step_sigma_m=np.ones(count),
        depth_lag_s=np.zeros(count),
        static_chi2=np.zeros(count),
        usable=np.zeros(count, np.bool_),
    )
