"""New fragments where there are too few, searched for in one part of the image at a time."""

from __future__ import annotations

import math
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from config.perception import FragmentSettings, PerceptionConfig
from hal.compiled import compiled, inlined
from hal.types import FloatArray, RgbdFrame
from vision.fragments.candidates import (
    NOTHING_NEW,
    NewFragments,
    depth_along,
    new_fragments,
    on_one_surface,
    trackable_segments,
)
from vision.fragments.edges import GreyImage, find_edges
from vision.fragments.segments import find_segments, longest_first

PART_PX = (240, 160)  # rows, columns: as much as a turn has time for; a 640x480 image has eight parts
_BLOCKS = 2  # per part, one above the other: each has its own threshold of contrast
_MARGIN_PX = 8  # around a part: a segment across its border is found from either side
_MANY_MISSING = 8  # if more than 1/8 of the fragments are missing, a whole column of parts is searched
_FEW_MISSING = 16  # if less than 1/16 are missing, none is: a search for one costs as much as for ten
_MIN_END_DISTANCE_PX = 12.0  # after the ends were moved to corners: a third of the minimum length
_CANDIDATES_PER_TILE = 4  # twice what a tile takes, since some have no depth or no corner
_SHARE_WITHOUT_DEPTH = 0.15  # maximum share of all fragments: these measure only the camera's rotation


