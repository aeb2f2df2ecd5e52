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
    """The columns first <= u < last that a face covers in each of its rows.

    Row v of face k is entry start[k] + v - row[k] of first and last; it has count[k] rows.
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
        self._columns_f = np.arange(intrinsics.width, dtype=np.float32)[None, :]
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
        for number in range(len(drawn)):
            self._draw_face(number, drawn, spans)
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
        edges = np.cross(corners, np.roll(corners, -1, axis=1)) @ self._pixel_to_ray
        origin = corners[:, 0]
        frame = np.stack([corners[:, 1] - origin, corners[:, 3] - origin, origin], axis=2)
        to_plane = np.linalg.inv(frame) @ self._pixel_to_ray
        spans = self._spans(_half_planes(edges, to_plane[:, 2]), *self._rows(corners))
        bounds = _bounds(spans)
        keep = bounds[:, 2] > 0
        seen = _Spans(spans.start[keep], spans.row[keep], spans.count[keep], spans.first, spans.last)
        return Drawn(face[keep], edges[keep], to_plane[keep], bounds[keep]), seen

    def _rows(self, corners: FloatArray) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """The first row that each face may touch, and how many; all rows where it passes beside the eye."""
        k = self.intrinsics
        z = corners[:, :, 2]
        ahead = z.min(axis=1) > NEAR_M
        v = corners[:, :, 1] * k.fy / np.where(ahead[:, None], z, 1.0) + k.cy
        first = np.where(ahead, np.ceil(v.min(axis=1) - 1e-6), 0.0).clip(0, k.height)
        last = np.where(ahead, np.floor(v.max(axis=1) + 1e-6) + 1.0, k.height).clip(0, k.height)
        return first.astype(np.intp), np.maximum(last - first, 0.0).astype(np.intp)

    def _spans(self, lines: FloatArray, row: NDArray[np.intp], count: NDArray[np.intp]) -> _Spans:
        """Cut every row by half planes (M, L, 3): inside is where lines @ (u, v, 1) >= 0 for all L."""
        width = self.intrinsics.width
        owner = np.repeat(np.arange(len(count)), count)
        start = np.cumsum(count) - count
        rows = np.arange(len(owner)) + (row - start)[owner]
        a, b, c = (np.ascontiguousarray(lines[:, :, i].T) for i in range(3))
        level = a == 0.0
        inverse = -1.0 / np.where(level, 1.0, a)
        crossing = (b * inverse)[:, owner] * rows + (c * inverse)[:, owner]
        bound = np.ceil(crossing.clip(-1.0, width))
        first = np.where((a > 0.0)[:, owner], bound, 0.0).max(axis=0, initial=0.0)
        last = np.where((a < 0.0)[:, owner], bound, width).min(axis=0, initial=width)
        for line in np.flatnonzero(level.any(axis=1)):
            last[level[line, owner] & (b[line, owner] * rows + c[line, owner] < 0.0)] = 0.0
        last[last <= first] = 0.0
        return _Spans(start, row, count, first.astype(np.int16), last.astype(np.int16))

    def _draw_face(self, number: int, drawn: Drawn, spans: _Spans) -> None:
        u0, v0, u1, v1 = drawn.bounds[number].tolist()
        height, width = v1 - v0, u1 - u0
        size, shape = height * width, (height, width)
        slope_u, slope_v, offset = drawn.to_plane[number, 2].tolist()
        begin = int(spans.start[number]) + v0 - int(spans.row[number])
        columns = self._columns[:, u0:u1]
        inside = self._inside[:size].reshape(shape)
        other = self._other[:size].reshape(shape)
        np.greater_equal(columns, spans.first[begin : begin + height, None], out=inside)
        np.less(columns, spans.last[begin : begin + height, None], out=other)
        np.logical_and(inside, other, out=inside)
        plane = self._plane[:size].reshape(shape)
        along_v = (slope_v * np.arange(v0, v1) + offset).astype(np.float32)
        np.add(self._columns_f[:, u0:u1] * np.float32(slope_u), along_v[:, None], out=plane)
        nearest = self.inverse_depth[v0:v1, u0:u1]
        np.greater(plane, nearest, out=other)
        np.logical_and(inside, other, out=inside)
        mask = inside.view(np.uint8)
        cv2.copyTo(plane, mask, nearest)
        label = self._label[:size].reshape(shape)
        label.fill(number + 1)
        cv2.copyTo(label, mask, self.labels[v0:v1, u0:u1])


def _half_planes(edges: FloatArray, inverse_depth: FloatArray) -> FloatArray:
    """The four edges, and the planes before NEAR_M and beyond FAR_M: (M, 6, 3)."""
    near, far = -inverse_depth, inverse_depth.copy()
    near[:, 2] += 1.0 / NEAR_M
    far[:, 2] -= 1.0 / FAR_M
    return np.concatenate([edges, near[:, None], far[:, None]], axis=1)


def _bounds(spans: _Spans) -> NDArray[np.int32]:
    """First column and row, last column and row + 1 that each face covers (M, 4); zeros for none."""
    bounds = np.zeros((len(spans.count), 4), np.int32)
    some = np.flatnonzero(spans.count)
    if len(some) == 0:
        return bounds
    starts, empty = spans.start[some], spans.last == 0
    rows = np.arange(len(empty)) + np.repeat((spans.row - spans.start)[some], spans.count[some])
    high = np.int32(1 << 20)
    bounds[some, 0] = np.minimum.reduceat(np.where(empty, high, spans.first), starts)
    bounds[some, 1] = np.minimum.reduceat(np.where(empty, high, rows), starts)
    bounds[some, 2] = np.maximum.reduceat(spans.last, starts)
    bounds[some, 3] = np.maximum.reduceat(np.where(empty, 0, rows + 1), starts)
    return bounds
