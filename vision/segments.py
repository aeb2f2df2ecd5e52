"""Line segments: by the Hough transform and by the two ends of contours (Daeef 2020, "Find the best match").

A segment is kept as its two end points. An end in the middle of a straight edge would slide along
it, so each end is moved to the most corner-like pixel close by.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.edges import GreyImage

_SNAP_PX = 4
_WINDOW_PX = 3
_PATCH_PX = _SNAP_PX + _WINDOW_PX + 1


def hough_segments(edges: GreyImage, min_length_px: float) -> NDArray[np.float32]:
    """(N, 2, 2) segments of at least min_length_px that the probabilistic Hough transform finds."""
    found = cv2.HoughLinesP(
        edges, 1.0, np.pi / 180.0, int(0.8 * min_length_px), minLineLength=min_length_px, maxLineGap=3
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
    margin = _PATCH_PX + 1
    centre = np.rint(ends_px.reshape(-1, 2)).astype(np.intp)
    column = np.clip(centre[:, 0], margin, width - 1 - margin)
    row = np.clip(centre[:, 1], margin, height - 1 - margin)
    reach = np.arange(-_PATCH_PX, _PATCH_PX + 1)
    index = (row[:, None, None] + reach[:, None]) * width + column[:, None, None] + reach
    patch = grey.ravel()[index].astype(np.float32)
    du = 0.5 * (patch[:, 1:-1, 2:] - patch[:, 1:-1, :-2])
    dv = 0.5 * (patch[:, 2:, 1:-1] - patch[:, :-2, 1:-1])
    side = 2 * _SNAP_PX + 1
    products = (du * du, du * dv, dv * dv)
    tensor = np.stack([_box_sum(p).reshape(-1, side * side) for p in products], axis=-1)
    best = smaller_eigenvalue(*np.moveaxis(tensor, -1, 0)).argmax(axis=1)
    snapped = np.stack((column + best % side - _SNAP_PX, row + best // side - _SNAP_PX), axis=1)
    at_best = tensor[np.arange(len(best)), best]
    return snapped.astype(np.float32).reshape(-1, 2, 2), at_best.reshape(-1, 2, 3)


def _box_sum(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """(N, H - 6, W - 6) sums over 7x7 windows of values (N, H, W).

    All patches are filtered as one tall image; windows that would reach into a neighbour are cut off.
    """
    count, height, width = values.shape
    side = 2 * _WINDOW_PX + 1
    tall = values.reshape(count * height, width)
    summed = cv2.boxFilter(tall, cv2.CV_32F, (side, side), normalize=False, borderType=cv2.BORDER_CONSTANT)
    inner = slice(_WINDOW_PX, -_WINDOW_PX)
    return np.asarray(summed, np.float32).reshape(count, height, width)[:, inner, inner]


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
    length: NDArray[np.float32] = np.sqrt(np.square(difference).sum(axis=1))
    return length
