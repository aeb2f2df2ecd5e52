"""A coarse grid of depth with its height over the floor; bodies and free space are read from it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from config.perception import PerceptionConfig
from hal.compiled import compiled, inlined
from hal.types import CameraMount, DepthImage, FloatArray, Intrinsics, RgbdFrame
from vision.depth.depth_mask import measurable_m
from vision.depth.depth_noise import depth_sigma_of

FloatGrid = NDArray[np.float32]
BoolGrid = NDArray[np.bool_]

# Noise of a cell's height over what one pixel's depth would make: of a median of many pixels, but neighbours,
# so not as little as their count tells. An estimate; standing() in vision/depth/connected.py has a margin
# beside it. From one look to another it has been measured, and is more: _CELL_NOISE_OVER_TIME in
# vision/bodies/arrivals.py.
CELL_HEIGHT_NOISE = 0.4
_FARTHEST = np.uint16(65535)  # raw depth of what is not valid: sorts behind all that is
_LEAST_SIDE_PX = 32  # as config/recording.py and config/camera.py ask for
_FOUR_FROM_PX = 4  # cells so large take four samples each, smaller ones their middle pixel
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


@inlined
def nearest_cell(pixel: float, offset_px: float, step_px: float, count: int) -> int:
    """The row of a pixel's v, or the column of its u, in a grid of so many: the last one beyond the rim."""
    return min(max(int(np.rint((pixel - offset_px) / step_px)), 0), count - 1)


