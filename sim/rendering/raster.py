"""Which face is seen at each pixel, and its depth: exact at the centres of the pixels.

The inverse depth of a face is affine in image coordinates, so depth has no interpolation error. Large faces
are drawn one after the other, each within its bounding rectangle. The many small ones (far goods, hands) are
drawn all at once, pixel by pixel, because one call per face would cost more than the pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray, Intrinsics, Pose
from sim.rendering.spans import NEAR_M, Spans, convert, edge_planes
from sim.world import Geometry

# Faces whose rectangle has fewer pixels than this are drawn all at once.
SMALL_PX = 1000

Float32Image = NDArray[np.float32]
LabelImage = NDArray[np.uint16]


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """M faces that reach the image, numbered 1..M in label images (0: nothing there).

    face: (M,), index into the geometry.
    edges: (M, 4, 3), edges @ (u, v, 1) is >= 0 inside the face.
    to_plane: (M, 3, 3), maps (u, v, 1) to (s, t, 1) / z, with s, t in 0..1 along the upper and the left side
        of the face (see texture_frames); its last row is therefore the inverse depth.
    bounds: (M, 4), first column and row, last column and row + 1.
    small: (M,), whether the face is drawn as a small one.
    small_pixels: (P,), flat indices of the pixels that show a small face.
    """

    face: NDArray[np.intp]
    edges: FloatArray
    to_plane: FloatArray
    bounds: NDArray[np.intp]
    small: NDArray[np.bool_]
    small_pixels: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.face)


class Rasteriser:
    """Draws geometry into its own buffers: inverse_depth (H, W) float32 in 1/m, and labels (H, W) uint16."""

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
        self._condition = np.empty(shape[0] * shape[1], np.bool_)
        self._pixel_to_ray = pixel_to_ray(intrinsics)

    def draw(self, geometry: Geometry, camera: Pose) -> Drawn:
        """Fill inverse_depth and labels with what camera (in the floor's frame) sees."""
        self.inverse_depth.fill(0.0)
        self.labels.fill(0)
        face, corners = self._front_faces(geometry, camera)
        spans = convert(corners, self.intrinsics)
        keep = np.flatnonzero(spans.bounds[:, 2] > 0)
        face, corners, spans = face[keep], corners[keep], spans.select(keep)
        to_plane = np.linalg.inv(texture_frames(corners)) @ self._pixel_to_ray
        size = (spans.bounds[:, 2] - spans.bounds[:, 0]) * (spans.bounds[:, 3] - spans.bounds[:, 1])
        small = size < SMALL_PX
        self._draw_large(np.flatnonzero(~small), to_plane[:, 2], spans)
        small_pixels = self._draw_small(np.flatnonzero(small), to_plane[:, 2], spans)
        edges = edge_planes(corners) @ self._pixel_to_ray
        return Drawn(face, edges, to_plane, spans.bounds, small, small_pixels)

    def _front_faces(self, geometry: Geometry, camera: Pose) -> tuple[NDArray[np.intp], FloatArray]:
        """The faces that face the camera and may reach into the image, and their corners in the optical
        frame."""
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

    def _draw_large(self, numbers: NDArray[np.intp], planes: FloatArray, spans: Spans) -> None:
        """Draw one face after the other, where it is nearer than what is there already."""
        columns, steps = self._columns, self._steps
        selected = spans.select(numbers)
        slopes = planes[numbers, 0].astype(np.float32)
        _, _, entry = selected.entries()
        at_left = np.empty((len(spans.first), 1), np.float32)
        at_left[entry, 0] = _inverse_depth_at_left(planes[numbers], selected)
        first_rows = (selected.start - selected.row + selected.bounds[:, 1]).tolist()
        first, last = spans.first[:, None], spans.last[:, None]
        for index, (u0, v0, u1, v1) in enumerate(selected.bounds.tolist()):
            height, width = v1 - v0, u1 - u0
            size, shape = height * width, (height, width)
            rows = slice(first_rows[index], first_rows[index] + height)
            window = slice(v0, v1), slice(u0, u1)
            inside = self._inside[:size].reshape(shape)
            condition = self._condition[:size].reshape(shape)
            plane = self._plane[:size].reshape(shape)
            label = self._label[:size].reshape(shape)
            nearest = self.inverse_depth[window]
            np.add(steps[:, :width] * slopes[index], at_left[rows], out=plane)
            np.greater(plane, nearest, out=inside)
            np.greater_equal(columns[:, u0:u1], first[rows], out=condition)
            np.logical_and(inside, condition, out=inside)
            np.less(columns[:, u0:u1], last[rows], out=condition)
            np.logical_and(inside, condition, out=inside)
            mask = inside.view(np.uint8)
            cv2.copyTo(plane, mask, nearest)
            label.fill(numbers[index] + 1)
            cv2.copyTo(label, mask, self.labels[window])

    def _draw_small(self, numbers: NDArray[np.intp], planes: FloatArray, spans: Spans) -> NDArray[np.intp]:
        """Draw many faces at once; return the pixels (flat indices) that show one of them."""
        depth, labels = self.inverse_depth.reshape(-1), self.labels.reshape(-1)
        selected = spans.select(numbers)
        face, row, entry = selected.entries()
        first = spans.first[entry].astype(np.intp)
        length = np.maximum(spans.last[entry] - first, 0)
        step = np.arange(int(length.sum())) - np.repeat(np.cumsum(length) - length, length)
        slope = planes[numbers, 0].astype(np.float32)[face]
        begin = _inverse_depth_at_left(planes[numbers], selected)
        begin += slope * (first - selected.bounds[face, 0]).astype(np.float32)
        pixel = np.repeat(row * self.intrinsics.width + first, length) + step
        inverse = np.repeat(begin, length) + np.repeat(slope, length) * step.astype(np.float32)
        label = np.repeat((numbers[face] + 1).astype(np.uint16), length)
        nearer = np.flatnonzero(inverse > depth[pixel])
        pixel, inverse, label = pixel[nearer], inverse[nearer], label[nearer]
        candidates, candidate_depths = pixel, inverse
        while len(pixel):
            # If several faces share a pixel, the last one is stored: repeat with those that are nearer than
            # it.
            depth[pixel], labels[pixel] = inverse, label
            nearer = np.flatnonzero(inverse > depth[pixel])
            pixel, inverse, label = pixel[nearer], inverse[nearer], label[nearer]
        visible: NDArray[np.intp] = candidates[depth[candidates] == candidate_depths]
        return visible


def _inverse_depth_at_left(planes: FloatArray, spans: Spans) -> NDArray[np.float32]:
    """The inverse depth (R,) of each face in each of its rows, at the first column of its bounds.

    Counting columns from there keeps the numbers that are added in float32 small.
    """
    face, row, _ = spans.entries()
    at_top = planes[:, 2] + planes[:, 0] * spans.bounds[:, 0]
    values: NDArray[np.float32] = (at_top[face] + planes[face, 1] * row).astype(np.float32)
    return values


def pixel_to_ray(k: Intrinsics) -> FloatArray:
    """The matrix (3, 3) from pixels (u, v, 1) to rays (x, y, 1) in the optical frame."""
    return np.array([[1.0 / k.fx, 0.0, -k.cx / k.fx], [0.0, 1.0 / k.fy, -k.cy / k.fy], [0.0, 0.0, 1.0]])


def texture_frames(corners: FloatArray) -> FloatArray:
    """Matrices (M, 3, 3) whose columns are the texture's u axis, its v axis and its origin.

    On a trapezium, the longer of the upper and the lower edge spans the texture.
    """
    upper, lower = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 3]
    longer = (upper * upper).sum(axis=1) >= (lower * lower).sum(axis=1)
    along_u = np.where(longer[:, None], upper, lower)
    middle_up = 0.5 * (corners[:, 0] + corners[:, 1])
    along_v = 0.5 * (corners[:, 2] + corners[:, 3]) - middle_up
    return np.stack([along_u, along_v, middle_up - 0.5 * along_u], axis=2)
