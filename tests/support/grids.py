"""Depth grids made of planes and plates: every depth is known exactly, no image is needed.

Coordinates are the camera's optical axes: x right, y down, z forward.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray, Intrinsics
from vision.depth.depth_grid import BoolGrid, DepthGrid

STEP_PX = 4
OFFSET_PX = 1.5
CAMERA = Intrinsics(320, 240, 300.0, 300.0, 159.5, 119.5)
COLUMNS, ROWS = 80, 60
X = (OFFSET_PX + STEP_PX * np.arange(COLUMNS) - CAMERA.cx) / CAMERA.fx
Y = (OFFSET_PX + STEP_PX * np.arange(ROWS) - CAMERA.cy) / CAMERA.fy
LEVEL_UP = np.array([0.0, -1.0, 0.0])


def no_depth() -> FloatArray:
    """(ROWS, COLUMNS) of nothing measured."""
    return np.zeros((ROWS, COLUMNS))


def plane(up: FloatArray, camera_height_m: float) -> FloatArray:
    """Depth of the plane camera_height_m under the camera with unit normal up (3,), 0 above its horizon."""
    rise = up[0] * X[None, :] + up[1] * Y[:, None] + up[2]
    return np.where(rise < -1e-6, -camera_height_m / np.minimum(rise, -1e-6), 0.0)


def wall(depth_m: float) -> FloatArray:
    """Depth of a plane across the view."""
    return np.full((ROWS, COLUMNS), depth_m)


def plate(depth_m: float, x_m: tuple[float, float], y_m: tuple[float, float]) -> FloatArray:
    """Depth of an upright rectangle across the view, from x_m[0] to x_m[1] and from y_m[0] down to y_m[1]."""
    inside = (x_m[0] <= X * depth_m) & (x_m[1] >= X * depth_m)
    high = (y_m[0] <= Y * depth_m) & (y_m[1] >= Y * depth_m)
    return np.where(high[:, None] & inside[None, :], depth_m, 0.0)


def nearest(*depths_m: FloatArray) -> FloatArray:
    """What is seen of several surfaces at once."""
    all_m = np.stack(depths_m)
    seen = np.where(all_m > 0.0, all_m, np.inf).min(axis=0)
    return np.where(np.isfinite(seen), seen, 0.0)


def grid_of(
    depth_m: FloatArray, up: FloatArray | None = None, camera_height_m: float = 0.5, max_m: float = 10.0
) -> DepthGrid:
    """The grid of depth_m (ROWS, COLUMNS). up (3,): the floor's normal, None where it is not known."""
    beyond = depth_m > max_m
    valid: BoolGrid = (depth_m > 0.0) & ~beyond
    depth = np.where(valid, depth_m, 0.0)
    inverse = np.divide(1.0, depth, out=np.zeros_like(depth), where=valid)
    nan = float("nan")
    grid = DepthGrid(
        STEP_PX,
        OFFSET_PX,
        depth.astype(np.float32),
        inverse.astype(np.float32),
        valid,
        beyond,
        X.astype(np.float32),
        Y.astype(np.float32),
        depth.astype(np.float32),
        None,
        None,
        nan,
        nan,
        None,
        max_m,
    )
    if up is None:
        return grid
    rise = up[0] * X[None, :] + up[1] * Y[:, None] + up[2]
    return replace(
        grid,
        height_m=(camera_height_m + depth * rise).astype(np.float32),
        height_sigma_m=np.full(depth.shape, 0.01, np.float32),
        camera_height_m=camera_height_m,
        up=up,
    )


def labelled(*masks: NDArray[np.bool_]) -> NDArray[np.int32]:
    """(ROWS, COLUMNS) labels: 1 where the first mask is, 2 where the second, and so on; 0 elsewhere."""
    labels = np.zeros((ROWS, COLUMNS), np.int32)
    for number, mask in enumerate(masks, start=1):
        labels[mask] = number
    return labels


def block(rows: tuple[int, int], columns: tuple[int, int]) -> NDArray[np.bool_]:
    """(ROWS, COLUMNS) the cells from rows[0] up to rows[1], and from columns[0] up to columns[1]."""
    mask = np.zeros((ROWS, COLUMNS), np.bool_)
    mask[slice(*rows), slice(*columns)] = True
    return mask


def people(apart_m: float, tall_m: tuple[float, float] = (1.7, 1.7), head_m: float = 0.2) -> FloatArray:
    """Depth of two, 3 m away, whose heads are apart_m from each other; their bodies, 0.45 m wide, touch."""
    seen = [plate(3.0, (-apart_m / 2, apart_m / 2), (-0.2, 0.8))]
    for x_m, height_m in zip((-apart_m / 2, apart_m / 2), tall_m, strict=True):
        top_m = 0.9 - height_m
        seen.append(plate(3.0, (x_m - head_m / 2, x_m + head_m / 2), (top_m, top_m + 0.3)))
        seen.append(plate(3.0, (x_m - 0.225, x_m + 0.225), (top_m + 0.3, 0.9)))
    return nearest(*seen)
