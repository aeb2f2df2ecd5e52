"""A coarse grid of depth with heights over the floor, from which bodies and free space are computed.

make_grid makes it of each frame, first thing in vision/detector.py. Each cell is a robust sample of its block
of pixels, smoothed by a median over 5x5 cells.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Annotated, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from config.perception import PerceptionConfig
from hal.compiled import compiled, inlined
from hal.records import record
from hal.types import CameraMount, DepthImage, FloatArray, Intrinsics, RgbdFrame
from vision.depth.depth_mask import measurable_m

Reals = TypeVar("Reals", float, NDArray[np.float32], NDArray[np.float64])
FloatGrid = NDArray[np.float32]
BoolGrid = NDArray[np.bool_]
# The same with the types that compiled steps need (hal/compiled.py): one value a cell; one a row or column.
CellValues = Annotated[FloatGrid, "float32[:, ::1]"]
CellFlags = Annotated[BoolGrid, "boolean[:, ::1]"]
CellRays = Annotated[FloatGrid, "float32[::1]"]

# Noise of a cell's height relative to the noise that one pixel's depth would cause. A cell is the median of
# many pixels, but these are neighbours and share noise, so the factor is larger than their number suggests.
# The value is an estimate; above_floor() in vision/depth/connected.py adds a margin. The noise between two
# frames has been measured and is larger: CELL_NOISE_OVER_TIME in vision/bodies/arrivals.py.
CELL_HEIGHT_NOISE = 0.4
_INVALID_RAW = np.uint16(65535)  # raw depth of an invalid cell: it sorts behind all valid ones
_MIN_SIDE_PX = 32  # as config/recording.py and config/camera.py require
_FOUR_FROM_PX = 4  # from this cell size on a cell takes four samples, below it the middle pixel
NO_OWN_CELLS: BoolGrid = np.zeros((0, 0), np.bool_)
_AGREE_INVERSE = 0.03  # 1/m: samples of a cell that differ by more lie on two surfaces


@record(frozen=True, slots=True, eq=False)
class DepthGrid:
    """Depth of the view in (h, w) cells, each for one block of pixels.

    step_px, offset_px: cell (i, j) stands for the pixels around row offset + step * i, column offset + step *
        j.
    depth_m: 0 where not valid, (h, w).
    inverse_depth: 0 where not valid, but own parts have theirs, (h, w).
    valid: measured within the range, (h, w).
    beyond: measured, but farther than range_m, so that space is seen free up to there, (h, w).
    x, y: ray at z = 1 m of each column, (w,), and row, (h,).
    forward_m: distance along the floor, (h, w); depth_m where the floor is not known.
    height_m, height_sigma_m: over the floor, (h, w); None where the floor is not known.
    camera_height_m: over the floor; NaN where the floor is not known.
    pitch_rad: of the mounting; NaN where that is not known.
    up: the floor's normal in optical axes, (3,); None where the floor is not known.
    range_m: of the depth mask, or as far as 16 bits reach in the camera's unit.
    own: the cell shows the robot itself, (h, w); (0, 0) where no part of it is in view (own_cells.py).
    hidden_m: forward distance up to which own parts may hide the floor; 0.0: none.
    """

    step_px: int
    offset_px: float
    depth_m: CellValues
    inverse_depth: CellValues
    valid: CellFlags
    beyond: CellFlags
    x: CellRays
    y: CellRays
    forward_m: FloatGrid
    height_m: FloatGrid | None
    height_sigma_m: FloatGrid | None
    camera_height_m: float
    pitch_rad: float
    up: FloatArray | None
    range_m: float
    own: CellFlags = field(default_factory=lambda: NO_OWN_CELLS)
    hidden_m: float = 0.0

    def points(self, cells: NDArray[np.intp]) -> FloatGrid:
        """(3, K) points in the camera axes of flat cell indices (K,)."""
        rows = cells // self.depth_m.shape[1]
        columns = cells - rows * self.depth_m.shape[1]
        depth = self.depth_m.ravel().take(cells)
        result = np.empty((3, len(cells)), np.float32)
        np.multiply(self.x.take(columns), depth, out=result[0])
        np.multiply(self.y.take(rows), depth, out=result[1])
        result[2] = depth
        return result


def floor_ray(y: Reals, pitch_rad: float) -> tuple[Reals, Reals]:
    """Metres along the floor and metres down, per metre of depth, of rays y at z = 1, of any shape."""
    cosine, sine = math.cos(pitch_rad), math.sin(pitch_rad)
    return cosine - y * sine, y * cosine + sine


def make_grid(frame: RgbdFrame, config: PerceptionConfig, mount: CameraMount | None) -> DepthGrid:
    """Sub-sample the depth of frame. Heights are None where mount is None.

    Depth outside [min_depth_m, max_depth_m] is not valid, nor is the largest raw number, at which far depth
    is cut off. Raises ValueError for an image of less than 32 x 32 pixels: the neighbourhoods of pixels that
    later steps read do not fit into it.
    """
    if min(frame.depth.shape) < _MIN_SIDE_PX:
        sides = f"{frame.depth.shape[1]}x{frame.depth.shape[0]}"
        raise ValueError(f"depth of {sides} pixels, where at least {_MIN_SIDE_PX} are needed each way")
    step, scale_m = config.grid_step_px, np.float32(frame.depth_scale_m)
    range_m = measurable_m(config.max_depth_m, frame.depth_scale_m)
    offset = step // 4 + 0.5 * (step // 2) if step >= _FOUR_FROM_PX else float(step // 2)
    raw, valid, beyond = _sampled(
        np.ascontiguousarray(frame.depth), step, scale_m, np.float32(config.min_depth_m), np.float32(range_m)
    )
    # The median of raw depths is that of their inverses too, and integers are sorted faster.
    middle = np.asarray(cv2.medianBlur(raw, 5), np.uint16)
    inverse, depth_m = _smoothed(raw, middle, scale_m)
    rays = _directions(frame.intrinsics, mount, depth_m.shape, step, offset)
    forward_m, height_m, height_sigma_m = depth_m, None, None
    if mount is not None:
        forward_m, height_m, height_sigma_m = _over_floor(
            depth_m,
            rays.ahead,
            rays.drop,
            np.float32(mount.height_m),
            np.float32(config.depth_noise.floor_m),
            np.float32(config.depth_noise.quadratic_per_m),
        )
    return DepthGrid(
        step_px=step,
        offset_px=offset,
        depth_m=depth_m,
        inverse_depth=inverse,
        valid=valid,
        beyond=beyond,
        x=rays.x,
        y=rays.y,
        forward_m=forward_m,
        height_m=height_m,
        height_sigma_m=height_sigma_m,
        camera_height_m=math.nan if mount is None else mount.height_m,
        pitch_rad=math.nan if mount is None else mount.pitch_rad,
        up=rays.up,
        range_m=range_m,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Directions:
    """Ray directions of the cells, per metre of depth.

    x, y: as in DepthGrid, (w,) and (h,).
    ahead: metres along the floor, (h,).
    drop: metres down, (h,).
    up: the floor's normal in optical axes, (3,); None where the floor is not known.
    """

    x: FloatGrid
    y: FloatGrid
    ahead: FloatGrid
    drop: FloatGrid
    up: FloatArray | None


@lru_cache(maxsize=4)
def _directions(
    camera: Intrinsics, mount: CameraMount | None, shape: tuple[int, int], step: int, offset: float
) -> _Directions:
    """The directions of one camera; cached, since it is the same in every frame."""
    u = (offset + step * np.arange(shape[1])).astype(np.float32)
    v = (offset + step * np.arange(shape[0])).astype(np.float32)
    x = (u - np.float32(camera.cx)) / np.float32(camera.fx)
    y = (v - np.float32(camera.cy)) / np.float32(camera.fy)
    up = None if mount is None else np.array([0.0, -math.cos(mount.pitch_rad), -math.sin(mount.pitch_rad)])
    rays = _Directions(x, y, *floor_ray(y, 0.0 if mount is None else mount.pitch_rad), up)
    for values in (rays.x, rays.y, rays.ahead, rays.drop):
        values.setflags(write=False)
    return rays


@inlined
def _robust_of_four(depth: DepthImage, row: int, column: int, low: int, high: int, agree: np.float32) -> int:
    """One raw depth from four samples of the block at row and column.

    The mean of the middle two, or the nearer of these where they lie on two surfaces. A block with more than
    one sample without data has no depth (0).
    """
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
    out: NDArray[np.uint16],
) -> None:
    """Put the raw depth of the blocks whose uppermost pixel row is row into out."""
    for j in range(len(out)):
        if step >= _FOUR_FROM_PX:
            out[j] = _robust_of_four(depth, row, step * j, step // 4, step // 4 + step // 2, agree)
        else:
            out[j] = depth[row + step // 2, step * j + step // 2]


@compiled("uint16[:, ::1], int64, float32, float32, float32")
def _sampled(
    depth: DepthImage, step: int, scale_m: np.float32, min_m: np.float32, range_m: np.float32
) -> tuple[DepthImage, BoolGrid, BoolGrid]:
    """(h, w) raw depth of each block of step x step, _INVALID_RAW where not valid; valid, beyond (h, w)."""
    rest = 0 if step >= _FOUR_FROM_PX else step - 1 - step // 2
    height, width = (depth.shape[0] + rest) // step, (depth.shape[1] + rest) // step
    raw = np.empty((height, width), np.uint16)
    valid, beyond = np.empty((height, width), np.bool_), np.empty((height, width), np.bool_)
    agree = np.float32(_AGREE_INVERSE) * scale_m
    for i in range(height):
        if step == _FOUR_FROM_PX:
            # With a step that the compiler knows it takes half of the time.
            _row(depth, step * i, _FOUR_FROM_PX, agree, raw[i])
        else:
            _row(depth, step * i, step, agree, raw[i])
        for j in range(width):
            depth_m = np.float32(raw[i, j]) * scale_m
            beyond[i, j] = depth_m > range_m
            valid[i, j] = min_m <= depth_m <= range_m
            raw[i, j] = raw[i, j] if valid[i, j] else _INVALID_RAW
    return raw, valid, beyond


@compiled("uint16[:, ::1], uint16[:, ::1], float32")
def _smoothed(raw: DepthImage, middle: DepthImage, scale_m: np.float32) -> tuple[FloatGrid, FloatGrid]:
    """Inverse depth and depth of the cells, (h, w) each, 0 where not valid.

    They are the median over 5x5 cells, as in middle (h, w). A cell that differs much from the median keeps
    its own depth: a thin pole, the rim of a body. In the median a cell without data counts as the farthest.
    """
    one, zero = np.float32(1.0), np.float32(0.0)
    inverse, depth_m = np.zeros(raw.shape, np.float32), np.zeros(raw.shape, np.float32)
    for i in range(raw.shape[0]):
        for j in range(raw.shape[1]):
            if raw[i, j] == _INVALID_RAW:
                continue
            own = one / (np.float32(raw[i, j]) * scale_m)
            median = one / (np.float32(middle[i, j]) * scale_m) if middle[i, j] < _INVALID_RAW else zero
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
    """forward_m, height_m and height_sigma_m of cells with depth_m (h, w).

    ahead, drop (h,): see _Directions. floor_m, quadratic_per_m: depth noise.
    """
    forward_m, height_m = np.empty(depth_m.shape, np.float32), np.empty(depth_m.shape, np.float32)
    height_sigma_m = np.empty(depth_m.shape, np.float32)
    for i in range(depth_m.shape[0]):
        share = np.float32(CELL_HEIGHT_NOISE) * abs(drop[i])
        for j in range(depth_m.shape[1]):
            depth = depth_m[i, j]
            forward_m[i, j] = depth * ahead[i]
            height_m[i, j] = camera_height_m - depth * drop[i]
            # As depth_sigma_of in depth_noise.py, in single precision.
            height_sigma_m[i, j] = share * (floor_m + quadratic_per_m * depth * depth)
    return forward_m, height_m, height_sigma_m
