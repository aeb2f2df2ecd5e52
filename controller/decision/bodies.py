"""The obstacles of a scene as upright boxes on the floor, in the frame of the path: Bodies."""

from __future__ import annotations

import math
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled, inlined
from hal.geometry import camera_in_body
from hal.records import record
from hal.types import CameraMount, Flags, FloatArray, Integers, Matrices, Matrix, PlanarPose, Vector
from vision.scene import Scene

# Nothing in a hall is farther away, larger or faster: such numbers are faults of perception.
_FARTHEST_M, _LARGEST_M, _FASTEST_MPS = 200.0, 50.0, 15.0
# Columns of what is measured of an obstacle, and the bounds of possible values.
_POSITION, _EXTENT, _VELOCITY, _COVARIANCE = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 18)
_MAX = np.repeat([_FARTHEST_M, _LARGEST_M, _FASTEST_MPS, np.finfo(np.float64).max], (3, 3, 3, 9))
_MIN = -_MAX
_MIN[_EXTENT] = _MIN[[9, 13, 17]] = 0.0  # and the variances


class SceneError(Exception):
    """A scene contains impossible values: which obstacle, and which values."""


@record(frozen=True, slots=True, eq=False)
class Bodies:
    """N boxes at captured_ns.

    ids: (N,) of their tracks.
    xy_m: (N, 2) centre.
    velocity_mps: (N, 2) over ground; 0 for bodies judged standing.
    measured_mps: (N, 2) as perception measured it, whether standing or moving.
    innovation_mps: (N, 2) by how much the newest measurement differs from velocity_mps.
    covariance: (N, 2, 2) of the velocity.
    half_view_m, half_across_m: (N,) half sizes along and across view_rad, the direction of view.
    top_m, bottom_m: (N,) heights over the floor.
    moving: (N,) whether judged moving.
    age_s, unseen_s: (N,) time since first and last seen, at captured_ns.
    tracked_s: (N,) time since first seen under this id, for which velocities were measured.
    """

    captured_ns: int
    ids: Integers
    xy_m: Matrix
    velocity_mps: Matrix
    measured_mps: Matrix
    innovation_mps: Matrix
    covariance: Matrices
    half_view_m: Vector
    half_across_m: Vector
    view_rad: Vector
    top_m: Vector
    bottom_m: Vector
    moving: Flags
    age_s: Vector
    unseen_s: Vector
    tracked_s: Vector

    def __len__(self) -> int:
        return len(self.ids)

    def select(self, chosen: NDArray[np.bool_]) -> Bodies:
        """Only the bodies in the mask chosen (N,)."""
        rows = chosen.nonzero()[0]
        if len(rows) == len(chosen):
            return self
        if not len(rows):
            return no_bodies(self.captured_ns)
        first, end = int(rows[0]), int(rows[-1]) + 1
        if end - first == len(rows):  # adjacent rows, the usual case: no copy is needed
            return Bodies(self.captured_ns, *[array[first:end] for array in _arrays_of(self)])
        # For a few rows, take() is ten times as fast as an index.
        return Bodies(self.captured_ns, *[array.take(rows, 0) for array in _arrays_of(self)])

    def moved_to(self, captured_ns: int, xy_m: FloatArray, unseen_s: FloatArray) -> Bodies:
        """The same bodies at a later time, at xy_m (N, 2)."""
        return Bodies(
            captured_ns,
            self.ids,
            xy_m,
            self.velocity_mps,
            self.measured_mps,
            self.innovation_mps,
            self.covariance,
            self.half_view_m,
            self.half_across_m,
            self.view_rad,
            self.top_m,
            self.bottom_m,
            self.moving,
            self.age_s,
            unseen_s,
            self.tracked_s,
        )

    def joined(self, other: Bodies) -> Bodies:
        """These bodies followed by the other ones; the time is that of these."""
        if not len(other):
            return self
        if not len(self):
            return Bodies(self.captured_ns, *_arrays_of(other))
        pairs = zip(_arrays_of(self), _arrays_of(other), strict=True)
        return Bodies(self.captured_ns, *map(np.concatenate, pairs))

    def covers(self, points_m: FloatArray, reach_m: FloatArray, side_m: float) -> NDArray[np.bool_]:
        """(P, N) which floor points (P, 2) lie on which body; reach_m (P,) along the view, side_m across."""
        return _covers(self, points_m, reach_m, side_m)


