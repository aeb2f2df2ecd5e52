"""The obstacles of a scene as upright boxes on the floor, in the frame of the path."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hal.geometry import camera_in_floor
from hal.types import CameraMount, FloatArray, PlanarPose
from vision.scene import Obstacle, Scene

# Nothing in a hall is further, larger or faster: such numbers are faults of perception.
_FARTHEST_M = 200.0
_LARGEST_M = 50.0
_FASTEST_MPS = 15.0


class SceneError(Exception):
    """A scene says something impossible: which obstacle and what."""


@dataclass(frozen=True, slots=True, eq=False)
class Bodies:
    """N boxes at captured_ns.

    ids (N,). xy_m (N, 2) centre. velocity_mps (N, 2) over ground, 0 for what stands. surprise_mps (N, 2) by
    how much the newest measurement differs from that. covariance (N, 2, 2) of the velocity. half_view_m,
    half_across_m (N,) half sizes along and across view_rad (N,), the direction it was seen in. top_m (N,)
    height. moving (N,). age_s, unseen_s (N,) since they were seen first and last, at captured_ns.
    """

    captured_ns: int
    ids: NDArray[np.int64]
    xy_m: FloatArray
    velocity_mps: FloatArray
    surprise_mps: FloatArray
    covariance: FloatArray
    half_view_m: FloatArray
    half_across_m: FloatArray
    view_rad: FloatArray
    top_m: FloatArray
    moving: NDArray[np.bool_]
    age_s: FloatArray
    unseen_s: FloatArray

    def __len__(self) -> int:
        return len(self.ids)

    def select(self, chosen: NDArray[np.bool_]) -> Bodies:
        """Only the chosen ones."""
        if chosen.all():
            return self
        return Bodies(self.captured_ns, *(getattr(self, name)[chosen] for name in _ARRAYS))

    def joined(self, other: Bodies) -> Bodies:
        """These and, behind them, others; the time is that of these."""
        if not len(other):
            return self
        arrays = (np.concatenate((getattr(self, name), getattr(other, name))) for name in _ARRAYS)
        return Bodies(self.captured_ns, *arrays)

    def covers(self, points_m: FloatArray, reach_m: FloatArray, side_m: float) -> NDArray[np.bool_]:
        """(P, N) whether floor points (P, 2) lie on a body, within reach_m (P,) along the view and side_m."""
        offset = points_m[:, None, :] - self.xy_m
        cos, sin = np.cos(self.view_rad), np.sin(self.view_rad)
        along = np.abs(offset[..., 0] * cos + offset[..., 1] * sin)
        across = np.abs(offset[..., 1] * cos - offset[..., 0] * sin)
        return (along <= self.half_view_m + reach_m[:, None]) & (across <= self.half_across_m + side_m)


_ARRAYS = tuple(name for name in Bodies.__slots__ if name != "captured_ns")


def no_bodies(captured_ns: int) -> Bodies:
    """An empty scene's."""
    n = np.zeros(0)
    return Bodies(
        captured_ns,
        np.zeros(0, np.int64),
        np.zeros((0, 2)),
        np.zeros((0, 2)),
        np.zeros((0, 2)),
        np.zeros((0, 2, 2)),
        n,
        n,
        n,
        n,
        np.zeros(0, np.bool_),
        n,
        n,
    )


def bodies_of(scene: Scene, pose: PlanarPose, mount: CameraMount, depth_m: float) -> Bodies:
    """The obstacles of a scene whose camera was carried by a body at pose.

    depth_m: how deep a body is at least, counted from the surface that is seen: its back is hidden.
    Raises SceneError for values that are unknown or impossible.
    """
    if not scene.obstacles:
        return no_bodies(scene.captured_ns)
    optical = np.array([one.position_m for one in scene.obstacles], np.float64)
    extent = np.array([one.extent_m for one in scene.obstacles], np.float64)
    speed = np.array([one.velocity_mps for one in scene.obstacles], np.float64)
    spread = np.array([one.velocity_cov for one in scene.obstacles], np.float64)
    age = np.array([one.age_s for one in scene.obstacles], np.float64)
    unseen = np.array([one.unseen_s for one in scene.obstacles], np.float64)
    _check(scene.obstacles, optical, extent, speed, spread, age, unseen)
    camera = camera_in_floor(pose, mount)
    floor = camera.rotation[:2]
    position = camera.apply(optical)
    covariance = floor @ spread @ floor.T
    moving = np.array([one.moving for one in scene.obstacles], np.bool_)
    velocity = speed @ floor.T
    half_view = np.maximum(extent[:, 2], depth_m) / 2.0
    forward = np.array([math.cos(pose.heading_rad), math.sin(pose.heading_rad)])
    return Bodies(
        captured_ns=scene.captured_ns,
        ids=np.array([one.id for one in scene.obstacles], np.int64),
        xy_m=position[:, :2] + (half_view - extent[:, 2] / 2.0)[:, None] * forward,
        velocity_mps=np.where(moving[:, None], velocity, 0.0),
        surprise_mps=np.zeros_like(velocity),
        covariance=covariance,
        half_view_m=half_view,
        half_across_m=extent[:, 0] / 2.0,
        view_rad=np.full(len(moving), pose.heading_rad),
        top_m=position[:, 2] + extent[:, 1] / 2.0,
        moving=moving,
        age_s=age,
        unseen_s=unseen,
    )


def _check(
    obstacles: tuple[Obstacle, ...],
    position: FloatArray,
    extent: FloatArray,
    velocity: FloatArray,
    covariance: FloatArray,
    age: FloatArray,
    unseen: FloatArray,
) -> None:
    """Written so that NaN fails every comparison."""
    flat = covariance.reshape(len(obstacles), -1)
    reasonable = (
        (np.abs(position) <= _FARTHEST_M).all(axis=1)
        & ((extent >= 0.0) & (extent <= _LARGEST_M)).all(axis=1)
        & (np.abs(velocity) <= _FASTEST_MPS).all(axis=1)
        & np.isfinite(flat).all(axis=1)
        & (np.diagonal(covariance, axis1=1, axis2=2) >= 0.0).all(axis=1)
        & (age >= 0.0)
        & (unseen >= 0.0)
    )
    if reasonable.all():
        return
    k = int(reasonable.argmin())
    raise SceneError(
        f"obstacle {obstacles[k].id} is impossible: position {_list(position[k])} m, "
        f"size {_list(extent[k])} m, velocity {_list(velocity[k])} m/s"
    )


def _list(values: FloatArray) -> str:
    return "(" + ", ".join(f"{float(value):.2f}" for value in np.ravel(values)) + ")"
