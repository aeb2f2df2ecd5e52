"""Parts of the robot in its camera's view (`camera.own_parts`): their pixels are taken out of each frame.

Within the silhouette of a box, depth up to its far side is the robot's own, and what is farther is seen over
it. Own pixels lose their depth before anything else looks at it, so nothing is made of them; the grid knows
that they are no hole (vision/depth/own_cells.py). No fragment may lie on them either: it would move with the
camera, and be taken for a static one that says that the camera stands.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from config.own_parts import OwnPart
from config.perception import DepthNoise, PerceptionConfig
from hal.box_view import BoxView, box_view
from hal.compiled import compiled
from hal.types import CameraMount, DepthImage, Intrinsics, RgbdFrame
from vision.depth.depth_grid import BoolGrid, DepthGrid
from vision.depth.depth_noise import depth_sigma_m
from vision.depth.own_cells import OwnCells, hidden_floor_m, with_own

Mask = NDArray[np.uint8]

# The depth of a fragment's end is read so far around it (vision/depth/depth_mask.py). Silhouettes are grown
# by this, and by 2 pixels for vibration and rounded measures.
_END_PX = 6
_GROWN_PX = _END_PX + 2
# Room behind the far side of a box: unevenness, and noise.
_ROOM_M, _SIGMAS = 0.02, 3.0
# Beside a nearer surface a stereo camera measures nothing in a band as wide as the difference of the two
# disparities, with this baseline (vision/depth/rims.py).
_BASELINE_M = 0.05
# Of the width of the image, at most: a part at the lens would put everything beside it in its shadow.
_SHADOW_SHARE = 0.1
# Where two surfaces meet in the image, the depth of a few pixels is a mixture of both. Inside a silhouette
# these are taken out with the part: they would stand in the air right before the robot.
_RIM_PX = 3
# Single pixels without depth inside a silhouette are lost ones: own ones have own ones this far around them.
_STRAY_PX = 1
_FARTHEST_RAW = np.iinfo(np.uint16).max - 1  # the largest raw depth that is measured


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """The silhouettes in the image of one camera.

    beyond_raw: (h, w) the least raw depth at which a pixel is not the robot's own; 0 outside of the
        silhouettes. It is the part of the image that holds them all; (0, 0): none is in view.
    corner: row and column of its first pixel in the image.
    cells: where own parts may be in the depth grid.
    cores: of each part, flat cells of the grid that should show it, whatever moves a little.
    """

    beyond_raw: DepthImage
    corner: tuple[int, int]
    cells: OwnCells
    cores: tuple[NDArray[np.intp], ...]


class OwnParts:
    """Takes the own parts out of the frames of one camera, one frame after another.

    near: (H, W) 255 on own pixels of the last frame and close around them, else 0.
    """

    def __init__(self, parts: Sequence[OwnPart], mount: CameraMount, config: PerceptionConfig) -> None:
        self._parts, self._mount, self._config = tuple(parts), mount, config
        self._of: tuple[Intrinsics, float] | None = None
        self._view: _View | None = None
        self.near: Mask = np.zeros((1, 1), np.uint8)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the parts."""
        return tuple(part.name for part in self._parts)

    @property
    def cores(self) -> tuple[NDArray[np.intp], ...]:
        """Of each part, flat cells of the grid that should show it; after the first frame."""
        return () if self._view is None else self._view.cores

    def without(self, frame: RgbdFrame) -> RgbdFrame:
        """frame without the depth of own parts."""
        view = self._view_of(frame)
        if not view.beyond_raw.size:  # none is in view, after all
            return frame
        depth, (top, left) = np.ascontiguousarray(frame.depth), view.corner
        inside = cv2.erode(_nearer(depth, view.beyond_raw, top, left), _square(_STRAY_PX))
        rim = np.asarray(cv2.dilate(inside, _square(_STRAY_PX + _RIM_PX)), np.uint8)
        height, width = view.beyond_raw.shape
        near = self.near[top : top + height, left : left + width]
        cv2.dilate(inside, _square(_STRAY_PX + _END_PX), dst=near)
        return replace(frame, depth=_cut_out(depth, view.beyond_raw, rim, top, left))

    def mark(self, grid: DepthGrid) -> DepthGrid:
        """grid of the last frame, with its own cells."""
        assert self._view is not None, "without() comes first"
        return with_own(grid, self._view.cells)

    def under(self, ends_px: NDArray[np.float32]) -> NDArray[np.bool_]:
        """(N,) fragments with an end on an own part of the last frame, or close to one. ends_px (N, 2, 2)."""
        return _under(self.near, np.ascontiguousarray(ends_px))

    def _view_of(self, frame: RgbdFrame) -> _View:
        of = frame.intrinsics, frame.depth_scale_m
        if self._view is None or self._of != of:
            self._of, self._view = of, _view(self._parts, self._mount, self._config, *of)
            self.near = np.zeros((frame.intrinsics.height, frame.intrinsics.width), np.uint8)
        return self._view


