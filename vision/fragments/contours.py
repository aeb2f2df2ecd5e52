"""Contours: continuous runs of edge pixels, filtered by length (Daeef 2020: 32 px or more)."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled
from hal.records import record
from vision.fragments.edges import GreyImage

_PIECE = 1.5  # maximum length of a piece of a contour, relative to the minimum length


@record(frozen=True, slots=True, eq=False)
class Contours:
    """ends_px (N, 2, 2): the two ends of each piece of a contour. edges (H, W): edge image without the short
    contours."""

    ends_px: NDArray[np.float32]
    edges: GreyImage


def find_contours(edges: GreyImage, min_length_px: float) -> Contours:
    """The contours of an edge image that are at least min_length_px long, as pieces with two ends.

    OpenCV follows an open curve one pixel wide there and back, so the curve is half as long as its list of
    points. A long list is cut into equal pieces of min_length_px to 1.5 min_length_px, since the two ends of
    a winding contour would tell nothing about its course in between.
    """
    found, _ = cv2.findContours(edges, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    kept = [curve for curve in found if len(curve) >= 2.0 * min_length_px]
    if not kept:
        return Contours(np.empty((0, 2, 2), np.float32), np.zeros_like(edges))
    lengths = np.array([len(curve) for curve in kept])
    points = np.asarray(np.concatenate(kept), np.int32)
    return Contours(*_drawn(points, lengths, _PIECE * min_length_px, *edges.shape))


@compiled("int32[:, :, ::1], int64[::1], float64, int64, int64")
def _drawn(
    points: NDArray[np.int32],
    lengths: NDArray[np.intp],
    longest_px: float,
    height: int,
    width: int,
) -> tuple[NDArray[np.float32], GreyImage]:
    """The two ends of each piece, (N, 2, 2), and an image (height, width) of all points (P, 1, 2).

    lengths: number of points of each curve, in turn. longest_px: maximum length of a piece.
    """
    pieces, count = np.empty(len(lengths), np.intp), 0
    for curve in range(len(lengths)):
        pieces[curve] = math.ceil(lengths[curve] / longest_px)
        count += pieces[curve]
    ends_px, image = np.empty((count, 2, 2), np.float32), np.zeros((height, width), np.uint8)
    start, one = 0, 0
    for curve in range(len(lengths)):
        step = lengths[curve] / pieces[curve]
        for rank in range(pieces[curve]):
            last = min(int((rank + 1) * step), lengths[curve] - 1)
            for axis in range(2):
                ends_px[one, 0, axis] = points[start + int(rank * step), 0, axis]
                ends_px[one, 1, axis] = points[start + last, 0, axis]
            one += 1
        start += lengths[curve]
    for n in range(len(points)):
        image[points[n, 0, 1], points[n, 0, 0]] = 255
    return ends_px, image