class Renewal:
    """Decides where to search, and finds new fragments there.

    Keeps when each part of the image was last searched, and the contrast threshold of edges in each block.
    """

    def __init__(self, config: PerceptionConfig) -> None:
        self._config = config
        self._last_visit = np.empty(0, np.intp)
        self._threshold = np.empty((0, 0, 0))
        self._visits = 0

    def crowded(
        self, ends_px: NDArray[np.float32], on_movers: NDArray[np.bool_], shape: tuple[int, int]
    ) -> NDArray[np.bool_]:
        """(N,) the newest fragments on_movers (N,) of crowded tiles, where there is no room for others.

        ends_px (N, 2, 2): in the order of their ids. shape: of the image. Something that filled the view and
        goes away would otherwise keep all fragments, and none would be left for what comes into view.
        """
        settings = self._config.fragments
        if self._room(len(ends_px)) * _FEW_MISSING >= settings.max_fragments:
            return np.zeros(len(ends_px), np.bool_)
        return _surplus(np.ascontiguousarray(ends_px), on_movers, settings, *shape)

    def _room(self, present: int) -> int:
        return self._config.fragments.max_fragments - present

    def find(
        self,
        frame: RgbdFrame,
        grey: GreyImage,
        ends_px: NDArray[np.float32],
        without_depth: int,
        turns: int = 1,
        near_own: GreyImage | None = None,
    ) -> NewFragments:
        """New fragments for the tiles that hold too few ends of the present ones, ends_px (N, 2, 2).

        The part of the image that was searched longest ago is searched. If many fragments are missing, it is
        a column of such parts; if there are no fragments at all, all parts; if few are missing, none.

        without_depth: how many of the present fragments have no depth; only a small share may. turns: for how
        many frames' worth of parts there is time. near_own (H, W): 255 where the robot itself is seen, and
        nothing is searched; None: nowhere.
        """
        settings = self._config.fragments
        rows, columns = (max(1, round(size / part)) for size, part in zip(grey.shape, PART_PX, strict=True))
        if self._threshold.shape != (rows, columns, _BLOCKS):
            usual = 0.5 * (settings.canny_least + settings.canny_most)
            self._threshold = np.full((rows, columns, _BLOCKS), usual)
            self._last_visit = np.full(rows * columns, -1, np.intp)
        room = self._room(len(ends_px))
        if room * _FEW_MISSING < settings.max_fragments:
            return NOTHING_NEW
        self._visits += 1
        height, width = grey.shape
        counts = _tile_counts(np.ascontiguousarray(ends_px), settings.tile_px, height, width)
        parts = rows if room * _MANY_MISSING > settings.max_fragments else 1
        chosen = np.argsort(self._last_visit, kind="stable")[: parts * turns if len(ends_px) else None]
        self._last_visit[chosen] = self._visits
        found = [
            self._segments(grey, near_own, counts, part % rows, part // rows) for part in chosen.tolist()
        ]
        far_room = max(0, int(_SHARE_WITHOUT_DEPTH * settings.max_fragments) - without_depth)
        return self._select(frame, grey, np.concatenate(found), ends_px, counts, (room, far_room))

    def _segments(
        self, grey: GreyImage, near_own: GreyImage | None, counts: NDArray[np.int64], row: int, column: int
    ) -> NDArray[np.float32]:
        """Segments in one part of the image, outside of full tiles and of near_own."""
        settings = self._config.fragments
        rows, columns = (
            slice(
                max(0, size * index // count - _MARGIN_PX),
                min(size, size * (index + 1) // count + _MARGIN_PX),
            )
            for size, index, count in zip(grey.shape, (row, column), self._threshold.shape[:2], strict=True)
        )
        edges = self._edges(grey[rows, columns], self._threshold[row, column])
        if near_own is not None:
            edges = np.asarray(cv2.subtract(edges, near_own[rows, columns]), np.uint8)
        full = counts >= 2 * settings.fragments_per_tile
        searched = _outside_of(full, settings.tile_px, edges, rows.start, columns.start)
        return find_segments(searched, settings.min_length_px, (columns.start, rows.start))

    def _edges(self, grey: GreyImage, thresholds: FloatArray) -> GreyImage:
        """Edges of one part, block by block.

        Changes thresholds (_BLOCKS,) for the next search: lower after few edges, higher after many.
        """
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
        counts: NDArray[np.int64],
        room: tuple[int, int],
    ) -> NewFragments:
        """Select from candidates what the tiles lack; drop those that are untrackable or cross a depth edge.

        room: maximum number of fragments in all, and of fragments without depth.
        """
        settings, config = self._config.fragments, self._config
        wanted = _wanted(longest_first(candidates), counts, settings)
        snapped, tensor = trackable_segments(grey, wanted, ends_px, _MIN_END_DISTANCE_PX)
        surface = depth_along(snapped, frame, config)
        whole = on_one_surface(surface.near_m, config)
        picked = _picked(snapped, surface.near_m, whole, counts, settings, *room)
        return new_fragments(picked, snapped, tensor, surface, settings)


@inlined
def _tile(tiles: NDArray[np.int64], u: np.float32, v: np.float32, share: float) -> tuple[int, int]:
    """Row and column of the tile of a pixel, clamped to the image. share: 1 / side of a tile in pixels."""
    row, column = int(v * np.float32(share)), int(u * np.float32(share))
    return min(max(row, 0), tiles.shape[0] - 1), min(max(column, 0), tiles.shape[1] - 1)


@inlined
def _middle_tile(tiles: NDArray[np.int64], ends_px: NDArray[np.float32], tile_px: int) -> tuple[int, int]:
    """Row and column of the tile of the middle between two ends (2, 2)."""
    u, v = ends_px[0, 0] + ends_px[1, 0], ends_px[0, 1] + ends_px[1, 1]
    return _tile(tiles, u, v, 0.5 / tile_px)


@inlined
def _no_tiles(height: int, width: int, tile_px: int) -> NDArray[np.int64]:
    """0 for each tile of an image of height x width pixels."""
    return np.zeros((-(-height // tile_px), -(-width // tile_px)), np.int64)


@compiled("float32[:, :, ::1], int64, int64, int64")
def _tile_counts(ends_px: NDArray[np.float32], tile_px: int, height: int, width: int) -> NDArray[np.int64]:
    """Number of ends in each tile of the image."""
    counts = _no_tiles(height, width, tile_px)
    for n in range(len(ends_px)):
        for end in range(2):
            counts[_tile(counts, ends_px[n, end, 0], ends_px[n, end, 1], 1.0 / tile_px)] += 1
    return counts


@compiled("float32[:, :, ::1], bool_[::1]", FragmentSettings, "int64, int64")
def _surplus(
    ends_px: NDArray[np.float32],
    spare: NDArray[np.bool_],
    settings: FragmentSettings,
    height: int,
    width: int,
) -> NDArray[np.bool_]:
    """(N,) spare fragments with their middle in a tile that is full of fragments before them."""
    seen = _no_tiles(height, width, settings.tile_px)
    surplus = np.zeros(len(ends_px), np.bool_)
    for n in range(len(ends_px)):
        tile = _middle_tile(seen, ends_px[n], settings.tile_px)
        surplus[n] = spare[n] and seen[tile] >= settings.fragments_per_tile
        seen[tile] += 1
    return surplus


@compiled("bool_[:, ::1], int64, uint8[:, ::1], int64, int64")
def _outside_of(full: NDArray[np.bool_], tile_px: int, edges: GreyImage, top: int, left: int) -> GreyImage:
    """edges without those in full tiles. top, left: row and column of its first pixel in the image."""
    result = edges.copy()
    height, width = edges.shape
    for i in range(top // tile_px, (top + height - 1) // tile_px + 1):
        for j in range(left // tile_px, (left + width - 1) // tile_px + 1):
            if full[i, j]:
                row, column = i * tile_px - top, j * tile_px - left
                result[max(row, 0) : row + tile_px, max(column, 0) : column + tile_px] = 0
    return result


@compiled("float32[:, :, ::1], int64[:, ::1]", FragmentSettings)
def _wanted(
    segments_px: NDArray[np.float32], counts: NDArray[np.int64], settings: FragmentSettings
) -> NDArray[np.float32]:
    """The first few of segments (N, 2, 2) with their middle in each tile where some are missing.

    counts: ends in each tile.
    """
    wanted, count, seen = np.empty(len(segments_px), np.intp), 0, np.zeros_like(counts)
    for n in range(len(segments_px)):
        tile = _middle_tile(counts, segments_px[n], settings.tile_px)
        missing = settings.fragments_per_tile - counts[tile] // 2
        if seen[tile] < min(4 * missing, _CANDIDATES_PER_TILE):
            wanted[count] = n
            count += 1
        seen[tile] += 1
    return segments_px[wanted[:count]]


@compiled("float32[:, :, ::1], float64[:, ::1], bool_[::1], int64[:, ::1]", FragmentSettings, "int64, int64")
def _picked(
    segments_px: NDArray[np.float32],
    near_m: FloatArray,
    whole: NDArray[np.bool_],
    counts: NDArray[np.int64],
    settings: FragmentSettings,
    room: int,
    far_room: int,
) -> NDArray[np.intp]:
    """Indices of the segments (N, 2, 2) that fill up their tiles: at most room, and far_room without depth.

    near_m (N, 5): depth along them. whole (N,): on one surface. A segment without any measured depth is
    mostly far away, and so measures the camera's rotation.
    """
    picked, count, seen = np.empty(len(segments_px), np.intp), 0, np.zeros_like(counts)
    for n in range(len(segments_px)):
        beyond = np.isnan(near_m[n]).all()
        if beyond:
            far_room -= 1
        if not (whole[n] or (beyond and far_room >= 0)):
            continue
        tile = _middle_tile(counts, segments_px[n], settings.tile_px)
        if seen[tile] < settings.fragments_per_tile - counts[tile] // 2 and count < room:
            picked[count] = n
            count += 1
        seen[tile] += 1
    return picked[:count]
