"""Every n-th pixel of depth, with its height over the floor: what objects are made of and free space is read from."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.perception import PerceptionConfig
from hal.types import CameraMount, FloatArray, Intrinsics, RgbdFrame
from vision.depth_mask import depth_sigma_m

FloatGrid = NDArray[np.float32]
BoolGrid = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class DepthGrid:
    """Cell (i, j) is pixel (offset + step i, offset + step j) of the image.

    depth_m (h, w): 0 where not valid. valid (h, w). x (w,), y (h,): ray at z = 1 m. height_m (h, w):
    over the floor, and height_sigma_m (h, w); both NaN-free, None where the mounting is not known.
    forward_m (h, w): distance along the floor. pitch_rad: 0 where not known.
    """

    step_px: int
    offset_px: int
    depth_m: FloatGrid
    valid: BoolGrid
    x: FloatGrid
    y: FloatGrid
    forward_m: FloatGrid
    height_m: FloatGrid | None
    height_sigma_m: FloatGrid | None
    camera_height_m: float
    pitch_rad: float

    def columns(self, pixels_u: FloatArray) -> NDArray[np.intp]:
        """Grid columns of image columns, clipped to the grid."""
        index = np.rint((pixels_u - self.offset_px) / self.step_px).astype(np.intp)
        return np.clip(index, 0, self.depth_m.shape[1] - 1)

    def rows(self, pixels_v: FloatArray) -> NDArray[np.intp]:
        """Grid rows of image rows, clipped to the grid."""
        index = np.rint((pixels_v - self.offset_px) / self.step_px).astype(np.intp)
        return np.clip(index, 0, self.depth_m.shape[0] - 1)


def make_grid(frame: RgbdFrame, config: PerceptionConfig, mount: CameraMount | None) -> DepthGrid:
    """Sub-sample the depth of frame; depth outside [min_depth_m, max_depth_m] is not valid."""
    step = config.grid_step_px
    offset = step // 2
    depth_m = frame.depth[offset::step, offset::step] * np.float32(frame.depth_scale_m)
    valid = (depth_m >= config.min_depth_m) & (depth_m <= config.max_depth_m)
    depth_m *= valid
    x, y = _rays(frame.intrinsics, depth_m.shape, step, offset)
    if mount is None:
        return DepthGrid(step, offset, depth_m, valid, x, y, depth_m, None, None, float("nan"), 0.0)
    cos_pitch, sin_pitch = math.cos(mount.pitch_rad), math.sin(mount.pitch_rad)
    drop = (y * cos_pitch + sin_pitch).astype(np.float32)  # metres down per metre of depth
    height_m = np.float32(mount.height_m) - depth_m * drop[:, None]
    sigma_m = depth_sigma_m(depth_m, config.depth_noise)
    forward_m = depth_m * (cos_pitch - y * sin_pitch).astype(np.float32)[:, None]
    height_sigma_m = sigma_m * np.abs(drop)[:, None]
    return DepthGrid(
        step,
        offset,
        depth_m,
        valid,
        x,
        y,
        forward_m,
        height_m,
        height_sigma_m,
        mount.height_m,
        mount.pitch_rad,
    )


def _rays(camera: Intrinsics, shape: tuple[int, ...], step: int, offset: int) -> tuple[FloatGrid, FloatGrid]:
    u = offset + step * np.arange(shape[1], dtype=np.float32)
    v = offset + step * np.arange(shape[0], dtype=np.float32)
    x: FloatGrid = ((u - np.float32(camera.cx)) / np.float32(camera.fx)).astype(np.float32)
    y: FloatGrid = ((v - np.float32(camera.cy)) / np.float32(camera.fy)).astype(np.float32)
    return x, y
