"""The obstacles of a scene as upright boxes on the floor, in the frame of the path."""

from __future__ import annotations

import math
from dataclasses import dataclass
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from hal.geometry import camera_in_floor
from hal.types import CameraMount, FloatArray, PlanarPose
from vision.scene import Obstacle, Scene

# Nothing in a hall is further, larger or faster: such numbers are faults of perception.
_FARTHEST_M = 200.0
_LARGEST_M = 50.0
_FASTEST_MPS = 15.0
# What is measured of an obstacle, in a row, and between which bounds it is possible.
_POSITION, _EXTENT, _VELOCITY, _COVARIANCE = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 18)
_MOST = np.repeat([_FARTHEST_M, _LARGEST_M, _FASTEST_MPS, np.finfo(np.float64).max], (3, 3, 3, 9))
_LEAST = -_MOST
_LEAST[_EXTENT] = _LEAST[[9, 13, 17]] = 0.0  # and the variances


class SceneError(Exception):
    """A scene says something impossible: which obstacle and what."""


@dataclass(frozen=True, slots=True, eq=False)
class Bodies:
    """N boxes at captured_ns.

    ids (N,). xy_m (N, 2) centre. velocity_mps (N, 2) over ground, 0 for what stands; measured_mps (N, 2) as
    perception says, whether it stands or moves. surprise_mps (N, 2) by how much the newest measurement
    differs from velocity_mps. covariance (N, 2, 2) of the velocity. half_view_m, half_across_m (N,) half
    sizes along and across view_rad (N,), the direction it was seen in. top_m, bottom_m (N,) over the
    floor. moving (N,).
    age_s, unseen_s (N,) since they were seen first and last, at captured_ns. tracked_s (N,) since they were
    seen first under this number: for so long velocities were measured.
    """

    captured_ns: int
    ids: NDArray[np.int64]
    xy_m: FloatArray
    velocity_mps: FloatArray
    measured_mps: FloatArray
    surprise_mps: FloatArray
    covariance: FloatArray
    half_view_m: FloatArray
    half_across_m: FloatArray
    view_rad: FloatArray
    top_m: FloatArray
    bottom_m: FloatArray
    moving: NDArray[np.bool_]
    age_s: FloatArray
    unseen_s: FloatArray
    tracked_s: FloatArray

    def __len__(self) -> int:
        return len(self.ids)

    def select(self, chosen: NDArray[np.bool_]) -> Bodies:
        """Only the chosen ones."""
        rows = chosen.nonzero()[0]
        if len(rows) == len(chosen):
            return self
        if not len(rows):
            return no_bodies(self.captured_ns)
        # For a few rows, take() is ten times as fast as an index.
        return Bodies(self.captured_ns, *[array.take(rows, 0) for array in _arrays_of(self)])

    def joined(self, other: Bodies) -> Bodies:
        """These and, behind them, others; the time is that of these."""
        if not len(other):
            return self
        if not len(self):
            return Bodies(self.captured_ns, *_arrays_of(other))
        pairs = zip(_arrays_of(self), _arrays_of(other), strict=True)
        return Bodies(self.captured_ns, *[np.concatenate(pair) for pair in pairs])

    def covers(self, points_m: FloatArray, reach_m: FloatArray, side_m: float) -> NDArray[np.bool_]:
        """(P, N) whether floor points (P, 2) lie on a body, within reach_m (P,) along the view and side_m."""
        offset = points_m[:, None, :] - self.xy_m
        cos, sin = np.cos(self.view_rad), np.sin(self.view_rad)
        along = np.abs(offset[..., 0] * cos + offset[..., 1] * sin)
        across = np.abs(offset[..., 1] * cos - offset[..., 0] * sin)
        return (along <= self.half_view_m + reach_m[:, None]) & (across <= self.half_across_m + side_m)


_arrays_of = attrgetter(*(name for name in Bodies.__slots__ if name != "captured_ns"))
_NOBODY = Bodies(
    captured_ns=0,
    ids=np.zeros(0, np.int64),
    xy_m=np.zeros((0, 2)),
    velocity_mps=np.zeros((0, 2)),
    measured_mps=np.zeros((0, 2)),
    surprise_mps=np.zeros((0, 2)),
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


def no_bodies(captured_ns: int) -> Bodies:
    """An empty scene's."""
    return Bodies(captured_ns, *_arrays_of(_NOBODY))


def bodies_of(scene: Scene, pose: PlanarPose, mount: CameraMount, depth_m: float) -> Bodies:
    """The obstacles of a scene whose camera was carried by a body at pose.

    depth_m: how deep a body is at least, counted from the surface that is seen: its back is hidden.
    Raises SceneError for values that are unknown or impossible.
    """
    if not scene.obstacles:
        return no_bodies(scene.captured_ns)
    measured = np.concatenate(
        [
            values
            for one in scene.obstacles
            for values in (one.position_m, one.extent_m, one.velocity_mps, one.velocity_cov.ravel())
        ],
        dtype=np.float64,
    ).reshape(-1, len(_MOST))
    seen_s = np.array([(one.age_s, one.unseen_s) for one in scene.obstacles], np.float64)
    _check(scene.obstacles, measured, seen_s)
    optical, extent, speed = measured[:, _POSITION], measured[:, _EXTENT], measured[:, _VELOCITY]
    spread = measured[:, _COVARIANCE].reshape(-1, 3, 3)
    camera = camera_in_floor(pose, mount)
    floor = camera.rotation[:2]
    position = camera.apply(optical)
    covariance = floor @ spread @ floor.T
    moving = np.array([one.moving for one in scene.obstacles], np.bool_)
    velocity = speed @ floor.T
    half_across, half_height, half_seen = (extent / 2.0).T
    half_view = np.maximum(half_seen, depth_m / 2.0)
    forward = np.array([math.cos(pose.heading_rad), math.sin(pose.heading_rad)])
    return Bodies(
        captured_ns=scene.captured_ns,
        ids=np.array([one.id for one in scene.obstacles], np.int64),
        xy_m=position[:, :2] + (half_view - half_seen)[:, None] * forward,
        velocity_mps=np.where(moving[:, None], velocity, 0.0),
        measured_mps=velocity,
        surprise_mps=np.zeros(velocity.shape),
        covariance=covariance,
        half_view_m=half_view,
        half_across_m=half_across,
        view_rad=np.full(len(moving), pose.heading_rad),
        top_m=position[:, 2] + half_height,
        bottom_m=position[:, 2] - half_height,
        moving=moving,
        age_s=seen_s[:, 0],
        unseen_s=seen_s[:, 1],
        tracked_s=seen_s[:, 0],
    )


def _check(obstacles: tuple[Obstacle, ...], measured: FloatArray, seen_s: FloatArray) -> None:
    """Written so that NaN fails every comparison."""
    possible, known = (measured >= _LEAST) & (measured <= _MOST), seen_s >= 0.0
    if possible.all() and known.all():
        return
    k = int((possible.all(axis=1) & known.all(axis=1)).argmin())
    position, extent, velocity = (measured[k, part] for part in (_POSITION, _EXTENT, _VELOCITY))
    raise SceneError(
        f"obstacle {obstacles[k].id} is impossible: position {_list(position)} m, "
        f"size {_list(extent)} m, velocity {_list(velocity)} m/s"
    )


def _list(values: FloatArray) -> str:
    return "(" + ", ".join(f"{float(value):.2f}" for value in np.ravel(values)) + ")"
