"""The Scene: what perception tells the decision about one frame. Obstacles, free space, camera health.

Positions and velocities are in the camera optical frame (x right, y down, z forward) at captured_ns.
"""

from __future__ import annotations

import math
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from hal.records import record
from hal.types import FloatArray, PlanarPose, Pose, Vector


@record(frozen=True, slots=True, eq=False)
class Obstacle:
    """A thing that the robot could touch, seen by its fragments or by depth alone.

    id: of the track; never used again.
    bbox_px: (u0, v0, u1, v1) in the colour image; for a mover out of sight, where it is expected.
    position_m: (3,) centre of the visible surface.
    extent_m: (3,) full size of the visible surface along x, y, z.
    velocity_mps: (3,) over ground (the robot's own motion removed), along the camera axes.
    velocity_cov: (3, 3) covariance in (m/s)^2. It is large while the obstacle is young, so that the closing
        speed of a new obstacle is bounded instead of being taken for zero.
    moving: the verdict, decided with hysteresis.
    score: 0..1, confidence that it is a moving object if moving, else that it is an object.
    fragments: number of fragments on it.
    age_s: since the obstacle was first seen.
    unseen_s: since it was last seen; it is predicted meanwhile.
    """

    id: int
    bbox_px: tuple[float, float, float, float]
    position_m: FloatArray
    extent_m: FloatArray
    velocity_mps: FloatArray
    velocity_cov: FloatArray
    moving: bool
    score: float
    fragments: int
    age_s: float
    unseen_s: float


# floor_from_m of a camera that never has the floor in view; also its upper bound.
NEVER_M = 100.0


@record(frozen=True, slots=True, eq=False)
class FreeSpace:
    """A scan made of the depth image: obstacle surfaces between the floor and the robot's height.

    It has N upright bands, left to right, in the optical frame levelled to the floor.

    bearing_tan: (N,) x/z of the centre of each band.
    half_width_tan: half the width of a band, in the same unit.
    nearest_m: (N,) forward distance z to the nearest obstacle surface; inf: none seen.
    known_m: (N,) forward distance up to which the space was really seen. Space beyond is unknown and
        therefore not free.
    blind_m: floor in view nearer than this forward distance is too near to be measured, or hidden by a part
        of the robot, and is not part of what is known; 0.0: all of it can be measured.
    floor_from_m: nearer than this forward distance the floor is below the view, or hidden by a part of the
        robot, however far known_m reaches; 0.0: not known; NEVER_M: the floor never comes into view.
    up_tan: rise of the upper edge of the view above the camera's height per metre of forward distance; inf:
        not known.
    blank: (N,) bands in which hardly anything was measured at all, near or far; None: not reported.
    """

    bearing_tan: Vector
    half_width_tan: float
    nearest_m: Vector
    known_m: Vector
    blind_m: float = 0.0
    floor_from_m: float = 0.0
    up_tan: float = math.inf
    blank: NDArray[np.bool_] | None = None


class CameraCondition(Enum):
    """How far the camera can be trusted; the decision has a speed for each."""

    GOOD = "good"
    DEGRADED = "degraded"
    UNTRUSTWORTHY = "untrustworthy"


@record(frozen=True, slots=True)
class CameraHealth:
    """Health of the camera in one frame.

    condition: how far it can be trusted.
    reason: why, in a plain sentence; "" when good.
    valid_depth_ratio: share of the depth image that was measured, also beyond the depth mask, 0..1.
    """

    condition: CameraCondition
    reason: str
    valid_depth_ratio: float


@record(frozen=True, slots=True)
class SeenFloor:
    """Where one look has found the floor in the depth, whatever the mounting says.

    captured_ns: of the frame.
    camera_height_m: of the camera over this floor.
    pitch_rad: of the camera over this floor; positive looks down.
    roll_rad: positive: the camera's right side is lower.
    """

    captured_ns: int
    camera_height_m: float
    pitch_rad: float
    roll_rad: float


@record(frozen=True, slots=True, eq=False)
class EgoMotion:
    """The camera's own motion between the frame before and this one.

    motion: the camera now, in the camera frame before (p_before = motion.apply(p_now)).
    dt_s: between the two exposures.
    source: what it rests on: "visual", "odometry", "none", or "disputed" (the images, which the prior, by
        odometry or by the kinematics of the base, contradicts).
    inlier_ratio: share of the fragments that agree with it as static; NaN where not estimated.
    sigma_translation_m: one standard deviation over the whole interval.
    sigma_rotation_rad: one standard deviation over the whole interval.
    """

    motion: Pose
    dt_s: float
    source: str
    inlier_ratio: float
    sigma_translation_m: float
    sigma_rotation_rad: float


@record(frozen=True, slots=True, eq=False)
class Fragments:
    """The featured fragments of the paper: N line segments, tracked from frame to frame.

    ids: (N,) int64.
    ends_px: (N, 2, 2) float32, two end points (u, v).
    depth_m: (N,) of the middle; NaN: not known.
    position_m: (N, 3) of the middle, optical frame.
    velocity_mps: (N, 3) over ground; NaN until measured.
    velocity_sigma_mps: (N, 3) standard deviation per axis; NaN until measured.
    moving: (N,) bool, its obstacle moves.
    obstacle_id: (N,) int64; -1: none.
    """

    ids: NDArray[np.int64]
    ends_px: NDArray[np.float32]
    depth_m: FloatArray
    position_m: FloatArray
    velocity_mps: FloatArray
    velocity_sigma_mps: FloatArray
    moving: NDArray[np.bool_]
    obstacle_id: NDArray[np.int64]


@record(frozen=True, slots=True, eq=False)
class Scene:
    """All that perception tells the decision about one frame.

    captured_ns: time of the exposure.
    sequence: number of the frame.
    obstacles: listed tracks.
    free_space: what depth shows of the space ahead.
    ego_motion: the camera's own motion since the frame before.
    health: of the camera.
    robot_pose: the robot's body in the odometry frame at captured_ns, as perception used it; None without
        odometry.
    floor: the newest look of the check of the mounting, which may be seconds old; None before the first one.
    """

    captured_ns: int
    sequence: int
    obstacles: tuple[Obstacle, ...]
    free_space: FreeSpace
    ego_motion: EgoMotion
    health: CameraHealth
    robot_pose: PlanarPose | None
    floor: SeenFloor | None = None
