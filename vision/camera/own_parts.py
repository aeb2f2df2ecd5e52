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

    beyond_raw: (H, W) the least raw depth at which a pixel is not the robot's own; 0 outside of the
        silhouettes.
    place: rows and columns that hold all silhouettes.
    grown: the silhouettes, grown, within place.
    cells: where own parts may be in the depth grid.
    cores: of each part, flat cells of the grid that should show it, whatever moves a little.
    """

    beyond_raw: DepthImage
    place: tuple[slice, slice]
    grown: NDArray[np.bool_]
    cells: OwnCells
    cores: tuple[NDArray[np.intp], ...]


class OwnParts:
    """Takes the own parts out of the frames of one camera, one frame after another.

    near: (H, W) not 0 on own pixels of the last frame and close around them.
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
        rows, columns = view.place
        bounds = rows.start, rows.stop, columns.start, columns.stop
        depth, own = _cut_out(np.ascontiguousarray(frame.depth), view.beyond_raw, *bounds)
        if not view.grown.size:  # none is in view, after all
            self.near = own
            return frame
        inside = cv2.erode(own[view.place], _square(_STRAY_PX))
        depth[view.place][(cv2.dilate(inside, _square(_STRAY_PX + _RIM_PX)) > 0) & view.grown] = 0
        own[view.place] = cv2.dilate(inside, _square(_STRAY_PX + _END_PX))
        self.near = own
        return replace(frame, depth=depth)

    def mark(self, grid: DepthGrid) -> DepthGrid:
        """grid of the last frame, with its own cells."""
        assert self._view is not None, "without() comes first"
        return with_own(grid, self._view.cells)

    def under(self, ends_px: NDArray[np.float32]) -> NDArray[np.bool_]:
        """(N,) fragments with an end on an own part of the last frame, or close to one. ends_px (N, 2, 2)."""
        height, width = self.near.shape
        columns = np.rint(ends_px[:, :, 0]).astype(np.intp).clip(0, width - 1)
        rows = np.rint(ends_px[:, :, 1]).astype(np.intp).clip(0, height - 1)
        result: NDArray[np.bool_] = self.near[rows, columns].any(axis=1)
        return result

    def _view_of(self, frame: RgbdFrame) -> _View:
        of = frame.intrinsics, frame.depth_scale_m
        if self._view is None or self._of != of:
            self._of, self._view = of, _view(self._parts, self._mount, self._config, *of)
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
    grown, own_cells = limit_m > 0.0, OwnCells(may_be, inverse, hidden_m)
    place = _place(grown)
    return _View(raw, place, grown[place].copy(), own_cells, cores)


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


@compiled("uint16[:, ::1], uint16[:, ::1], int64, int64, int64, int64")
def _cut_out(
    depth: DepthImage, beyond: DepthImage, top: int, bottom: int, left: int, right: int
) -> tuple[DepthImage, Mask]:
    """depth (H, W) without what is nearer than beyond (H, W); and where that is, or nothing is measured.

    top, bottom, left, right: outside of these beyond is 0.
    """
    kept, own = depth.copy(), np.zeros(depth.shape, np.uint8)
    for i in range(top, bottom):
        # Without a branch, so that the processor can do several at once.
        for j in range(left, right):
            nearer = depth[i, j] < beyond[i, j]
            own[i, j] = np.uint8(nearer)
            kept[i, j] = np.uint16(0) if nearer else depth[i, j]
    return kept, own
