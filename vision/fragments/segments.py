"""Line segments: by the Hough transform and by the two ends of contours (Daeef 2020, "Find the best match").

A segment is stored as its two end points. An end in the middle of a straight edge would slide along the edge,
so each end is moved to the most corner-like pixel close by.
"""

from __future__ import annotations

import math
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled, in_place, inlined
from vision.fragments.contours import find_contours
from vision.fragments.edges import GreyImage

Reals = TypeVar("Reals", np.float32, NDArray[np.float32])

SNAP_PX = 4  # maximum distance that an end is moved: edges end somewhat before a corner
_WINDOW_PX = 3  # half window of the structure tensor: 7x7, less than the 11x11 of optical flow
_REACH_PX = SNAP_PX + _WINDOW_PX
_MARGIN_PX = _REACH_PX + 2  # one for the gradient, one for the padding of a row
_SIDE, _WINDOW, _ROWS = 2 * SNAP_PX + 1, 2 * _WINDOW_PX + 1, 2 * _REACH_PX + 1
_ROW = _ROWS + 1  # values stored per row: padded to 16, which the processor handles at a time
# Angular step of the Hough transform. A segment of 32 px turns by somewhat more than this when an end moves
# by one pixel, so a finer step gains nothing. Vertical, horizontal and diagonal lines are among the steps.
_ANGLE_RAD = math.pi / 120.0
_VOTES = 0.8  # minimum share of a segment's pixels on the line: the others may be missing, or beside it


def find_segments(edges: GreyImage, min_length_px: float, corner_px: tuple[int, int]) -> NDArray[np.float32]:
    """(N, 2, 2) segments in one part of an image, by the Hough transform and by contours.

    Short contours are used in neither. edges (H, W): of that part. corner_px (u, v): its upper left pixel in
    the image.
    """
    contours = find_contours(edges, min_length_px)
    found = np.concatenate((hough_segments(contours.edges, min_length_px), contours.ends_px))
    found += np.array(corner_px, np.float32)
    return found


def hough_segments(edges: GreyImage, min_length_px: float) -> NDArray[np.float32]:
    """(N, 2, 2) segments of at least min_length_px that the probabilistic Hough transform finds."""
    found = cv2.HoughLinesP(
        edges, 1.0, _ANGLE_RAD, int(_VOTES * min_length_px), minLineLength=min_length_px, maxLineGap=3
    )
    if found is None:
        return np.empty((0, 2, 2), np.float32)
    return np.asarray(found, dtype=np.float32).reshape(-1, 2, 2)


