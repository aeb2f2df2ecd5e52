"""Surfaces where there was free space a moment ago: in a world that stands still there are none.

Whatever the camera saw through, from wherever it stood, was empty. A surface that is there now has
come. The test needs no texture and no segmentation, and neither a new viewpoint nor what it uncovers
can mislead it: what was hidden or not measured then proves nothing. By the same memory a surface is known
that was there before, as far as the noise of depth tells: somebody close to a wall seems to be.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise
from hal.types import FloatArray, Pose
from vision.depth.depth_grid import BoolGrid, DepthGrid, FloatGrid

# Every second view at 30 frames a second: a look back takes whichever is close to it.
_KEEP_EVERY_S = 0.06
# Who walks has left his own width behind in the longer one; the shorter one forgets sooner what the camera's
# own motion was off by.
_LOOK_BACK_S = (0.2, 0.6)
_MARGIN_M = 0.10  # beside the noise: what the camera's motion may be off by over the longer look back
_SIGMAS = 3.5  # of what is compared, two in ten thousand cells by chance; neighbours have to agree, too
# Noise of a cell between two looks over that of a pixel, measured over time: a median over 25 cells of four
# samples each, whose noise neighbours share. Within one look, over the floor, it is CELL_HEIGHT_NOISE.
_CELL_NOISE_OVER_TIME = 0.55
_NEIGHBOURS = 5  # of a cell and its eight neighbours, this many must have arrived
_UNKNOWN = np.float32(1e3)  # 1/m, of what was not measured: nothing is nearer, so that nothing has come there
_BLOCK = np.ones((3, 3), np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class _Memory:
    stamp_ns: int
    pose: Pose
    nearest_inverse: FloatGrid  # per cell the nearest surface of its 3x3 neighbourhood; large: not known


@dataclass(frozen=True, slots=True, eq=False)
class Changes:
    """arrived (h, w): surfaces in space that was seen free. stayed (h, w): surfaces that were seen there
    before, stayed_s ago (0.0: no such look); what was hidden or not measured then is neither."""

    arrived: BoolGrid
    stayed: BoolGrid
    stayed_s: float


class FreeMemory:
    """Remembers what was seen through during the last moments."""

    def __init__(self, noise: DepthNoise) -> None:
        self._noise = noise
        self._memories: list[_Memory] = []

    def clear(self) -> None:
        """Forget: the poses before cannot be compared with those to come."""
        self._memories.clear()

    def changes(self, grid: DepthGrid, mask: BoolGrid, pose: Pose, now_ns: int) -> Changes:
        """What has come and what has stayed, of the cells of mask (h, w)."""
        arrived, stayed, stayed_s = np.zeros(mask.shape, np.bool_), np.zeros(mask.shape, np.bool_), 0.0
        cells = np.flatnonzero(mask)
        points = grid.points(cells)
        came = np.zeros(len(cells), np.bool_)
        for wanted_s in _LOOK_BACK_S:
            memory = self._memory_of(now_ns, wanted_s)
            if memory is None:
                continue
            nearer, inside, margin = self._compare(grid, points, pose, memory)
            came |= inside & (nearer > margin)
            if wanted_s == _LOOK_BACK_S[-1]:
                stayed.ravel()[cells] = inside & (np.abs(nearer) <= margin)
                stayed_s = (now_ns - memory.stamp_ns) * 1e-9
        if not came.any():
            return Changes(arrived, stayed, stayed_s)
        arrived.ravel()[cells] = came
        block, outside = (3, 3), cv2.BORDER_CONSTANT
        count = cv2.boxFilter(arrived.view(np.uint8), -1, block, normalize=False, borderType=outside)
        return Changes(arrived & (np.asarray(count) >= _NEIGHBOURS), stayed, stayed_s)

    def resolves_m(self, distance_m: FloatArray) -> FloatArray:
        """(N,) how much nearer or farther a surface at distance_m (N,) has to be to be told from another."""
        noise_1pm = _SIGMAS * math.sqrt(2.0) * _CELL_NOISE_OVER_TIME * self._noise.quadratic_per_m
        result: FloatArray = _MARGIN_M + noise_1pm * np.square(distance_m)
        return result

    def remember(self, grid: DepthGrid, pose: Pose, now_ns: int) -> None:
        """Keep this view, unless the last one kept is very young."""
        if self._memories and (now_ns - self._memories[-1].stamp_ns) * 1e-9 < _KEEP_EVERY_S:
            return
        nearest = np.full(grid.inverse_depth.shape, _UNKNOWN)
        cv2.copyTo(grid.inverse_depth, grid.valid.view(np.uint8), nearest)
        # What was measured beyond was seen through up to where depth ends, no farther.
        nearest[grid.beyond] = np.float32(1.0 / grid.range_m)
        cv2.dilate(nearest, _BLOCK, nearest)
        self._memories.append(_Memory(now_ns, pose, nearest))
        horizon_ns = now_ns - int(1.5e9 * max(_LOOK_BACK_S))
        self._memories = [m for m in self._memories if m.stamp_ns >= horizon_ns]

    def _memory_of(self, now_ns: int, wanted_s: float) -> _Memory | None:
        """The view closest to wanted_s ago, if there is one between half and one and a half of it."""
        best, gap = None, 0.5 * wanted_s
        for memory in self._memories:
            off = abs((now_ns - memory.stamp_ns) * 1e-9 - wanted_s)
            if off <= gap:
                best, gap = memory, off
        return best

    def _compare(
        self, grid: DepthGrid, points: FloatGrid, pose: Pose, memory: _Memory
    ) -> tuple[FloatGrid, NDArray[np.bool_], FloatGrid]:
        """(K,) by how much points (3, K), camera axes now, are nearer, in 1/m, than what memory saw there;
        which of them it may have seen, and by how much noise may have it so."""
        relative = memory.pose.inverse() @ pose
        there = relative.rotation.astype(np.float32) @ points
        there += relative.translation_m.astype(np.float32)[:, None]
        cell, inside, inverse = grid.project(there)
        seen = memory.nearest_inverse.ravel().take(cell)
        sigma = np.float32(np.sqrt(2.0) * _CELL_NOISE_OVER_TIME * self._noise.quadratic_per_m)
        margin = np.float32(_MARGIN_M) * inverse * inverse + np.float32(_SIGMAS) * sigma
        return inverse - seen, inside, margin