def _view(
    parts: Sequence[OwnPart],
    mount: CameraMount,
    config: PerceptionConfig,
    camera: Intrinsics,
    depth_scale_m: float,
) -> _View:
    """The silhouettes of parts, for depth in units of depth_scale_m."""
    views = [box_view(part, mount, camera) for part in parts]
    limit_m = _limit_m(views, config.depth_noise)
    shadow = np.zeros(limit_m.shape, np.uint8)
    for view in views:
        shadow |= _shadow(view, camera)
    step = config.grid_step_px
    rows, columns = camera.height // step, camera.width // step
    if step < 4:  # as vision/depth/depth_grid.py counts cells
        rest = step - 1 - step // 2
        rows, columns = (camera.height + rest) // step, (camera.width + rest) // step
    middle = slice(step // 2, None, step)
    may_be = (shadow[middle, middle] > 0)[:rows, :columns]
    near_m = limit_m[middle, middle][:rows, :columns]
    inverse = np.divide(1.0, near_m, out=np.zeros_like(near_m), where=near_m > 0.0)
    y_px = (step // 2 + step * np.arange(rows)).astype(np.float32)
    hidden_m = hidden_floor_m(may_be, mount, camera, y_px)
    cores = tuple(_core(view, config, (rows, columns)) for view in views)
    raw = np.minimum(np.ceil(limit_m / depth_scale_m), _FARTHEST_RAW).astype(np.uint16)
    place = _place(limit_m > 0.0)
    corner = place[0].start, place[1].start
    return _View(np.ascontiguousarray(raw[place]), corner, OwnCells(may_be, inverse, hidden_m), cores)


def _limit_m(views: Sequence[BoxView], noise: DepthNoise) -> NDArray[np.float32]:
    """(H, W) depth up to which a pixel is the robot's own; 0 outside of the grown silhouettes."""
    exit_m = np.max([view.exit_m for view in views], axis=0)
    size = 2 * _GROWN_PX + 1
    grown_m = np.asarray(cv2.dilate(exit_m, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))))
    room_m = np.float32(_ROOM_M) + np.float32(_SIGMAS) * depth_sigma_m(grown_m.astype(np.float32), noise)
    return np.where(grown_m > 0.0, grown_m + room_m, 0.0).astype(np.float32)


def _shadow(view: BoxView, camera: Intrinsics) -> Mask:
    """(H, W) not 0 in a grown silhouette, and beside it, where a stereo camera may measure nothing."""
    seen = view.seen
    if not seen.any():
        return np.zeros(seen.shape, np.uint8)
    wide_px = camera.fx * _BASELINE_M / max(float(view.enter_m[seen].min()), _BASELINE_M)
    wide = _GROWN_PX + round(min(wide_px, _SHADOW_SHARE * camera.width))
    kernel = np.ones((2 * _GROWN_PX + 1, 2 * wide + 1), np.uint8)
    return np.asarray(cv2.dilate(seen.astype(np.uint8), kernel), np.uint8)


def _core(view: BoxView, config: PerceptionConfig, shape: tuple[int, int]) -> NDArray[np.intp]:
    """Flat cells well inside of the silhouette of a part that is far enough away to be measured."""
    measurable = (view.seen & (view.enter_m >= config.min_depth_m)).astype(np.uint8)
    inside = np.asarray(cv2.erode(measurable, _square(_GROWN_PX)))
    middle = slice(config.grid_step_px // 2, None, config.grid_step_px)
    cells: BoolGrid = inside[middle, middle][: shape[0], : shape[1]] > 0
    return np.flatnonzero(cells)


def _square(reach_px: int) -> Mask:
    """A kernel that reaches so far to every side."""
    return np.ones((2 * reach_px + 1, 2 * reach_px + 1), np.uint8)


def _place(silhouettes: NDArray[np.bool_]) -> tuple[slice, slice]:
    """Rows and columns that hold all of silhouettes (H, W), with room to grow; empty without any."""
    rows, columns = (np.flatnonzero(silhouettes.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return slice(0, 0), slice(0, 0)
    height, width = silhouettes.shape
    return (
        slice(max(int(rows[0]) - _GROWN_PX, 0), min(int(rows[-1]) + 1 + _GROWN_PX, height)),
        slice(max(int(columns[0]) - _GROWN_PX, 0), min(int(columns[-1]) + 1 + _GROWN_PX, width)),
    )


@compiled("uint16[:, ::1], uint16[:, ::1], int64, int64")
def _nearer(depth: DepthImage, beyond: DepthImage, top: int, left: int) -> Mask:
    """(h, w) 255 where depth (H, W) is less than beyond (h, w), a part of the image from top and left on."""
    own = np.empty(beyond.shape, np.uint8)
    for i in range(beyond.shape[0]):
        # Without a branch, so that the processor can do several at once.
        for j in range(beyond.shape[1]):
            own[i, j] = np.uint8(255) * np.uint8(depth[top + i, left + j] < beyond[i, j])
    return own


@compiled("uint16[:, ::1], uint16[:, ::1], uint8[:, ::1], int64, int64")
def _cut_out(depth: DepthImage, beyond: DepthImage, rim: Mask, top: int, left: int) -> DepthImage:
    """depth (H, W) without what is less than beyond (h, w), as in _nearer(), nor what is in the rim (h, w).

    Where beyond is 0, outside of the silhouettes, nothing is cut out.
    """
    kept = depth.copy()
    for i in range(beyond.shape[0]):
        for j in range(beyond.shape[1]):
            here = depth[top + i, left + j]
            own = (here < beyond[i, j]) | ((rim[i, j] > 0) & (beyond[i, j] > 0))
            kept[top + i, left + j] = np.uint16(0) if own else here
    return kept


@compiled("uint8[:, ::1], float32[:, :, ::1]")
def _under(near: Mask, ends_px: NDArray[np.float32]) -> NDArray[np.bool_]:
    """As OwnParts.under(). Ends beyond the image count as at its border."""
    height, width = near.shape
    result = np.zeros(len(ends_px), np.bool_)
    for n in range(len(ends_px)):
        for end in range(2):
            column = min(max(int(np.rint(ends_px[n, end, 0])), 0), width - 1)
            row = min(max(int(np.rint(ends_px[n, end, 1])), 0), height - 1)
            result[n] |= near[row, column] > 0
    return result