def snap_to_corners(
    grey: GreyImage, ends_px: NDArray[np.float32], reach_px: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The ends (N, 2, 2), each moved to the most corner-like pixel within reach_px <= SNAP_PX in u and v.

    Also returns the structure tensor there (N, 2, 3): uu, uv, vv of the grey level's gradient, summed over
    7x7 px. Most corner-like is the pixel with the largest smaller eigenvalue of this tensor (Shi and Tomasi).
    """
    if len(ends_px) > 0 and min(grey.shape) < 2 * _MARGIN_PX + 1:
        raise ValueError(f"no end has its surroundings in an image of {grey.shape[1]}x{grey.shape[0]} pixels")
    return _snapped(np.ascontiguousarray(grey), np.ascontiguousarray(ends_px), reach_px)


@inlined
def smaller_eigenvalue(uu: Reals, uv: Reals, vv: Reals) -> Reals:
    """The smaller eigenvalue of symmetric 2x2 matrices with these entries."""
    half = np.float32(0.5)
    half_difference = half * (uu - vv)
    smaller: Reals = half * (uu + vv) - np.sqrt(half_difference * half_difference + uv * uv)
    return smaller


@in_place
def _gradient_products(
    grey: GreyImage, u: int, v: int, uu: NDArray[np.int32], uv: NDArray[np.int32], vv: NDArray[np.int32]
) -> None:
    """Put products of twice the gradient, at the pixels within 7 px of u, v, into uu, uv, vv (15 * 16,)."""
    patch = grey[v - _REACH_PX - 1 : v + _REACH_PX + 2, u - _REACH_PX - 1 : u + _REACH_PX + 3]
    for i in range(_ROWS):
        for j in range(_ROW):
            du = np.int32(patch[i + 1, j + 2]) - np.int32(patch[i + 1, j])
            dv = np.int32(patch[i + 2, j + 1]) - np.int32(patch[i, j + 1])
            place = i * _ROW + j
            uu[place], uv[place], vv[place] = du * du, du * dv, dv * dv


@in_place
def _sums(values: NDArray[np.int32], over_rows: NDArray[np.int32], out: NDArray[np.float32]) -> None:
    """Put a quarter of the sums of values (15 * 16,) over 7x7 px into out (9 * 16,), at pixels within 4 px.

    Of the sixteen sums of a row the first nine are valid. over_rows (10 * 16,): work space. The sums are
    integers far below 2^24, so a quarter of them is exact in single precision.
    """
    for place in range(_SIDE * _ROW):
        total = 0
        for k in range(_WINDOW):
            total += values[place + k * _ROW]
        over_rows[place] = total
    for place in range(_SIDE * _ROW):
        total = 0
        for k in range(_WINDOW):
            total += over_rows[place + k]
        out[place] = np.float32(0.25) * np.float32(np.int32(total))


@in_place
def _most_corner_like(
    uu: NDArray[np.float32],
    uv: NDArray[np.float32],
    vv: NDArray[np.float32],
    held: NDArray[np.float32],
    reach_px: int,
) -> int:
    """Index of the largest smaller eigenvalue within reach_px of the middle, the first of equal ones.

    All arrays are (9 * 16,), of which the first nine values of a row are valid. held: work space.
    """
    for place in range(_SIDE * _ROW):
        held[place] = smaller_eigenvalue(uu[place], uv[place], vv[place])
    first, last = SNAP_PX - reach_px, SNAP_PX + reach_px
    best = first * _ROW + first
    for i in range(first, last + 1):
        for place in range(i * _ROW + first, i * _ROW + last + 1):
            if held[place] > held[best]:
                best = place
    return best


@compiled("uint8[:, ::1], float32[:, :, ::1], int64")
def _snapped(
    grey: GreyImage, ends_px: NDArray[np.float32], reach_px: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """As snap_to_corners."""
    height, width = grey.shape
    snapped, at_best = np.empty_like(ends_px), np.empty((len(ends_px), 2, 3), np.float32)
    products = np.empty((3, _ROWS * _ROW), np.int32)
    over_rows = np.zeros((_SIDE + 1) * _ROW, np.int32)
    tensor, held = np.empty((3, _SIDE * _ROW), np.float32), np.empty(_SIDE * _ROW, np.float32)
    for segment in range(len(ends_px)):
        for end in range(2):
            u = min(max(int(np.rint(ends_px[segment, end, 0])), _MARGIN_PX), width - 1 - _MARGIN_PX)
            v = min(max(int(np.rint(ends_px[segment, end, 1])), _MARGIN_PX), height - 1 - _MARGIN_PX)
            _gradient_products(grey, u, v, products[0], products[1], products[2])
            for k in range(3):
                _sums(products[k], over_rows, tensor[k])
            best = _most_corner_like(tensor[0], tensor[1], tensor[2], held, reach_px)
            snapped[segment, end, 0] = u - SNAP_PX + best % _ROW
            snapped[segment, end, 1] = v - SNAP_PX + best // _ROW
            for k in range(3):
                at_best[segment, end, k] = tensor[k, best]
    return snapped, at_best


@compiled("float32[:, :, ::1]")
def lengths_px(ends_px: NDArray[np.float32]) -> NDArray[np.float32]:
    """(N,) distance between the two ends: L_t of the paper."""
    length = np.empty(len(ends_px), np.float32)
    for n in range(len(ends_px)):
        du, dv = ends_px[n, 0, 0] - ends_px[n, 1, 0], ends_px[n, 0, 1] - ends_px[n, 1, 1]
        length[n] = np.sqrt(du * du + dv * dv)
    return length


@compiled("float32[:, :, ::1]")
def longest_first(segments_px: NDArray[np.float32]) -> NDArray[np.float32]:
    """Segments (N, 2, 2) sorted by length, longest first; the order of equally long ones stays."""
    return segments_px[np.argsort(-lengths_px(segments_px), kind="mergesort")]
