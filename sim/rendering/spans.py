"""Scan conversion: which columns of which rows each face covers, for all faces at once.

A pixel belongs to a face if its centre lies inside. The column where an edge cuts a row is computed from the
edge alone, so there is neither a gap nor an overlap between two faces that share the edge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray, Intrinsics

NEAR_M = 0.05  # nothing nearer than this ahead of the camera is drawn


@dataclass(frozen=True, slots=True, eq=False)
class Spans:
    """The columns first <= u < last that each of M faces covers in each of its rows, row after row.

    start, row, count: (M,). Face k has count[k] rows, which begin at row row[k] and at entry start[k] of
        first and last.
    first, last: (R,), for all rows of all faces.
    bounds: (M, 4), first column and row, last column and row + 1 that the face covers; zeros if it covers no
        pixel.
    """

    start: NDArray[np.intp]
    row: NDArray[np.intp]
    count: NDArray[np.intp]
    first: NDArray[np.int16]
    last: NDArray[np.int16]
    bounds: NDArray[np.intp]

    def select(self, faces: NDArray[np.intp]) -> Spans:
        """The spans of these faces only; first and last do not change."""
        return Spans(
            self.start[faces], self.row[faces], self.count[faces], self.first, self.last, self.bounds[faces]
        )

    def entries(self) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
        """For every row of every face: the face, the row, and the entry in first and last."""
        face = np.repeat(np.arange(len(self.count)), self.count)
        step = np.arange(len(face)) - np.repeat(np.cumsum(self.count) - self.count, self.count)
        return face, step + self.row[face], step + self.start[face]


def convert(corners: FloatArray, intrinsics: Intrinsics) -> Spans:
    """Spans of convex faces (M, 4, 3) in the optical frame, clockwise as seen."""
    k = intrinsics
    polygons = _clip_near(corners)
    u = polygons[:, :, 0] * (k.fx / polygons[:, :, 2]) + k.cx
    v = polygons[:, :, 1] * (k.fy / polygons[:, :, 2]) + k.cy
    top = np.ceil(v).clip(0, k.height).astype(np.intp)
    row = top.min(axis=1)
    count = top.max(axis=1) - row
    start = np.cumsum(count) - count
    first = np.zeros(int(count.sum()), np.int16)
    last = np.zeros(len(first), np.int16)
    next_top, next_u = np.roll(top, -1, axis=1), np.roll(u, -1, axis=1)
    lines = edge_planes(polygons)
    # Faces are clockwise in an image whose v points down, so edges that go down bound them on the right.
    for side, from_row, to_row in ((last, top, next_top), (first, next_top, top)):
        owner, edge = np.nonzero(to_row > from_row)
        begin_row = from_row[owner, edge]
        length = to_row[owner, edge] - begin_row
        begin = np.cumsum(length) - length
        step = np.arange(int(length.sum()))
        slope, offset = _column_lines(lines[owner, edge], k)
        cut = np.repeat(slope, length) * (step + np.repeat(begin_row - begin, length))
        cut += np.repeat(offset, length)
        # With rounding, a nearly level edge might cut its row anywhere: keep the cut between its ends.
        ends = u[owner, edge], next_u[owner, edge]
        low, high = np.minimum(*ends).clip(-1.0, k.width), np.maximum(*ends).clip(-1.0, k.width)
        np.clip(cut, np.repeat(low, length), np.repeat(high, length), out=cut)
        side[step + np.repeat((start - row)[owner] + begin_row - begin, length)] = np.ceil(cut).clip(
            0, k.width
        )
    return Spans(start, row, count, first, last, _bounds(start, row, count, first, last))


def edge_planes(polygons: FloatArray) -> FloatArray:
    """Normals (M, K, 3) of the planes through the eye and each edge, pointing to the inside."""
    after = np.concatenate([polygons[:, 1:], polygons[:, :1]], axis=1)
    planes = np.empty_like(polygons)
    for axis, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        planes[:, :, axis] = polygons[:, :, i] * after[:, :, j] - polygons[:, :, j] * after[:, :, i]
    return planes


def _column_lines(lines: FloatArray, k: Intrinsics) -> tuple[FloatArray, FloatArray]:
    """(slope, offset) of the column slope * v + offset at which planes (N, 3) through the eye cut row v."""
    x, y, z = lines.T
    across = np.where(x == 0.0, 1.0, x) / k.fx
    slope = -y / k.fy / across
    return slope, k.cx - z / across - slope * k.cy


def _clip_near(corners: FloatArray) -> FloatArray:
    """Clip four-cornered faces at NEAR_M: polygons (M, 5, 3), with a corner repeated if there are fewer."""
    polygons = np.concatenate([corners, corners[:, 3:]], axis=1)
    crossing = np.flatnonzero(corners[:, :, 2].min(axis=1) < NEAR_M)
    if len(crossing) == 0:
        return polygons
    face_corners = corners[crossing]
    next_corners = np.roll(face_corners, -1, axis=1)
    in_front = face_corners[:, :, 2] >= NEAR_M
    crosses = in_front != np.roll(in_front, -1, axis=1)
    depth = np.where(crosses, next_corners[:, :, 2] - face_corners[:, :, 2], 1.0)
    cut = face_corners + ((NEAR_M - face_corners[:, :, 2]) / depth)[:, :, None] * (
        next_corners - face_corners
    )
    points = np.stack([face_corners, cut], axis=2).reshape(len(face_corners), 8, 3)
    used = np.stack([in_front, crosses], axis=2).reshape(len(face_corners), 8)
    order = np.argsort(~used, axis=1, kind="stable")[:, :5]
    order = np.where(np.arange(5) < used.sum(axis=1, keepdims=True), order, order[:, :1])
    polygons[crossing] = np.take_along_axis(points, order[:, :, None], axis=1)
    return polygons


def _bounds(
    start: NDArray[np.intp],
    row: NDArray[np.intp],
    count: NDArray[np.intp],
    first: NDArray[np.int16],
    last: NDArray[np.int16],
) -> NDArray[np.intp]:
    bounds = np.zeros((len(count), 4), np.intp)
    nonempty = np.flatnonzero(count)
    if len(nonempty) == 0:
        return bounds
    starts, empty = start[nonempty], last <= first
    rows = np.arange(len(empty)) + np.repeat((row - start)[nonempty], count[nonempty])
    bounds[nonempty, 0] = np.minimum.reduceat(np.where(empty, np.int16(32767), first), starts)
    bounds[nonempty, 1] = np.minimum.reduceat(np.where(empty, 1 << 20, rows), starts)
    bounds[nonempty, 2] = np.maximum.reduceat(np.where(empty, np.int16(0), last), starts)
    bounds[nonempty, 3] = np.maximum.reduceat(np.where(empty, 0, rows + 1), starts)
    bounds[bounds[:, 2] == 0] = 0
    return bounds
