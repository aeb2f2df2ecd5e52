"""Contours: continuous runs of edge pixels, filtered by length (Daeef 2020: from 32 px on)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.fragments.edges import GreyImage

_PIECE = 1.5  # a piece of a contour is at most this many times the least length


@dataclass(frozen=True, slots=True, eq=False)
class Contours:
    """ends_px (N, 2, 2): the two ends of each piece of a contour. edges (H, W) uint8: what is left of
    the edge image when the short contours are taken away."""

    ends_px: NDArray[np.float32]
    edges: GreyImage


def find_contours(edges: GreyImage, min_length_px: float) -> Contours:
    """The contours of an edge image that are at least min_length_px long, as pieces with two ends.

    An open curve one pixel wide is walked there and back, so its length is half of the walk. A long walk
    is cut into equal pieces of min_length_px to 1.5 min_length_px: the two ends of a winding contour
    would say nothing of what lies between them.
    """
    found, _ = cv2.findContours(edges, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    kept = [curve for curve in found if len(curve) >= 2.0 * min_length_px]
    remaining = np.zeros_like(edges)
    if not kept:
        return Contours(np.empty((0, 2, 2), np.float32), remaining)
    points = np.concatenate(kept)[:, 0, :]
    remaining.ravel()[points[:, 1] * edges.shape[1] + points[:, 0]] = 255
    lengths = np.array([len(curve) for curve in kept])
    starts = np.cumsum(lengths) - lengths
    pieces = np.ceil(lengths / (_PIECE * min_length_px)).astype(np.intp)
    owner = np.repeat(np.arange(len(kept)), pieces)
    rank = np.arange(len(owner)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    step = (lengths / pieces)[owner]
    first = starts[owner] + (rank * step).astype(np.intp)
    last = starts[owner] + np.minimum(((rank + 1) * step).astype(np.intp), lengths[owner] - 1)
    ends_px = np.empty((len(owner), 2, 2), np.float32)
    ends_px[:, 0], ends_px[:, 1] = points[first], points[last]
    return Contours(ends_px, remaining)
