"""New fragments where they have thinned out, one part of the image at a time."""

from __future__ import annotations

import math
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from config.perception import PerceptionConfig
from hal.types import FloatArray, RgbdFrame
from vision.fragments.candidates import (
    NOTHING_NEW,
    NewFragments,
    depth_along,
    held_ends,
    new_fragments,
    on_one_surface,
)
from vision.fragments.edges import GreyImage, find_edges
from vision.fragments.segments import find_segments, longest_first

PART_PX = (240, 160)  # rows, columns: as much as a frame has time for; eight of them are 640x480
_BLOCKS = 2  # per part, one above the other: each has its own threshold of contrast
_MARGIN_PX = 8  # around a part: a segment across its border is found from either side
_MANY_MISSING = 8  # where more than one fragment in so many is missing, all parts of a band are searched
_FEW_MISSING = 16  # where less than one in so many is, none: a search costs as much for one as for ten
_MIN_END_DISTANCE_PX = 12.0  # a third of the least length: ends were moved to corners
_CANDIDATES_PER_TILE = 4  # twice what a tile takes, for some have no depth or no corner
_SHARE_WITHOUT_DEPTH = 0.15  # of all fragments: they tell of the camera's turn, of nothing else


class Renewal:
    """Decides where to look and finds segments there. Keeps when each part of the image was last visited,
    and how much contrast makes an edge in each block of it."""

    def __init__(self, config: PerceptionConfig) -> None:
        self._config = config
        self._last_visit = np.empty(0, np.intp)
        self._threshold = np.empty((0, 0, 0))
        self._visits = 0

    def find(
        self, frame: RgbdFrame, grey: GreyImage, ends_px: NDArray[np.float32], without_depth: int
    ) -> NewFragments:
        """Fragments for the tiles that hold too few of ends_px (N, 2, 2), in the part of the image that was
        not visited for longest, or in the upright band of such parts where many are missing, or everywhere
        where there are none. Nowhere while few are missing.

        without_depth: how many of the present ones have no depth; only a small share of all may.
        """
        settings = self._config.fragments
        rows, columns = (max(1, round(size / part)) for size, part in zip(grey.shape, PART_PX, strict=True))
        if self._threshold.shape != (rows, columns, _BLOCKS):
            usual = 0.5 * (settings.canny_least + settings.canny_most)
            self._threshold = np.full((rows, columns, _BLOCKS), usual)
            self._last_visit = np.full(rows * columns, -1, np.intp)
        room = settings.max_fragments - len(ends_px)
        if room * _FEW_MISSING < settings.max_fragments:
            return NOTHING_NEW
        self._visits += 1
        counts = _tile_counts(ends_px, settings.tile_px, *grey.shape)
        parts = rows if room * _MANY_MISSING > settings.max_fragments else 1
        chosen = np.argsort(self._last_visit, kind="stable")[: parts if len(ends_px) else None]
        self._last_visit[chosen] = self._visits
        found = [self._segments(grey, counts, part % rows, part // rows) for part in chosen.tolist()]
        far_room = max(0, int(_SHARE_WITHOUT_DEPTH * settings.max_fragments) - without_depth)
        return self._select(frame, grey, np.concatenate(found), ends_px, counts, (room, far_room))

    def _segments(
        self, grey: GreyImage, counts: NDArray[np.intp], row: int, column: int
    ) -> NDArray[np.float32]:
        """Segments of one part, outside of tiles that are full."""
        settings = self._config.fragments
        rows, columns = (
            slice(
                max(0, size * index // count - _MARGIN_PX),
                min(size, size * (index + 1) // count + _MARGIN_PX),
            )
            for size, index, count in zip(grey.shape, (row, column), self._threshold.shape[:2], strict=True)
        )
        edges = self._edges(grey[rows, columns], self._threshold[row, column])
        free = counts < 2 * settings.fragments_per_tile
        edges *= _pixels_of(free, settings.tile_px, rows, columns)
        return find_segments(edges, settings.min_length_px, (columns.start, rows.start))

    def _edges(self, grey: GreyImage, thresholds: FloatArray) -> GreyImage:
        """Edges of one part, block by block. The next visit looks closer where little was seen, less close
        where much: thresholds (_BLOCKS,) are changed."""
        settings = self._config.fragments
        edges = np.empty(grey.shape, np.uint8)
        borders = [len(grey) * block // _BLOCKS for block in range(_BLOCKS + 1)]
        for block, (top, bottom) in enumerate(pairwise(borders)):
            high = float(thresholds[block])
            inside = find_edges(grey[top:bottom], high)
            edges[top:bottom] = inside
            share = max(cv2.countNonZero(inside) / inside.size, 1e-3)
            wanted = high * min(max(math.sqrt(share / settings.edge_share), 0.6), 1.6)
            thresholds[block] = min(max(wanted, settings.canny_least), settings.canny_most)
        return edges

    def _select(
        self,
        frame: RgbdFrame,
        grey: GreyImage,
        candidates: NDArray[np.float32],
        ends_px: NDArray[np.float32],
        counts: NDArray[np.intp],
        room: tuple[int, int],
    ) -> NewFragments:
        """Thin out to what the tiles lack; drop what has no depth, crosses a depth edge or is untrackable."""
        settings, config = self._config.fragments, self._config
        missing = settings.fragments_per_tile - counts.ravel() // 2
        candidates = longest_first(candidates)
        tile = _tiles(candidates, settings.tile_px, counts.shape[1])
        wanted = _rank_within(tile) < np.minimum(4 * missing, _CANDIDATES_PER_TILE).take(tile)
        snapped, tensor = held_ends(grey, candidates[wanted], ends_px, _MIN_END_DISTANCE_PX)
        surface = depth_along(snapped, frame, config)
        near = surface.near_m
        # Where nothing is measured at all, it is mostly far away: good to know the camera's turn by.
        beyond = ~(near == near).any(axis=1)
        beyond &= np.cumsum(beyond) <= room[1]
        whole = (on_one_surface(near, config) | beyond).nonzero()[0]
        tile = _tiles(snapped[whole], settings.tile_px, counts.shape[1])
        picked = whole[_rank_within(tile) < missing[tile]][: max(0, room[0])]
        return new_fragments(picked, snapped, tensor, surface, settings)


def _pixels_of(tiles: NDArray[np.bool_], tile_px: int, rows: slice, columns: slice) -> NDArray[np.bool_]:
    """tiles (h, w) in the size of the image, of which only rows and columns are wanted."""
    down, across = (np.arange(part.start, part.stop) // tile_px for part in (rows, columns))
    result: NDArray[np.bool_] = tiles.take(across, axis=1).take(down, axis=0)
    return result


def _tile_counts(ends_px: NDArray[np.float32], tile_px: int, height: int, width: int) -> NDArray[np.intp]:
    """Ends per tile."""
    rows, columns = -(-height // tile_px), -(-width // tile_px)
    flat = ends_px.reshape(-1, 2)
    cell = (flat * (1.0 / tile_px)).astype(np.intp)  # no pixel is negative: cutting off rounds down
    index = cell[:, 1] * columns + cell[:, 0]
    return np.bincount(index, minlength=rows * columns).reshape(rows, columns)


def _tiles(ends_px: NDArray[np.float32], tile_px: int, columns: int) -> NDArray[np.intp]:
    """(N,) flat tile index of the middle of each segment."""
    middle = ((ends_px[:, 0] + ends_px[:, 1]) * (0.5 / tile_px)).astype(np.intp)
    result: NDArray[np.intp] = middle[:, 1] * columns + middle[:, 0]
    return result


def _rank_within(groups: NDArray[np.intp]) -> NDArray[np.intp]:
    """(N,) how many earlier entries have the same group."""
    if len(groups) == 0:
        return np.empty(0, np.intp)
    order = np.argsort(groups, kind="stable")
    ordered = groups.take(order)
    place = np.arange(len(groups))
    starts = place.copy()
    starts[1:] *= ordered[1:] != ordered[:-1]
    rank = np.empty(len(groups), np.intp)
    rank[order] = place - np.maximum.accumulate(starts)
    return rank
