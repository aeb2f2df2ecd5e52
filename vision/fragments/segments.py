"""Line segments: by the Hough transform and by the two ends of contours (Daeef 2020, "Find the best match").

A segment is kept as its two end points. An end in the middle of a straight edge would slide along
it, so each end is moved to the most corner-like pixel close by.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.fragments.contours import find_contours
from vision.fragments.edges import GreyImage

FloatImage = NDArray[np.float32]

_SNAP_PX = 4  # how far an end may be moved: edges end somewhat before a corner
_WINDOW_PX = 3  # on either side: 7x7, less than the 11x11 that is followed
_MARGIN_PX = _SNAP_PX + _WINDOW_PX + 2
_ONES = np.ones(2 * _WINDOW_PX + 1)
# A segment of 32 px turns by somewhat more when an end moves by a pixel: finer says no more. Upright, level
# and diagonal lines are met exactly.
_ANGLE_RAD = math.pi / 120.0


def find_segments(edges: GreyImage, min_length_px: float, corner_px: tuple[int, int]) -> NDArray[np.float32]:
    """(N, 2, 2) segments of one part of an image, by the Hough transform and by contours; short contours take
    part in neither. edges (H, W): of that part; corner_px (u, v): its upper left pixel in the image."""
    contours = find_contours(edges, min_length_px)
    found = np.concatenate((hough_segments(contours.edges, min_length_px), contours.ends_px))
    found += np.array(corner_px, np.float32)
    return found


def longest_first(segments_px: NDArray[np.float32]) -> NDArray[np.float32]:
    """Segments (N, 2, 2) by their length; of equal ones the first stays first."""
    ordered: NDArray[np.float32] = segments_px[np.argsort(-lengths_px(segments_px), kind="stable")]
    return ordered


def hough_segments(edges: GreyImage, min_length_px: float) -> NDArray[np.float32]:
    """(N, 2, 2) segments of at least min_length_px that the probabilistic Hough transform finds."""
    found = cv2.HoughLinesP(
        edges, 1.0, _ANGLE_RAD, int(0.8 * min_length_px), minLineLength=min_length_px, maxLineGap=3
    )
    if found is None:
        return np.empty((0, 2, 2), np.float32)
    return np.asarray(found, dtype=np.float32).reshape(-1, 2, 2)


def snap_to_corners(
    grey: GreyImage, ends_px: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The ends (N, 2, 2), each at the pixel within 4 px whose surroundings are most corner-like, and the
    structure tensor there (N, 2, 3): uu, uv, vv of the grey level's gradient, summed over 7x7 px.

    Corner-like: largest smaller eigenvalue of the structure tensor (Shi and Tomasi).
    """
    if len(ends_px) == 0:
        return ends_px, np.empty((0, 2, 3), np.float32)
    height, width = grey.shape
    centre = np.rint(ends_px.reshape(-1, 2)).astype(np.intp)
    column = np.minimum(np.maximum(centre[:, 0], _MARGIN_PX), width - 1 - _MARGIN_PX)
    row = np.minimum(np.maximum(centre[:, 1], _MARGIN_PX), height - 1 - _MARGIN_PX)
    # The ends lie close together in one band of the image: filtering that is less than filtering patches.
    left, top = int(column.min()) - _MARGIN_PX, int(row.min()) - _MARGIN_PX
    right, bottom = int(column.max()) + _MARGIN_PX + 1, int(row.max()) + _MARGIN_PX + 1
    tensor = _structure(grey[top:bottom, left:right])
    reach = np.arange(-_SNAP_PX, _SNAP_PX + 1)
    around = (reach[:, None] * (right - left) + reach).ravel()
    index = ((row - top) * (right - left) + (column - left))[:, None] + around
    uu, uv, vv = (part.ravel().take(index) for part in tensor)
    best = smaller_eigenvalue(uu, uv, vv).argmax(axis=1)
    side = len(reach)
    down = best // side
    snapped = np.empty((len(best), 2), np.float32)
    snapped[:, 0] = column + (best - down * side) - _SNAP_PX
    snapped[:, 1] = row + down - _SNAP_PX
    at_best = np.empty((len(best), 3), np.float32)
    place = np.arange(len(best)) * around.size + best
    for entry, part in enumerate((uu, uv, vv)):
        part.take(place, out=at_best[:, entry])
    return snapped.reshape(-1, 2, 2), at_best.reshape(-1, 2, 3)


def _structure(grey: GreyImage) -> tuple[FloatImage, FloatImage, FloatImage]:
    """uu, uv, vv of the structure tensor (H, W), summed over 7x7 px; not valid within 4 px of the border."""
    du = cv2.Sobel(grey, cv2.CV_32F, 1, 0, ksize=1, scale=0.5)
    dv = cv2.Sobel(grey, cv2.CV_32F, 0, 1, ksize=1, scale=0.5)
    # Sums of whole quarters, far below 2^24 of them: exact, in whatever order they are added up.
    uu, uv, vv = (
        np.asarray(cv2.sepFilter2D(cv2.multiply(a, b), cv2.CV_32F, _ONES, _ONES), np.float32)
        for a, b in ((du, du), (du, dv), (dv, dv))
    )
    return uu, uv, vv


def smaller_eigenvalue(
    uu: NDArray[np.float32], uv: NDArray[np.float32], vv: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Of the symmetric 2x2 matrices with these entries."""
    half_difference = 0.5 * (uu - vv)
    smaller: NDArray[np.float32] = 0.5 * (uu + vv) - np.sqrt(half_difference * half_difference + uv * uv)
    return smaller


def lengths_px(ends_px: NDArray[np.float32]) -> NDArray[np.float32]:
    """(N,) L_t of the paper: distance between the two ends."""
    difference = ends_px[:, 0] - ends_px[:, 1]
    du, dv = difference.T
    length: NDArray[np.float32] = np.sqrt(du * du + dv * dv)
    return length
