"""A coarse grid of depth with its height over the floor; bodies and free space are read from it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from config.perception import PerceptionConfig
from hal.types import CameraMount, DepthImage, FloatArray, Intrinsics, RgbdFrame
from vision.depth.depth_mask import depth_sigma_m, measurable_m

FloatGrid = NDArray[np.float32]
BoolGrid = NDArray[np.bool_]

# Noise of a cell's height over what one pixel's depth would make: of a median of many pixels, but neighbours,
# so not as little as their count tells. An estimate; standing() in vision/depth/regions.py has a margin
# beside it. From one look to another it has been measured, and is more: _CELL_NOISE_OVER_TIME in
# vision/bodies/arrivals.py.
CELL_HEIGHT_NOISE = 0.4
_FARTHEST = np.uint16(65535)  # raw depth of what is not valid: sorts behind all that is
_NEAREST_M = 0.1  # nearer, a point projects anywhere
_AGREE_INVERSE = 0.03  # 1/m: two of a cell's four samples further apart lie on two surfaces


@dataclass(frozen=True, slots=True, eq=False)
class DepthGrid:
    """Cell (i, j) stands for the pixels around (offset + step i, offset + step j) of the image.

    depth_m (h, w): 0 where not valid. inverse_depth (h, w): 0 where not valid. valid (h, w).
    beyond (h, w): measured, but farther than range_m: seen through up to there at least. range_m: the depth
    mask's, or as far as 16 bits go in the camera's unit.
    x (w,), y (h,): ray at z = 1 m. forward_m (h, w): distance along the floor. height_m (h, w) over the
    floor, height_sigma_m (h, w) and up (3,), the floor's normal in optical axes: None where the floor is not
    known. pitch_rad: of the mounting, NaN where the mounting is not known.
    """

    step_px: int
    offset_px: float
    depth_m: FloatGrid
    inverse_depth: FloatGrid
    valid: BoolGrid
    beyond: BoolGrid
    x: FloatGrid
    y: FloatGrid
    forward_m: FloatGrid
    height_m: FloatGrid | None
    height_sigma_m: FloatGrid | None
    camera_height_m: float
    pitch_rad: float
    up: FloatArray | None
    range_m: float

    def columns(self, pixels_u: FloatArray) -> NDArray[np.intp]:
        """Grid columns of image columns, clipped to the grid."""
        index = np.rint((pixels_u - self.offset_px) / self.step_px).astype(np.intp)
        clipped: NDArray[np.intp] = np.minimum(np.maximum(index, 0), self.depth_m.shape[1] - 1)
        return clipped

    def rows(self, pixels_v: FloatArray) -> NDArray[np.intp]:
        """Grid rows of image rows, clipped to the grid."""
        index = np.rint((pixels_v - self.offset_px) / self.step_px).astype(np.intp)
        clipped: NDArray[np.intp] = np.minimum(np.maximum(index, 0), self.depth_m.shape[0] - 1)
        return clipped

    def cells(self, pixels_u: FloatArray, pixels_v: FloatArray) -> NDArray[np.intp]:
        """Flat grid cells of image points, clipped to the grid."""
        flat: NDArray[np.intp] = self.rows(pixels_v) * self.depth_m.shape[1] + self.columns(pixels_u)
        return flat

    def points(self, cells: NDArray[np.intp]) -> FloatGrid:
        """(3, K) camera coordinates of flat cell indices (K,)."""
        rows = cells // self.depth_m.shape[1]
        columns = cells - rows * self.depth_m.shape[1]
        depth = self.depth_m.ravel().take(cells)
        result = np.empty((3, len(cells)), np.float32)
        np.multiply(self.x.take(columns), depth, out=result[0])
        np.multiply(self.y.take(rows), depth, out=result[1])
        result[2] = depth
        return result

    def project(self, points: FloatGrid) -> tuple[NDArray[np.intp], BoolGrid, FloatGrid]:
        """Flat cell index (K,) of camera coordinates (3, K), which of them fall into the grid, and their
        inverse depths, those of the nearest 10 cm cut off."""
        height, width = self.depth_m.shape
        x, y, z = points
        inverse = np.reciprocal(np.maximum(z, np.float32(_NEAREST_M)))
        column = (x * inverse - self.x[0]) * (1.0 / (self.x[1] - self.x[0])) + 0.5
        row = (y * inverse - self.y[0]) * (1.0 / (self.y[1] - self.y[0])) + 0.5
        inside = (z > _NEAREST_M) & (column >= 0) & (row >= 0) & (column < width) & (row < height)
        flat = row.astype(np.int32) * width + column.astype(np.int32)
        return (flat * inside.view(np.uint8)).astype(np.intp), inside, inverse


@np.errstate(divide="ignore")  # what comes of a division by zero is left out; once, for it takes a while
def make_grid(frame: RgbdFrame, config: PerceptionConfig, mount: CameraMount | None) -> DepthGrid:
    """Sub-sample the depth of frame; depth outside [min_depth_m, max_depth_m] is not valid, nor is the
    largest number, at which far depth is cut off."""
    step = config.grid_step_px
    scale_m = frame.depth_scale_m
    if step >= 4:
        raw, offset = _four_samples(frame.depth, step, scale_m), step // 4 + 0.5 * (step // 2)
    else:
        raw, offset = frame.depth[step // 2 :: step, step // 2 :: step], float(step // 2)
    depth_m = raw * np.float32(scale_m)
    range_m = measurable_m(config.max_depth_m, scale_m)
    beyond = depth_m > range_m
    valid = (depth_m >= config.min_depth_m) & ~beyond
    inverse = _smooth(raw, scale_m, _inverted(depth_m, valid), valid)
    depth_m = _inverted(inverse, valid)
    view = _view(frame.intrinsics, mount, depth_m.shape, step, offset)
    x, y = view.x, view.y
    if mount is None:
        nan = float("nan")
        return DepthGrid(
            step_px=step,
            offset_px=offset,
            depth_m=depth_m,
            inverse_depth=inverse,
            valid=valid,
            beyond=beyond,
            x=x,
            y=y,
            forward_m=depth_m,
            height_m=None,
            height_sigma_m=None,
            camera_height_m=nan,
            pitch_rad=nan,
            up=None,
            range_m=range_m,
        )
    sigma_m = np.float32(CELL_HEIGHT_NOISE) * depth_sigma_m(depth_m, config.depth_noise)
    return DepthGrid(
        step_px=step,
        offset_px=offset,
        depth_m=depth_m,
        inverse_depth=inverse,
        valid=valid,
        beyond=beyond,
        x=x,
        y=y,
        forward_m=depth_m * view.ahead,
        height_m=np.float32(mount.height_m) - depth_m * view.drop,
        height_sigma_m=sigma_m * np.abs(view.drop),
        camera_height_m=mount.height_m,
        pitch_rad=mount.pitch_rad,
        up=np.array([0.0, -math.cos(mount.pitch_rad), -math.sin(mount.pitch_rad)]),
        range_m=range_m,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """Where the cells look: x (w,), y (h,) as in DepthGrid. ahead, drop (h, 1): metres along the floor and
    metres down per metre of depth."""

    x: FloatGrid
    y: FloatGrid
    ahead: FloatGrid
    drop: FloatGrid


@lru_cache(maxsize=4)
def _view(
    camera: Intrinsics, mount: CameraMount | None, shape: tuple[int, int], step: int, offset: float
) -> _View:
    """The same in every frame of one camera."""
    u = (offset + step * np.arange(shape[1])).astype(np.float32)
    v = (offset + step * np.arange(shape[0])).astype(np.float32)
    x = (u - np.float32(camera.cx)) / np.float32(camera.fx)
    y = (v - np.float32(camera.cy)) / np.float32(camera.fy)
    pitch_rad = 0.0 if mount is None else mount.pitch_rad
    cosine, sine = np.float32(math.cos(pitch_rad)), np.float32(math.sin(pitch_rad))
    view = _View(x, y, (cosine - y * sine)[:, None], (y * cosine + sine)[:, None])
    for values in (view.x, view.y, view.ahead, view.drop):
        values.setflags(write=False)
    return view


def _inverted(values: FloatGrid, valid: BoolGrid) -> FloatGrid:
    """1 / values where valid, else 0. valid values are not zero; what comes of the others is left out."""
    inverted = np.float32(1.0) / values
    return np.asarray(cv2.copyTo(inverted, valid.view(np.uint8)), np.float32)


def _smooth(raw: DepthImage, scale_m: float, inverse: FloatGrid, valid: BoolGrid) -> FloatGrid:
    """Median over 5x5 cells, but a cell that differs much keeps its own: a thin pole, a rim of a body.

    The middle one of raw depths is that of their inverses, and whole numbers are sorted faster. Without
    data, an inverse depth of 0, is the farthest.
    """
    known = np.maximum(raw, (~valid).view(np.uint8) * _FARTHEST)
    middle = np.asarray(cv2.medianBlur(known, 5), np.uint16)
    median = _inverted(middle * np.float32(scale_m), middle < _FARTHEST)
    same = valid & (np.abs(inverse - median) <= np.float32(_AGREE_INVERSE))
    return np.asarray(cv2.copyTo(median, same.view(np.uint8), inverse), np.float32)


def _four_samples(depth: DepthImage, step: int, scale_m: float) -> DepthImage:
    """One value per step x step block out of four samples: the mean of the middle two, or, where these
    lie on two surfaces, the nearer. A block with more than one sample without data has none."""
    rows, columns = depth.shape[0] // step * step, depth.shape[1] // step * step
    low, high = step // 4, step // 4 + step // 2
    a, b, c, d = (
        np.ascontiguousarray(depth[row:rows:step, column:columns:step])
        for row in (low, high)
        for column in (low, high)
    )
    first = np.maximum(np.minimum(a, b), np.minimum(c, d))
    second = np.minimum(np.maximum(a, b), np.maximum(c, d))
    nearer, farther = np.minimum(first, second), np.maximum(first, second)
    gap = farther - nearer
    # 1/nearer - 1/farther <= k, without a division; in one type each, or NumPy converts piece by piece.
    reach = nearer.astype(np.float32)
    reach *= farther.astype(np.float32)
    reach *= np.float32(_AGREE_INVERSE * scale_m)
    same = gap.astype(np.float32) <= reach
    gap >>= 1
    gap *= same.astype(np.uint16)
    nearer += gap
    return nearer