def make_grid(frame: RgbdFrame, config: PerceptionConfig, mount: CameraMount | None) -> DepthGrid:
    """Sub-sample the depth of frame; depth outside [min_depth_m, max_depth_m] is not valid, nor is the
    largest number, at which far depth is cut off.

    Raises ValueError for an image of less than 32 x 32 pixels: what looks around a pixel has no room there.
    """
    if min(frame.depth.shape) < _LEAST_SIDE_PX:
        sides = f"{frame.depth.shape[1]}x{frame.depth.shape[0]}"
        raise ValueError(f"depth of {sides} pixels, where at least {_LEAST_SIDE_PX} are needed each way")
    step, scale_m = config.grid_step_px, np.float32(frame.depth_scale_m)
    range_m = measurable_m(config.max_depth_m, frame.depth_scale_m)
    offset = step // 4 + 0.5 * (step // 2) if step >= _FOUR_FROM_PX else float(step // 2)
    raw, valid, beyond = _sampled(
        np.ascontiguousarray(frame.depth), step, scale_m, np.float32(config.min_depth_m), np.float32(range_m)
    )
    # The middle one of raw depths is that of their inverses, and whole numbers are sorted faster.
    middle = np.asarray(cv2.medianBlur(raw, 5), np.uint16)
    inverse, depth_m = _smoothed(raw, middle, scale_m)
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
    noise = config.depth_noise
    forward_m, height_m, height_sigma_m = _over_floor(
        depth_m,
        view.ahead,
        view.drop,
        np.float32(mount.height_m),
        np.float32(noise.floor_m),
        np.float32(noise.quadratic_per_m),
    )
    return DepthGrid(
        step_px=step,
        offset_px=offset,
        depth_m=depth_m,
        inverse_depth=inverse,
        valid=valid,
        beyond=beyond,
        x=x,
        y=y,
        forward_m=forward_m,
        height_m=height_m,
        height_sigma_m=height_sigma_m,
        camera_height_m=mount.height_m,
        pitch_rad=mount.pitch_rad,
        up=np.array([0.0, -math.cos(mount.pitch_rad), -math.sin(mount.pitch_rad)]),
        range_m=range_m,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """Where the cells look: x (w,), y (h,) as in DepthGrid. ahead, drop (h,): metres along the floor and
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
    view = _View(x, y, cosine - y * sine, y * cosine + sine)
    for values in (view.x, view.y, view.ahead, view.drop):
        values.setflags(write=False)
    return view


@inlined
def _of_four(depth: DepthImage, row: int, column: int, low: int, high: int, agree: np.float32) -> int:
    """One raw depth of four samples of the block at row and column: the mean of the middle two, or, where
    these lie on two surfaces, the nearer. A block with more than one sample without data has none."""
    a, b = depth[row + low, column + low], depth[row + low, column + high]
    c, d = depth[row + high, column + low], depth[row + high, column + high]
    first = max(min(a, b), min(c, d))
    second = min(max(a, b), max(c, d))
    nearer, farther = int(min(first, second)), int(max(first, second))
    # 1/nearer - 1/farther <= k, without a division.
    if np.float32(farther - nearer) <= np.float32(nearer) * np.float32(farther) * agree:
        nearer += (farther - nearer) // 2
    return nearer


@inlined
def _row(
    depth: DepthImage,
    row: int,
    step: int,
    agree: np.float32,
    into: NDArray[np.uint16],
) -> None:
    """Raw depth of the blocks whose uppermost row of pixels this is."""
    for j in range(len(into)):
        if step >= _FOUR_FROM_PX:
            into[j] = _of_four(depth, row, step * j, step // 4, step // 4 + step // 2, agree)
        else:
            into[j] = depth[row + step // 2, step * j + step // 2]


@compiled("uint16[:, ::1], int64, float32, float32, float32")
def _sampled(
    depth: DepthImage, step: int, scale_m: np.float32, min_m: np.float32, range_m: np.float32
) -> tuple[DepthImage, BoolGrid, BoolGrid]:
    """(h, w) raw depth of one cell per step x step block, _FARTHEST where it is not valid; valid; beyond."""
    rest = 0 if step >= _FOUR_FROM_PX else step - 1 - step // 2
    height, width = (depth.shape[0] + rest) // step, (depth.shape[1] + rest) // step
    raw = np.empty((height, width), np.uint16)
    valid, beyond = np.empty((height, width), np.bool_), np.empty((height, width), np.bool_)
    agree = np.float32(_AGREE_INVERSE) * scale_m
    for i in range(height):
        if step == _FOUR_FROM_PX:
            # A step known to the compiler takes half of the time.
            _row(depth, step * i, _FOUR_FROM_PX, agree, raw[i])
        else:
            _row(depth, step * i, step, agree, raw[i])
        for j in range(width):
            depth_m = np.float32(raw[i, j]) * scale_m
            beyond[i, j] = depth_m > range_m
            valid[i, j] = min_m <= depth_m <= range_m
            raw[i, j] = raw[i, j] if valid[i, j] else _FARTHEST
    return raw, valid, beyond


@compiled("uint16[:, ::1], uint16[:, ::1], float32")
def _smoothed(raw: DepthImage, middle: DepthImage, scale_m: np.float32) -> tuple[FloatGrid, FloatGrid]:
    """Inverse depth (h, w) and depth of the cells, both 0 where not valid: their median over 5x5 cells, as in
    middle (h, w), but a cell that differs much keeps its own: a thin pole, a rim of a body.

    Without data, an inverse depth of 0, is the farthest.
    """
    one, zero = np.float32(1.0), np.float32(0.0)
    inverse, depth_m = np.zeros(raw.shape, np.float32), np.zeros(raw.shape, np.float32)
    for i in range(raw.shape[0]):
        for j in range(raw.shape[1]):
            if raw[i, j] == _FARTHEST:
                continue
            own = one / (np.float32(raw[i, j]) * scale_m)
            median = one / (np.float32(middle[i, j]) * scale_m) if middle[i, j] < _FARTHEST else zero
            inverse[i, j] = median if abs(own - median) <= np.float32(_AGREE_INVERSE) else own
            depth_m[i, j] = one / inverse[i, j]
    return inverse, depth_m


@compiled("float32[:, ::1], float32[::1], float32[::1], float32, float32, float32")
def _over_floor(
    depth_m: FloatGrid,
    ahead: FloatGrid,
    drop: FloatGrid,
    camera_height_m: np.float32,
    floor_m: np.float32,
    quadratic_per_m: np.float32,
) -> tuple[FloatGrid, FloatGrid, FloatGrid]:
    """forward_m, height_m, height_sigma_m of cells of depth_m (h, w). ahead, drop (h,): see _View. floor_m,
    quadratic_per_m: of depth_sigma_m."""
    forward_m, height_m = np.empty(depth_m.shape, np.float32), np.empty(depth_m.shape, np.float32)
    height_sigma_m = np.empty(depth_m.shape, np.float32)
    for i in range(depth_m.shape[0]):
        share = np.float32(CELL_HEIGHT_NOISE) * abs(drop[i])
        for j in range(depth_m.shape[1]):
            depth = depth_m[i, j]
            forward_m[i, j] = depth * ahead[i]
            height_m[i, j] = camera_height_m - depth * drop[i]
            height_sigma_m[i, j] = share * depth_sigma_of(depth, floor_m, quadratic_per_m)
    return forward_m, height_m, height_sigma_m
