"""Smooth edges between faces: each pixel that an edge crosses gets both colours, by the share it covers.

The label image says between which neighbours an edge passes; the nearer face's edge function says where,
to a fraction of a pixel (geometric post-process anti-aliasing). Only those pixels are touched.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hal.types import ColourImage
from sim.raster import Drawn, Float32Image, LabelImage


def smooth_edges(colour: ColourImage, labels: LabelImage, inverse_depth: Float32Image, drawn: Drawn) -> None:
    """Blend in place along edges that are nearer to upright (across) and nearer to level (down)."""
    edges = np.concatenate([np.zeros((1, 4, 3)), drawn.edges]).astype(np.float32)
    width = labels.shape[1]
    flat_colour = colour.reshape(-1, 3)
    across = np.flatnonzero(labels[:, 1:] != labels[:, :-1])
    across += across // (width - 1)
    down = np.flatnonzero(labels[1:] != labels[:-1])
    changes = [
        _blend(flat_colour, labels, inverse_depth, edges, across, step=1),
        _blend(flat_colour, labels, inverse_depth, edges, down, step=width),
    ]
    for pixels, values in changes:
        flat_colour[pixels] = values


def _blend(
    colour: ColourImage,
    labels: LabelImage,
    inverse_depth: Float32Image,
    edges: NDArray[np.float32],
    here: NDArray[np.intp],
    step: int,
) -> tuple[NDArray[np.intp], ColourImage]:
    """New colours for the pixels that an edge between here and here + step crosses."""
    width = labels.shape[1]
    there = here + step
    flat_labels, flat_depth = labels.ravel(), inverse_depth.ravel()
    swap = flat_depth[there] > flat_depth[here]
    inside, outside = np.where(swap, there, here), np.where(swap, here, there)
    lines = edges[flat_labels[inside]]
    v, u = np.divmod(inside, width)
    at_inside = lines[:, :, 0] * u[:, None] + lines[:, :, 1] * v[:, None] + lines[:, :, 2]
    slope = lines[:, :, 0] if step == 1 else lines[:, :, 1]
    at_outside = at_inside + slope * np.where(swap, -1.0, 1.0).astype(np.float32)[:, None]
    steep = np.abs(lines[:, :, 0]) >= np.abs(lines[:, :, 1])
    crossing = (at_outside < 0.0) & (steep if step == 1 else ~steep)
    reach = np.where(crossing, at_inside / np.where(crossing, at_inside - at_outside, 1.0), 2.0).min(axis=1)
    found = (reach >= 0.0) & (reach <= 1.0)
    inside, outside, reach = inside[found], outside[found], reach[found]
    # The edge lies reach pixels beyond the inner pixel's centre: it cuts that pixel or the next one.
    cuts_inner = reach < 0.5
    pixel = np.where(cuts_inner, inside, outside)
    partner = np.where(cuts_inner, outside, inside)
    share = np.abs(reach - 0.5)[:, None]
    mixed = colour[pixel] * (1.0 - share) + colour[partner] * share
    return pixel, (mixed + 0.5).astype(np.uint8)