_arrays_of = attrgetter(*(name for name in Bodies.__slots__ if name != "captured_ns"))
_NOBODY = Bodies(
    captured_ns=0,
    ids=np.zeros(0, np.int64),
    xy_m=np.zeros((0, 2)),
    velocity_mps=np.zeros((0, 2)),
    measured_mps=np.zeros((0, 2)),
    innovation_mps=np.zeros((0, 2)),
    covariance=np.zeros((0, 2, 2)),
    half_view_m=np.zeros(0),
    half_across_m=np.zeros(0),
    view_rad=np.zeros(0),
    top_m=np.zeros(0),
    bottom_m=np.zeros(0),
    moving=np.zeros(0, np.bool_),
    age_s=np.zeros(0),
    unseen_s=np.zeros(0),
    tracked_s=np.zeros(0),
)
_NO_ARRAYS = _arrays_of(_NOBODY)


def no_bodies(captured_ns: int) -> Bodies:
    """The bodies of an empty scene."""
    return Bodies(captured_ns, *_NO_ARRAYS)


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
    said = np.array([(one.age_s, one.unseen_s, one.moving) for one in scene.obstacles], np.float64)
    age_s, unseen_s, moving = said[:, 0], said[:, 1], said[:, 2] > 0.0
    camera = camera_in_body(mount)
    impossible, on_floor, covariance, sizes = _boxes(
        measured,
        age_s,
        unseen_s,
        moving,
        depth_m,
        camera.rotation,
        camera.translation_m,
        pose.x_m,
        pose.y_m,
        pose.heading_rad,
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


@compiled(Bodies, "float64[:, :], float64[:], float64")
def _covers(bodies: Bodies, points_m: FloatArray, reach_m: FloatArray, side_m: float) -> NDArray[np.bool_]:
    """As Bodies.covers."""
    covered = np.empty((len(points_m), len(bodies.xy_m)), np.bool_)
    for k in range(len(bodies.xy_m)):
        cos, sin = math.cos(bodies.view_rad[k]), math.sin(bodies.view_rad[k])
        half_view_m, half_across_m = bodies.half_view_m[k], bodies.half_across_m[k] + side_m
        for i in range(len(points_m)):
            dx, dy = points_m[i, 0] - bodies.xy_m[k, 0], points_m[i, 1] - bodies.xy_m[k, 1]
            along_m, across_m = abs(dx * cos + dy * sin), abs(dy * cos - dx * sin)
            covered[i, k] = along_m <= half_view_m + reach_m[i] and across_m <= half_across_m
    return covered


@inlined
def _dot(one: FloatArray, other: FloatArray) -> float:
    """Scalar product of two vectors (3,)."""
    return float(one[0] * other[0] + one[1] * other[1] + one[2] * other[2])


@compiled(
    "float64[:, ::1], float64[:], float64[:], boolean[::1], float64, float64[:, :], float64[:],"
    "float64, float64, float64"
)
def _boxes(
    measured: FloatArray,
    age_s: FloatArray,
    unseen_s: FloatArray,
    moving: NDArray[np.bool_],
    depth_m: float,
    in_body: FloatArray,
    in_body_m: FloatArray,
    x_m: float,
    y_m: float,
    heading_rad: float,
) -> tuple[int, FloatArray, FloatArray, FloatArray]:
    """Index of the first impossible one of N obstacles (-1: none), and fields of Bodies.

    These are (4, N, 2) xy_m, measured_mps, velocity_mps, innovation_mps; the covariance; (5, N) half_view_m,
    half_across_m, view_rad, top_m, bottom_m. in_body (3, 3), in_body_m (3,): pose of the camera in the robot.
    """
    count, impossible = len(measured), -1
    on_floor, covariance, sizes = np.zeros((4, count, 2)), np.empty((count, 2, 2)), np.empty((5, count))
    xy, measured_mps, velocity, _ = on_floor
    half_view, half_across, view_rad, top, bottom = sizes
    view_rad[:] = heading_rad
    cos, sin, turn = math.cos(heading_rad), math.sin(heading_rad), np.empty((2, 3))
    for j in range(3):
        turn[0, j] = cos * in_body[0, j] - sin * in_body[1, j]
        turn[1, j] = sin * in_body[0, j] + cos * in_body[1, j]
    from_x = x_m + cos * in_body_m[0] - sin * in_body_m[1]
    from_y = y_m + sin * in_body_m[0] + cos * in_body_m[1]
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
