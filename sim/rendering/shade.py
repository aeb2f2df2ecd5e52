"""Colours what the rasteriser drew: the texture of each visible face, in perspective and with its
lighting."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from config.scenario import Light
from hal.types import FloatArray
from sim.models.textures import STEPS_PER_OCTAVE, TexelPool, TextureStore
from sim.rendering.raster import Drawn, LabelImage
from sim.world import Geometry

# Maximum ratio of distances within a part of a face that uses one step of the pyramid.
_DEPTH_RATIO = 1.4
_FARTHEST_M = 60.0  # parts farther away than this use the same step: no hall is larger

Rectangle = tuple[int, int, int, int]  # first column and row, last column and row + 1


@dataclass(frozen=True, slots=True, eq=False)
class _Parts:
    """P rectangles of the image to fill, each from one texture at one scale.

    number: P indices of faces in Drawn.
    rectangle: P rectangles.
    to_sheet: (P, 3, 3), from pixels of the rectangle to texture coordinates, relative to the first
        whole tile.
    steps: (P, 2), steps of the pyramid along u and v.
    tiles: (P, 2), number of copies of the texture side by side along u and v.
    """

    number: list[int]
    rectangle: list[Rectangle]
    to_sheet: FloatArray
    steps: list[list[int]]
    tiles: list[list[int]]


class Painter:
    """Fills an image (H, W, 4). The fourth channel is unused: OpenCV warps four twice as fast as three."""

    def __init__(self, shape: tuple[int, int], textures: TextureStore, keys: tuple[str, ...]) -> None:
        self.colour: NDArray[np.uint8] = np.zeros((*shape, 4), np.uint8)
        self._textures = textures
        self._keys = keys
        self._sizes = np.array([textures.size(key) for key in keys], dtype=np.float64).reshape(-1, 2)
        self._patch = np.empty(shape[0] * shape[1] * 4, np.uint8)
        self._mask = np.empty(shape[0] * shape[1], np.bool_)
        self._pool = TexelPool(textures)

    def paint(self, labels: LabelImage, drawn: Drawn, geometry: Geometry, light: Light) -> None:
        """Colour every labelled pixel; the others become black."""
        self.colour.fill(0)
        gains = _gains(geometry.normals[drawn.face], light)
        self._paint_large(labels, drawn, geometry, gains.tolist())
        self._paint_small(labels, drawn, geometry, gains)

    def _paint_large(self, labels: LabelImage, drawn: Drawn, geometry: Geometry, gains: list[float]) -> None:
        """Paint large faces rectangle by rectangle, with OpenCV."""
        parts = self._parts(*self._visible(labels, drawn), drawn, geometry)
        texture = geometry.texture[drawn.face].tolist()
        for index, (left, top, right, bottom) in enumerate(parts.rectangle):
            number = parts.number[index]
            sheet = self._textures.sheet(
                self._keys[texture[number]], *parts.steps[index], *parts.tiles[index]
            )
            width, height = right - left, bottom - top
            patch = self._patch[: width * height * 4].reshape(height, width, 4)
            cv2.warpPerspective(
                sheet.image, sheet.texture_to_pixel @ parts.to_sheet[index], (width, height), dst=patch,
                flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, borderMode=cv2.BORDER_CONSTANT,
            )  # fmt: skip
            cv2.convertScaleAbs(patch, dst=patch, alpha=gains[number])
            mask = self._mask[: width * height].reshape(height, width)
            np.equal(labels[top:bottom, left:right], number + 1, out=mask)
            cv2.copyTo(patch, mask.view(np.uint8), self.colour[top:bottom, left:right])

    def _paint_small(self, labels: LabelImage, drawn: Drawn, geometry: Geometry, gains: FloatArray) -> None:
        """Paint all pixels of small faces at once, each from the four texels around it."""
        pixel = drawn.small_pixels
        label = labels.reshape(-1)[pixel]
        shown = np.zeros(len(drawn) + 1, np.bool_)
        shown[label] = True
        numbers = np.flatnonzero(shown[1:])
        if len(numbers) == 0:
            return
        index_of = np.zeros(len(drawn) + 1, np.intp)
        index_of[numbers + 1] = np.arange(len(numbers))
        index = index_of[label]
        face = drawn.face[numbers]
        texture = geometry.texture[face]
        to_uv = _window_matrices(geometry.windows[face]) @ drawn.to_plane[numbers]
        bounds = drawn.bounds[numbers].astype(np.float64)
        steps = _pyramid_steps(to_uv, bounds, self._sizes[texture])
        places = np.array(
            [
                self._pool.place(self._keys[t], u, v)
                for t, (u, v) in zip(texture.tolist(), steps.tolist(), strict=True)
            ]
        )
        u, v = _texture_coordinates(to_uv, bounds, pixel, index, labels.shape[1])
        texels = _interpolate(self._pool.texels, places, index, u, v)
        values = np.minimum(texels * gains[numbers].astype(np.float32)[index, None] + 0.5, 255.0)
        self.colour.reshape(-1).view(np.uint32)[pixel] = values.astype(np.uint8).view(np.uint32)[:, 0]

    def _visible(self, labels: LabelImage, drawn: Drawn) -> tuple[list[int], list[Rectangle]]:
        """The large faces that are visible, and rectangles around their visible pixels."""
        numbers, rectangles = [], []
        large = np.flatnonzero(~drawn.small)
        for number, (u0, v0, u1, v1) in zip(large.tolist(), drawn.bounds[large].tolist(), strict=True):
            mask = self._mask[: (v1 - v0) * (u1 - u0)].reshape(v1 - v0, u1 - u0)
            np.equal(labels[v0:v1, u0:u1], number + 1, out=mask)
            du, dv, width, height = cv2.boundingRect(mask.view(np.uint8))
            if width > 0:
                numbers.append(number)
                rectangles.append((u0 + du, v0 + dv, u0 + du + width, v0 + dv + height))
        return numbers, rectangles

    def _parts(
        self, numbers: list[int], rectangles: list[Rectangle], drawn: Drawn, geometry: Geometry
    ) -> _Parts:
        numbers, rectangles = _split(numbers, rectangles, drawn)
        face = drawn.face[numbers]
        windows = geometry.windows[face]
        to_uv = _window_matrices(windows) @ drawn.to_plane[numbers]
        bounds = np.array(rectangles, dtype=np.float64).reshape(-1, 4)
        steps = _pyramid_steps(to_uv, bounds, self._sizes[geometry.texture[face]])
        first, tiles = _tiles(to_uv, bounds, windows)
        to_sheet = to_uv
        to_sheet[:, :2] -= first[:, :, None] * to_uv[:, 2:3]
        to_sheet[:, :, 2] += to_sheet[:, :, 0] * bounds[:, 0:1] + to_sheet[:, :, 1] * bounds[:, 1:2]
        return _Parts(numbers, rectangles, to_sheet, steps.tolist(), tiles.tolist())


def _gains(normals: FloatArray, light: Light) -> FloatArray:
    """The brightness of faces: an ambient share, and one that depends on their direction."""
    azimuth = math.radians(light.azimuth_deg)
    towards_light = np.array([0.62 * math.cos(azimuth), 0.62 * math.sin(azimuth), 0.78])
    towards = normals @ (towards_light / np.linalg.norm(towards_light))
    # Faces turned away from the lamps still get light that the floor and the goods reflect.
    direct = np.maximum(towards, 0.0) + 0.25 * np.maximum(-towards, 0.0)
    gains: FloatArray = light.exposure * (light.ambient + (1.0 - light.ambient) * direct)
    return gains


def _window_matrices(windows: FloatArray) -> FloatArray:
    """Matrices (P, 3, 3) from (s, t) on faces to (u, v) in textures."""
    matrices = np.zeros((len(windows), 3, 3))
    matrices[:, 0, 0] = windows[:, 2] - windows[:, 0]
    matrices[:, 1, 1] = windows[:, 3] - windows[:, 1]
    matrices[:, :2, 2] = windows[:, :2]
    matrices[:, 2, 2] = 1.0
    return matrices


def _texture_coordinates(
    to_uv: FloatArray, bounds: FloatArray, pixel: NDArray[np.intp], index: NDArray[np.intp], width: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Texture coordinates (P,), (P,) in 0..1 at pixels (P,). index (P,): which matrix to use for each."""
    # Relative to each face's own corner, float32 is accurate enough.
    origin = to_uv @ np.concatenate([bounds[:, :2], np.ones((len(bounds), 1))], axis=1)[:, :, None]
    table = np.concatenate([to_uv[:, :, :2], origin], axis=2).astype(np.float32).reshape(-1, 9).T
    row, column = np.divmod(pixel.astype(np.int32), np.int32(width))
    du = (column - bounds[:, 0].astype(np.int32)[index]).astype(np.float32)
    dv = (row - bounds[:, 1].astype(np.int32)[index]).astype(np.float32)
    terms = np.take(table, index, axis=1)
    x, y, w = (terms[k] * du + terms[k + 1] * dv + terms[k + 2] for k in (0, 3, 6))
    u, v = x / w, y / w
    u -= np.floor(u)
    v -= np.floor(v)
    return u, v


