"""What perception tells the decision about one frame: obstacles, free space, health.

Positions and velocities are in the camera optical frame (x right, y down, z forward) at captured_ns.
"""

from __future__ import annotations

import math
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from hal.records import record
from hal.types import FloatArray, PlanarPose, Pose


@record(frozen=True, slots=True, eq=False)
class Obstacle:
    """A thing that the robot could touch, seen by its fragments or by depth alone.

    bbox_px: (u0, v0, u1, v1) in the colour image; of a mover out of sight where it is expected.
    position_m: (3,) centre of the visible surface. extent_m: (3,) full size of the visible surface
    along x, y, z. velocity_mps: (3,) over ground
    (the robot's own motion removed), along the camera axes. velocity_cov: (3, 3) (m/s)^2; wide
    while the obstacle is young, so that a first sight bounds the closing speed instead of
    calling it zero. moving: decided with hysteresis; score: 0..1, confidence in that it is a
    moving object if moving, else in that it is an object. age_s: since the obstacle was first seen.
    unseen_s: since it was last seen (it is predicted meanwhile).
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


# No camera sees the floor from farther away on.
NEVER_M = 100.0


@record(frozen=True, slots=True, eq=False)
class FreeSpace:
    """A scan made of the depth image: what stands between the floor and the robot's height.

    For each of N upright bands, left to right: bearing_tan (N,) is x/z of its centre in the
    optical frame levelled to the floor; nearest_m (N,) the forward distance z to the nearest
    obstacle surface (inf: none seen); known_m (N,) how far the space was really seen, so that
    whatever lies beyond is unknown and therefore not free. half_width_tan: half a band's width.
    blind_m: floor in the view nearer than this forward distance was too near to be measured, and is no part
    of what is known; 0.0: all of it can be measured. floor_from_m: nearer than this forward distance the
    floor is below the view, however far known_m reaches; 0.0: not known, NEVER_M: it never comes into view.
    up_tan: by so much a metre of forward distance the upper edge of the view rises from the camera's height;
    inf: not known. blank (N,): bands in which hardly anything was measured at all, near or far; None: not
    told.
    """

    bearing_tan: FloatArray
    half_width_tan: float
    nearest_m: FloatArray
    known_m: FloatArray
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
    """condition, and why in a plain sentence ("" when good). valid_depth_ratio: share of the depth
    image that was measured, also beyond the depth mask, 0..1."""

    condition: CameraCondition
    reason: str
    valid_depth_ratio: float


@record(frozen=True, slots=True, eq=False)
class EgoMotion:
    """The camera's own motion between the frame before and this one.

    motion: the camera now, in the camera before (p_before = motion.apply(p_now)). dt_s: between the
    two exposures. source: which of "visual", "odometry", "none" it rests on; "disputed": on the images, which
    the odometry contradicts. inlier_ratio: share of the fragments that agree with it as static, NaN where not
    estimated. sigma_translation_m and sigma_rotation_rad: one standard deviation over the whole interval.
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

    ids (N,) int64. ends_px (N, 2, 2) float32: two end points (u, v). depth_m (N,), NaN: not known.
    position_m (N, 3): middle, optical frame. velocity_mps (N, 3): over ground, NaN until measured.
    velocity_sigma_mps (N, 3). moving (N,) bool. obstacle_id (N,) int64, -1: none.
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
    """All that one frame says to the decision. robot_pose: the body in the odometry frame at
    captured_ns as perception used it; None without odometry."""

    captured_ns: int
    sequence: int
    obstacles: tuple[Obstacle, ...]
    free_space: FreeSpace
    ego_motion: EgoMotion
    health: CameraHealth
    robot_pose: PlanarPose | None
