"""Which face is seen at each pixel, and how far away it is: exactly, at the pixels' centres.

A face's inverse depth is affine in image coordinates, and so is, for each of its edges, the side of the
edge that a pixel's ray passes on (homogeneous edge functions; Olano and Greer 1997). Both are linear
functions of (u, v), so no face needs clipping against the near plane, depth has no interpolation
error, and faces that share an edge leave neither gap nor overlap.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray, Intrinsics, Pose
from sim.world import Geometry

NEAR_M = 0.05
FAR_M = 250.0
NOTHING = 0

Float32Image = NDArray[np.float32]
LabelImage = NDArray[np.uint16]


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """M faces that reach the image, numbered 1..M in label images (0: nothing there).

    face (M,): index into the geometry. edges (M, 4, 3): e = edges @ (u, v, 1) is >= 0 inside.
    to_plane (M, 3, 3): takes (u, v, 1) to (s, t, 1) / z, with s, t in 0..1 from the first corner along the
    face's upper and left edge; its last row is therefore the inverse depth. bounds (M, 4): first column and
    row, last column and row + 1.
    """

    face: NDArray[np.intp]
    edges: FloatArray
    to_plane: FloatArray
    bounds: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.face)


@dataclass(frozen=True, slots=True, eq=False)
class _Spans:
    """The columns first <= u < last that each face covers in each of its rows, row after row.

    Face k's rows begin at entry start[k] and at row row[k]; there are count[k] of them.
    """

    start: NDArray[np.intp]
    row: NDArray[np.intp]
    count: NDArray[np.intp]
    first: NDArray[np.int16]
    last: NDArray[np.int16]


class Rasteriser:
    """Draws geometry into buffers that it owns: inverse depth (H, W) float32 in 1/m and labels (H, W)."""

    def __init__(self, intrinsics: Intrinsics) -> None:
        self.intrinsics = intrinsics
        shape = (intrinsics.height, intrinsics.width)
        self.inverse_depth: Float32Image = np.zeros(shape, np.float32)
        self.labels: LabelImage = np.zeros(shape, np.uint16)
        self._columns = np.arange(intrinsics.width, dtype=np.int16)[None, :]
        self._steps = np.arange(intrinsics.width, dtype=np.float32)[None, :]
        self._plane = np.empty(shape[0] * shape[1], np.float32)
        self._label = np.empty(shape[0] * shape[1], np.uint16)
        self._inside = np.empty(shape[0] * shape[1], np.bool_)
        self._other = np.empty(shape[0] * shape[1], np.bool_)
        k = intrinsics
        self._pixel_to_ray = np.array(
            [[1.0 / k.fx, 0.0, -k.cx / k.fx], [0.0, 1.0 / k.fy, -k.cy / k.fy], [0.0, 0.0, 1.0]]
        )

    def draw(self, geometry: Geometry, camera: Pose) -> Drawn:
        """Fill inverse_depth and labels with what camera (in the floor's frame) sees."""
        self.inverse_depth.fill(0.0)
        self.labels.fill(NOTHING)
        face, corners = self._facing(geometry, camera)
        drawn, spans = self._prepare(face, corners)
        self._draw_faces(drawn, spans)
        return drawn

    def _facing(self, geometry: Geometry, camera: Pose) -> tuple[NDArray[np.intp], FloatArray]:
        """Faces turned to the camera that may reach into the view, and their corners in its frame."""
        to_eye = camera.translation_m - geometry.corners_m[:, 0]
        facing = np.flatnonzero(np.einsum("nd,nd->n", geometry.normals, to_eye) > 1e-6)
        corners = (geometry.corners_m[facing] - camera.translation_m) @ camera.rotation
        k = self.intrinsics
        x, y, z = corners[:, :, 0] * k.fx, corners[:, :, 1] * k.fy, corners[:, :, 2]
        outside = (
            (z < NEAR_M).all(axis=1)
            | (x < -(k.cx + 0.5) * z).all(axis=1)
            | (x > (k.width - 0.5 - k.cx) * z).all(axis=1)
            | (y < -(k.cy + 0.5) * z).all(axis=1)
            | (y > (k.height - 0.5 - k.cy) * z).all(axis=1)
        )
        return facing[~outside], corners[~outside]

    def _prepare(self, face: NDArray[np.intp], corners: FloatArray) -> tuple[Drawn, _Spans]:
        spans = self._spans(_clip_near(corners))
        bounds = _bounds(spans)
        keep = bounds[:, 2] > 0
        seen = _Spans(spans.start[keep], spans.row[keep], spans.count[keep], spans.first, spans.last)
        corners = corners[keep]
        edges = np.cross(corners, np.roll(corners, -1, axis=1)) @ self._pixel_to_ray
        to_plane = np.linalg.inv(texture_frames(corners)) @ self._pixel_to_ray
        return Drawn(face[keep], edges, to_plane, bounds[keep]), seen

    def _spans(self, polygons: FloatArray) -> _Spans:
        """Walk down the edges of convex polygons (M, K, 3), clockwise as seen, all ahead of the eye."""
        k = self.intrinsics
        v = polygons[:, :, 1] * (k.fy / polygons[:, :, 2]) + k.cy
        top = np.ceil(v).clip(0, k.height).astype(np.intp)
        row = top.min(axis=1)
        count = top.max(axis=1) - row
        start = np.cumsum(count) - count
        first = np.zeros(int(count.sum()), np.int16)
        last = np.zeros(len(first), np.int16)
        lines = np.cross(polygons, np.roll(polygons, -1, axis=1)) @ self._pixel_to_ray
        below = np.roll(top, -1, axis=1)
        # Clockwise on a screen whose v points down: edges that go down bound on the right.
        for side, from_row, to_row in ((last, top, below), (first, below, top)):
            owner, edge = np.nonzero(to_row > from_row)
            length = (to_row - from_row)[owner, edge]
            begin = np.cumsum(length) - length
            step = np.arange(int(length.sum()))
            a, b, c = lines[owner, edge].T
            rows = step + np.repeat(from_row[owner, edge] - begin, length)
            u = np.repeat(-b / a, length) * rows + np.repeat(-c / a, length)
            entry = step + np.repeat((start - row)[owner] + from_row[owner, edge] - begin, length)
            side[entry] = np.ceil(u).clip(0, k.width)
        return _Spans(start, row, count, first, last)

    def _draw_faces(self, drawn: Drawn, spans: _Spans) -> None:
        """Draw face after face where it is nearer than what is there already."""
        columns, steps = self._columns, self._steps
        slopes = drawn.to_plane[:, 2, 0].astype(np.float32)
        at_left = _inverse_depth_at_left(drawn, spans)
        begins = (spans.start - spans.row + drawn.bounds[:, 1]).tolist()
        first, last = spans.first[:, None], spans.last[:, None]
        for number, (u0, v0, u1, v1) in enumerate(drawn.bounds.tolist()):
            height, width = v1 - v0, u1 - u0
            size, shape = height * width, (height, width)
            rows = slice(begins[number], begins[number] + height)
            window = slice(v0, v1), slice(u0, u1)
            inside = self._inside[:size].reshape(shape)
            other = self._other[:size].reshape(shape)
            plane = self._plane[:size].reshape(shape)
            label = self._label[:size].reshape(shape)
            nearest = self.inverse_depth[window]
            np.add(steps[:, :width] * slopes[number], at_left[rows], out=plane)
            np.greater(plane, nearest, out=inside)
            np.greater_equal(columns[:, u0:u1], first[rows], out=other)
            np.logical_and(inside, other, out=inside)
            np.less(columns[:, u0:u1], last[rows], out=other)
            np.logical_and(inside, other, out=inside)
            mask = inside.view(np.uint8)
            cv2.copyTo(plane, mask, nearest)
            label.fill(number + 1)
            cv2.copyTo(label, mask, self.labels[window])


def _inverse_depth_at_left(drawn: Drawn, spans: _Spans) -> Float32Image:
    """Each face's inverse depth in each of its rows, in the first column of its bounds: (R, 1).

    Counting columns from there keeps the numbers that are added in float32 small.
    """
    plane = drawn.to_plane[:, 2]
    # Entries of faces that were dropped stay in the spans; only those of the kept ones are filled.
    values = np.zeros(len(spans.first))
    owner = np.repeat(np.arange(len(drawn)), spans.count)
    step = np.arange(len(owner)) - np.repeat(np.cumsum(spans.count) - spans.count, spans.count)
    at_top = plane[:, 2] + plane[:, 0] * drawn.bounds[:, 0] + plane[:, 1] * spans.row
    values[spans.start[owner] + step] = at_top[owner] + plane[owner, 1] * step
    return values.astype(np.float32)[:, None]


def texture_frames(corners: FloatArray) -> FloatArray:
    """Columns: the texture's u axis, its v axis, its origin (M, 3, 3).

    Of a trapezium, the longer of the upper and lower edge spans the texture.
    """
    upper, lower = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 3]
    longer = (upper * upper).sum(axis=1) >= (lower * lower).sum(axis=1)
    along_u = np.where(longer[:, None], upper, lower)
    middle_up = 0.5 * (corners[:, 0] + corners[:, 1])
    along_v = 0.5 * (corners[:, 2] + corners[:, 3]) - middle_up
    return np.stack([along_u, along_v, middle_up - 0.5 * along_u], axis=2)