def _interpolate(
    texels: NDArray[np.uint32],
    places: NDArray[np.intp],
    index: NDArray[np.intp],
    u: NDArray[np.float32],
    v: NDArray[np.float32],
) -> NDArray[np.float32]:
    """Bilinear samples (P, 4) of sheets. places: their (begin, width, height), with the rim of one texel."""
    begin, width, height = places.T
    inner_width, inner_height = (width - 2).astype(np.float32), (height - 2).astype(np.float32)
    x, y = u * inner_width[index] + np.float32(0.5), v * inner_height[index] + np.float32(0.5)
    left, top = x.astype(np.intp), y.astype(np.intp)
    right_weight, lower_weight = (x - left)[:, None], (y - top)[:, None]
    stride = width[index]
    at = begin[index] + top * stride + left
    upper = _mix(texels, at, right_weight)
    lower = _mix(texels, at + stride, right_weight)
    samples: NDArray[np.float32] = upper + (lower - upper) * lower_weight
    return samples


def _mix(
    texels: NDArray[np.uint32], at: NDArray[np.intp], weight: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Linear interpolation (P, 4) between the texels at and at + 1, for each channel."""
    here = texels[at].view(np.uint8).reshape(-1, 4).astype(np.float32)
    after = texels[at + 1].view(np.uint8).reshape(-1, 4).astype(np.float32)
    mixed: NDArray[np.float32] = here + (after - here) * weight
    return mixed


def _split(
    numbers: list[int], rectangles: list[Rectangle], drawn: Drawn
) -> tuple[list[int], list[Rectangle]]:
    """Divide rectangles over which the distance changes much, along the axis in which it changes most."""
    planes = drawn.to_plane[numbers, 2]
    bounds = np.array(rectangles, dtype=np.float64).reshape(-1, 4)
    extent = bounds[:, 2:] - bounds[:, :2]
    centre = 0.5 * (bounds[:, 2:] + bounds[:, :2] - 1.0)
    middle = (planes[:, :2] * centre).sum(axis=1) + planes[:, 2]
    change = np.abs(planes[:, :2]) * extent
    half = 0.5 * change.max(axis=1)
    low = np.maximum(middle - half, 1.0 / _FARTHEST_M)
    high = np.maximum(middle + half, low)
    counts = np.ceil(np.log(high / low) / math.log(_DEPTH_RATIO) - 1e-9).astype(int)
    out_numbers, out_rectangles = [], []
    for index, count in enumerate(counts.tolist()):
        if count < 2:
            out_numbers.append(numbers[index])
            out_rectangles.append(rectangles[index])
            continue
        axis = int(change[index, 1] > change[index, 0])
        stops = low[index] * (high[index] / low[index]) ** (np.arange(1, count) / count)
        cuts = centre[index, axis] + (stops - middle[index]) / planes[index, axis]
        for piece in _cut(rectangles[index], axis, cuts):
            out_numbers.append(numbers[index])
            out_rectangles.append(piece)
    return out_numbers, out_rectangles


def _cut(rectangle: Rectangle, axis: int, cuts: FloatArray) -> list[Rectangle]:
    """A rectangle divided at columns (axis 0) or rows (axis 1)."""
    first, last = rectangle[axis], rectangle[axis + 2]
    stops = sorted({first, last, *np.rint(cuts).clip(first, last).astype(int).tolist()})
    pieces = []
    for begin, end in itertools.pairwise(stops):
        piece = list(rectangle)
        piece[axis], piece[axis + 2] = begin, end
        pieces.append((piece[0], piece[1], piece[2], piece[3]))
    return pieces


def _pyramid_steps(to_uv: FloatArray, bounds: FloatArray, sizes: FloatArray) -> NDArray[np.intp]:
    """The steps (P, 2) of the pyramid at which the pixel in the middle of a part covers about one texel along
    each axis of the texture."""
    u, v = 0.5 * (bounds[:, 0] + bounds[:, 2] - 1.0), 0.5 * (bounds[:, 1] + bounds[:, 3] - 1.0)
    at_centre = to_uv[:, :, 0] * u[:, None] + to_uv[:, :, 1] * v[:, None] + to_uv[:, :, 2]
    z = 1.0 / np.maximum(at_centre[:, 2], 1.0 / _FARTHEST_M)
    place = at_centre[:, :2] * z[:, None]
    slopes = to_uv[:, :2, :2] - place[:, :, None] * to_uv[:, 2:3, :2]
    texels = np.hypot(slopes[:, :, 0], slopes[:, :, 1]) * z[:, None] * sizes
    desired = np.rint(STEPS_PER_OCTAVE * np.log2(np.maximum(texels, 1.0)))
    max_steps = np.floor(STEPS_PER_OCTAVE * np.log2(sizes))
    steps: NDArray[np.intp] = np.minimum(desired, max_steps).astype(np.intp)
    return steps


def _tiles(to_uv: FloatArray, bounds: FloatArray, windows: FloatArray) -> tuple[FloatArray, NDArray[np.intp]]:
    """The first whole tile (P, 2) that each part touches, and the number of tiles it spans (P, 2)."""
    low, high = np.minimum(windows[:, :2], windows[:, 2:]), np.maximum(windows[:, :2], windows[:, 2:])
    first, tiles = np.zeros_like(low), np.ones(low.shape, dtype=np.intp)
    wraps = np.flatnonzero((low < 0.0).any(axis=1) | (high > 1.0).any(axis=1))
    if len(wraps) == 0:
        return first, tiles
    low, high, rect = low[wraps], high[wraps], bounds[wraps]
    corners = np.ones((len(wraps), 3, 4))
    corners[:, 0] = rect[:, [0, 2, 2, 0]] - 0.5
    corners[:, 1] = rect[:, [1, 1, 3, 3]] - 0.5
    projected = to_uv[wraps] @ corners
    in_front = np.min(projected[:, 2], axis=1, keepdims=True) > 1.0 / 500.0
    place = projected[:, :2] / np.where(in_front, projected[:, 2], 1.0)[:, None, :]
    low = np.where(in_front, np.clip(place.min(axis=2), low, high), low)
    high = np.where(in_front, np.clip(place.max(axis=2), low, high), high)
    first[wraps] = np.floor(low)
    tiles[wraps] = np.maximum(np.ceil(high) - np.floor(low), 1.0)
    return first, tiles
