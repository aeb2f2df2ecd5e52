"""Smooth edges between faces: a pixel that an edge crosses gets both colours, by the shares they cover.

The label image shows between which neighbours an edge passes. The edge function of the nearer face gives its
position to a fraction of a pixel (geometric post-process anti-aliasing). Only those pixels are changed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.rendering.raster import Drawn, Float32Image, LabelImage

# Bits that are set for a difference of 16 or more grey levels in one of three channels.
_VISIBLE_STEP = np.uint32(0x00F0F0F0)
# Lower bounds of the distance to an edge, and of the slope towards it; see _blend().
_ON_EDGE, _NOT_APPROACHED = np.float32(1e-9), np.float32(1e-12)


def smooth_edges(
    colour: NDArray[np.uint8], labels: LabelImage, inverse_depth: Float32Image, drawn: Drawn
) -> None:
    """Blend colour (H, W, 4) in place: across upright edges between columns, across level edges between
    rows."""
    lines = np.zeros((3, 4, len(drawn) + 1), np.float32)
    lines[:, :, 1:] = drawn.edges.transpose(2, 1, 0)
    # Each edge is blended in one direction only: along the row or the column that crosses it more steeply.
    upright = np.abs(lines[0]) >= np.abs(lines[1])
    width = labels.shape[1]
    pixels = colour.reshape(-1, 4).view(np.uint32)[:, 0]
    flat = labels.reshape(-1)
    across = np.flatnonzero(flat[1:] != flat[:-1])
    across = _contrasting(pixels, across[(across + 1) % width != 0], 1)
    down = _contrasting(pixels, np.flatnonzero(flat[width:] != flat[:-width]), width)
    # With a slope of zero, an edge of the other direction never cuts.
    columns = _blend(pixels, labels, inverse_depth, lines, np.where(upright, lines[0], 0.0), across, 1)
    rows = _blend(pixels, labels, inverse_depth, lines, np.where(upright, 0.0, lines[1]), down, width)
    for where, values in (columns, rows):
        pixels[where] = values


def _contrasting(pixels: NDArray[np.uint32], first: NDArray[np.intp], stride: int) -> NDArray[np.intp]:
    """The pixels of first that differ enough in some channel from the pixel stride further on for a jagged
    edge to be visible."""
    values, neighbour_values = pixels[first].view(np.uint8), pixels[first + stride].view(np.uint8)
    difference = np.maximum(values, neighbour_values) - np.minimum(values, neighbour_values)
    kept: NDArray[np.intp] = first[(difference.view(np.uint32) & _VISIBLE_STEP) != 0]
    return kept


def _blend(
    pixels: NDArray[np.uint32],
    labels: LabelImage,
    inverse_depth: Float32Image,
    lines: NDArray[np.float32],
    slopes: NDArray[np.float32],
    first: NDArray[np.intp],
    stride: int,
) -> tuple[NDArray[np.intp], NDArray[np.uint32]]:
    """New colours for the pixels that an edge cuts between the pixels first and those stride further on."""
    depth = inverse_depth.reshape(-1)
    behind = depth[first + stride] > depth[first]
    inside = first + stride * behind
    label = labels.reshape(-1)[inside]
    row, column = np.divmod(inside.astype(np.int32), np.int32(labels.shape[1]))
    slope_towards = np.take(slopes, label, axis=1) * (np.float32(1.0) - 2.0 * behind.astype(np.float32))
    at_inside = np.take(lines[0], label, axis=1) * column.astype(np.float32)
    at_inside += np.take(lines[1], label, axis=1) * row.astype(np.float32)
    at_inside += np.take(lines[2], label, axis=1)
    # With float32, a centre exactly on an edge may come out slightly outside: it is kept inside. The distance
    # to an edge that is not approached becomes nearly infinite.
    distances = np.maximum(at_inside, _ON_EDGE) / np.maximum(-slope_towards, _NOT_APPROACHED)
    distance = np.minimum(np.minimum(distances[0], distances[1]), np.minimum(distances[2], distances[3]))
    cut = np.flatnonzero(distance <= 1.0)
    inside, distance = inside[cut], distance[cut]
    outside = inside + (stride - 2 * stride * behind[cut])
    # The edge lies distance pixels beyond the inner pixel's centre: it cuts that pixel or the next one.
    cuts_inner = distance < 0.5
    pixel = np.where(cuts_inner, inside, outside)
    partner = np.where(cuts_inner, outside, inside)
    own, other = _channels(pixels, pixel), _channels(pixels, partner)
    mixed = own + (other - own) * np.abs(distance - 0.5)[:, None] + 0.5
    return pixel, mixed.astype(np.uint8).view(np.uint32)[:, 0]


def _channels(pixels: NDArray[np.uint32], where: NDArray[np.intp]) -> NDArray[np.float32]:
    return pixels[where][:, None].view(np.uint8).astype(np.float32)