def _clip_near(corners: FloatArray) -> FloatArray:
    """Cut four-cornered faces at NEAR_M: polygons (M, 5, 3), a corner repeated where fewer will do."""
    polygons = np.concatenate([corners, corners[:, 3:]], axis=1)
    crossing = np.flatnonzero(corners[:, :, 2].min(axis=1) < NEAR_M)
    if len(crossing) == 0:
        return polygons
    here = corners[crossing]
    after = np.roll(here, -1, axis=1)
    ahead = here[:, :, 2] >= NEAR_M
    cuts = ahead != np.roll(ahead, -1, axis=1)
    depth = np.where(cuts, after[:, :, 2] - here[:, :, 2], 1.0)
    cut = here + ((NEAR_M - here[:, :, 2]) / depth)[:, :, None] * (after - here)
    points = np.stack([here, cut], axis=2).reshape(len(here), 8, 3)
    used = np.stack([ahead, cuts], axis=2).reshape(len(here), 8)
    order = np.argsort(~used, axis=1, kind="stable")[:, :5]
    order = np.where(np.arange(5) < used.sum(axis=1, keepdims=True), order, order[:, :1])
    polygons[crossing] = np.take_along_axis(points, order[:, :, None], axis=1)
    return polygons


def _bounds(spans: _Spans) -> NDArray[np.int32]:
    """First column and row, last column and row + 1 that each face covers (M, 4); zeros for none."""
    bounds = np.zeros((len(spans.count), 4), np.int32)
    some = np.flatnonzero(spans.count)
    if len(some) == 0:
        return bounds
    starts = spans.start[some]
    empty = spans.last <= spans.first
    rows = np.arange(len(empty)) + np.repeat((spans.row - spans.start)[some], spans.count[some])
    bounds[some, 0] = np.minimum.reduceat(np.where(empty, np.int16(32767), spans.first), starts)
    bounds[some, 1] = np.minimum.reduceat(np.where(empty, 1 << 20, rows), starts)
    bounds[some, 2] = np.maximum.reduceat(np.where(empty, np.int16(0), spans.last), starts)
    bounds[some, 3] = np.maximum.reduceat(np.where(empty, 0, rows + 1), starts)
    return bounds
