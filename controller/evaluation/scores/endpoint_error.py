"""Endpoint error: the tracked ends of fragments against the true flow, by distance (paper: Fig. 5).

For static scenes with a moving camera. Where a fragment is tracked from one frame to the next, each of its
two ends has an estimated flow. The true flow of that surface point follows from the true depth and the
camera's true motion. On the outline of an object the pixel itself may belong to the background, but an
outline belongs to the nearer surface. So the depth is the smallest of the 3x3 pixels around the end.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray, Intrinsics, Pose
from vision.scene import Fragments

DISTANCE_BINS_M = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
_NEAR_M = 0.05  # points nearer to the camera than this are left out


@dataclass(frozen=True, slots=True, eq=False)
class EndpointErrors:
    """Errors of N tracked ends, each array (N,).

    distance_m: depth of the surface.
    error_px: tracked end minus its true place, magnitude.
    flow_px: magnitude of the true flow.
    """

    distance_m: FloatArray
    error_px: FloatArray
    flow_px: FloatArray

    @staticmethod
    def none() -> EndpointErrors:
        """An empty set."""
        return EndpointErrors(np.empty(0), np.empty(0), np.empty(0))

    def __add__(self, other: EndpointErrors) -> EndpointErrors:
        return EndpointErrors(
            np.concatenate([self.distance_m, other.distance_m]),
            np.concatenate([self.error_px, other.error_px]),
            np.concatenate([self.flow_px, other.flow_px]),
        )


def endpoint_errors(
    before: Fragments, now: Fragments, depth_m: NDArray[np.float32], motion: Pose, k: Intrinsics
) -> EndpointErrors:
    """The errors of the fragments that are in both frames.

    depth_m: (H, W) true depth of the previous frame, 0 where there is no surface.
    motion: pose of the previous camera in the current one.
    """
    _, old, new = np.intersect1d(before.ids, now.ids, assume_unique=True, return_indices=True)
    start = before.ends_px[old].reshape(-1, 2).astype(np.float64)
    end = now.ends_px[new].reshape(-1, 2).astype(np.float64)
    z = _nearest_m(start, depth_m)
    points = np.column_stack([(start - (k.cx, k.cy)) / (k.fx, k.fy) * z[:, None], z])
    transformed = motion.apply(points)
    known = np.isfinite(z) & (transformed[:, 2] > _NEAR_M)
    true_px = transformed[known, :2] / transformed[known, 2:] * (k.fx, k.fy) + (k.cx, k.cy)
    return EndpointErrors(
        z[known], np.hypot(*(end[known] - true_px).T), np.hypot(*(true_px - start[known]).T)
    )  # fmt: skip


def _nearest_m(points_px: FloatArray, depth_m: NDArray[np.float32]) -> FloatArray:
    """(N,) the smallest depth of the 3x3 pixels around each point; NaN where none has depth."""
    height, width = depth_m.shape
    steps = np.array([(dv, du) for dv in (-1, 0, 1) for du in (-1, 0, 1)])
    neighbours = np.rint(points_px[:, ::-1]).astype(np.intp)[:, None] + steps
    neighbours = np.clip(neighbours, 0, (height - 1, width - 1))
    z = depth_m[neighbours[..., 0], neighbours[..., 1]].astype(np.float64)
    nearest = np.where(z > 0.0, z, np.inf).min(axis=1)
    return np.where(np.isfinite(nearest), nearest, np.nan)
