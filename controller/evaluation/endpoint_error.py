"""How well fragments are followed: their tracked ends against the true flow, by distance (paper: Fig. 5).

Static scene, moving camera. A fragment that is known in two frames in a row has moved each end by an
estimated flow; true depth and the true motion of the camera say where the surface point there really
went. At the outline of a thing the pixel may belong to what lies behind it, so the depth is the
smallest of the 3x3 pixels around the end: outlines belong to the nearer side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray, Intrinsics, Pose
from vision.scene import Fragments

DISTANCE_BINS_M = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
_NEAR_M = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class EndpointErrors:
    """Of N tracked ends: distance_m (N,) of the surface, error_px (N,), flow_px (N,): of the true flow."""

    distance_m: FloatArray
    error_px: FloatArray
    flow_px: FloatArray

    @staticmethod
    def none() -> EndpointErrors:
        """No end at all."""
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
    """depth_m (H, W): true, of the frame before, 0 where nothing is. motion: that camera in the one now."""
    _, old, new = np.intersect1d(before.ids, now.ids, assume_unique=True, return_indices=True)
    start = before.ends_px[old].reshape(-1, 2).astype(np.float64)
    end = now.ends_px[new].reshape(-1, 2).astype(np.float64)
    z = _nearest_m(start, depth_m)
    points = np.column_stack([(start - (k.cx, k.cy)) / (k.fx, k.fy) * z[:, None], z])
    there = motion.apply(points)
    known = np.isfinite(z) & (there[:, 2] > _NEAR_M)
    true = there[known, :2] / there[known, 2:] * (k.fx, k.fy) + (k.cx, k.cy)
    return EndpointErrors(
        z[known], np.hypot(*(end[known] - true).T), np.hypot(*(true - start[known]).T)
    )  # fmt: skip


def _nearest_m(points_px: FloatArray, depth_m: NDArray[np.float32]) -> FloatArray:
    """(N,) the smallest depth in the 3x3 pixels around each point; NaN where there is none."""
    height, width = depth_m.shape
    steps = np.array([(dv, du) for dv in (-1, 0, 1) for du in (-1, 0, 1)])
    around = np.rint(points_px[:, ::-1]).astype(np.intp)[:, None] + steps
    around = np.clip(around, 0, (height - 1, width - 1))
    z = depth_m[around[..., 0], around[..., 1]].astype(np.float64)
    nearest = np.where(z > 0.0, z, np.inf).min(axis=1)
    return np.where(np.isfinite(nearest), nearest, np.nan)
