"""The obstacles of a scene as upright boxes on the floor, in the frame of the path.

controller/decision/world_model.py asks for them in each new scene, as does the governor.
"""

from __future__ import annotations

import math

import numpy as np

from controller.decision.bodies import Bodies, no_bodies
from controller.decision.situation import SceneError
from hal.compiled import compiled, inlined
from hal.geometry import camera_in_body
from hal.types import CameraMount, Flags, FloatArray, PlanarPose, Pose
from vision.scene import Scene

# Nothing in a hall is farther away, larger or faster: such numbers are faults of perception.
_FARTHEST_M, _LARGEST_M, _FASTEST_MPS = 200.0, 50.0, 15.0
# Columns of what is measured of an obstacle, and the bounds of possible values.
_POSITION, _EXTENT, _VELOCITY, _COVARIANCE = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 18)
_MAX = np.repeat([_FARTHEST_M, _LARGEST_M, _FASTEST_MPS, np.finfo(np.float64).max], (3, 3, 3, 9))
_MIN = -_MAX
_MIN[_EXTENT] = _MIN[[9, 13, 17]] = 0.0  # and the variances


def bodies_of(scene: Scene, pose: PlanarPose, mount: CameraMount, depth_m: float) -> Bodies:
    """The obstacles of a scene; pose: of the robot that carries the camera.

    depth_m: least depth of a body, from the visible surface on, since its back is hidden.
    Raises SceneError for values that are unknown or impossible, and if several have the same id.
    """
    if not scene.obstacles:
        return no_bodies(scene.captured_ns)
    ids = [one.id for one in scene.obstacles]
    if len(set(ids)) < len(ids):
        raise SceneError(f"several obstacles have the id {next(one for one in ids if ids.count(one) > 1)}")
    measured = np.concatenate(
        [
            values
            for one in scene.obstacles
            for values in (one.position_m, one.extent_m, one.velocity_mps, one.velocity_cov.ravel())
        ],
        dtype=np.float64,
    ).reshape(-1, len(_MAX))
    age_s = np.array([one.age_s for one in scene.obstacles], np.float64)
    unseen_s = np.array([one.unseen_s for one in scene.obstacles], np.float64)
    moving = np.array([one.moving for one in scene.obstacles], np.bool_)
    impossible, on_floor, covariance, sizes = _boxes(
        measured, age_s, unseen_s, moving, depth_m, camera_in_body(mount), pose
    )
    if impossible >= 0:
        raise SceneError(_complaint(scene.obstacles[impossible].id, measured[impossible]))
    xy_m, measured_mps, velocity_mps, innovation_mps = on_floor
    half_view_m, half_across_m, view_rad, top_m, bottom_m = sizes
    return Bodies(
        captured_ns=scene.captured_ns,
        ids=np.array(ids, np.int64),
        xy_m=xy_m,
        velocity_mps=velocity_mps,
        measured_mps=measured_mps,
        innovation_mps=innovation_mps,
        covariance=covariance,
        half_view_m=half_view_m,
        half_across_m=half_across_m,
        view_rad=view_rad,
        top_m=top_m,
        bottom_m=bottom_m,
        moving=moving,
        age_s=age_s,
        unseen_s=unseen_s,
        tracked_s=age_s,
    )


def _complaint(track_id: int, measured: FloatArray) -> str:
    position, size, velocity = (
        "(" + ", ".join(f"{value:.2f}" for value in measured[part]) + ")"
        for part in (_POSITION, _EXTENT, _VELOCITY)
    )
    what = f"position {position} m, size {size} m, velocity {velocity} m/s"
    return f"obstacle {track_id} is impossible: {what}"


@inlined
def _dot(one: FloatArray, other: FloatArray) -> float:
    """Scalar product of two vectors (3,)."""
    return float(one[0] * other[0] + one[1] * other[1] + one[2] * other[2])


@compiled("float64[:, ::1], float64[:], float64[:], boolean[::1], float64", Pose, PlanarPose)
def _boxes(
    measured: FloatArray,
    age_s: FloatArray,
    unseen_s: FloatArray,
    moving: Flags,
    depth_m: float,
    camera: Pose,
    robot: PlanarPose,
) -> tuple[int, FloatArray, FloatArray, FloatArray]:
    """Index of the first impossible one of N obstacles (-1: none), and fields of Bodies.

    These are (4, N, 2) xy_m, measured_mps, velocity_mps, innovation_mps; the covariance; (5, N) half_view_m,
    half_across_m, view_rad, top_m, bottom_m. camera: its pose in the robot.
    """
    count, impossible = len(measured), -1
    on_floor, covariance, sizes = np.zeros((4, count, 2)), np.empty((count, 2, 2)), np.empty((5, count))
    xy, measured_mps, velocity, _ = on_floor
    half_view, half_across, view_rad, top, bottom = sizes
    view_rad[:] = robot.heading_rad
    cos, sin, turn = math.cos(robot.heading_rad), math.sin(robot.heading_rad), np.empty((2, 3))
    in_body, in_body_m = camera.rotation, camera.translation_m
    for j in range(3):
        turn[0, j] = cos * in_body[0, j] - sin * in_body[1, j]
        turn[1, j] = sin * in_body[0, j] + cos * in_body[1, j]
    from_x = robot.x_m + cos * in_body_m[0] - sin * in_body_m[1]
    from_y = robot.y_m + sin * in_body_m[0] + cos * in_body_m[1]
    for k in range(count):
        one = measured[k]
        # Written so that NaN fails every comparison.
        possible = age_s[k] >= 0.0 and unseen_s[k] >= 0.0
        for j in range(len(one)):
            possible = possible and _MIN[j] <= one[j] <= _MAX[j]
        if not possible:
            impossible = k
            break
        position, extent, speed = one[_POSITION], one[_EXTENT], one[_VELOCITY]
        half_seen = extent[2] / 2.0
        half_view[k], half_across[k] = max(half_seen, depth_m / 2.0), extent[0] / 2.0
        deeper_m = half_view[k] - half_seen
        xy[k, 0] = _dot(turn[0], position) + from_x + deeper_m * cos
        xy[k, 1] = _dot(turn[1], position) + from_y + deeper_m * sin
        middle_m = _dot(in_body[2], position) + in_body_m[2]
        top[k], bottom[k] = middle_m + extent[1] / 2.0, middle_m - extent[1] / 2.0
        spread = one[_COVARIANCE].reshape(3, 3)
        for i in range(2):
            measured_mps[k, i] = _dot(turn[i], speed)
            if moving[k]:
                velocity[k, i] = measured_mps[k, i]
            for j in range(2):
                covariance[k, i, j] = (
                    turn[i, 0] * _dot(spread[0], turn[j])
                    + turn[i, 1] * _dot(spread[1], turn[j])
                    + turn[i, 2] * _dot(spread[2], turn[j])
                )
    return impossible, on_floor, covariance, sizes
