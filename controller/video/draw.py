"""Drawing that OpenCV lacks or does one by one: many strokes at once, dashed lines, translucent areas.

Points are (N, 2) pixels, x right and y down; whole numbers are pixel centres. Everything is anti-aliased.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from controller.video.style import Colour, Image

Points = NDArray[np.floating]
_FRACTION_BITS = 4
_HEAD_PX = 8.0  # of an arrow
# Far outside every picture, and far inside int32 with the fraction bits.
_CLIP_PX = 1e5


def fixed_point(points: Points) -> NDArray[np.int32]:
    """Sub-pixel coordinates as OpenCV takes them. Points must be finite."""
    clipped = np.clip(points, -_CLIP_PX, _CLIP_PX)
    return np.rint(clipped * (1 << _FRACTION_BITS)).astype(np.int32)


def lines(image: Image, polylines: Points, colour: Colour, thickness: int = 1, closed: bool = False) -> None:
    """Draw N lines through K points each, (N, K, 2). Lines with a point that is not finite are left out."""
    finite = np.isfinite(polylines).all(axis=(1, 2))
    stack = list(fixed_point(polylines[finite]))
    if stack:
        cv2.polylines(image, stack, closed, colour, thickness, cv2.LINE_AA, _FRACTION_BITS)


def line(image: Image, points: Points, colour: Colour, thickness: int = 1, closed: bool = False) -> None:
    """Draw one line through all points (K, 2)."""
    lines(image, points[np.newaxis], colour, thickness, closed)


def line_with_gaps(image: Image, points: Points, colour: Colour, thickness: int = 1) -> None:
    """Draw one line through points (K, 2), interrupted where a point is not finite."""
    known = np.isfinite(points).all(axis=1)
    runs = np.split(points, np.flatnonzero(np.diff(known)) + 1)
    stack = [fixed_point(run) for run in runs if len(run) > 1 and np.isfinite(run).all()]
    if stack:
        cv2.polylines(image, stack, False, colour, thickness, cv2.LINE_AA, _FRACTION_BITS)


def dashed(image: Image, points: Points, colour: Colour, thickness: int = 1, dash_px: float = 6.0) -> None:
    """Draw one dashed line through all points (K, 2), which must be finite."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    starts = np.arange(0.0, along[-1], 2.0 * dash_px)
    ends = np.minimum(starts + dash_px, along[-1])
    at = np.stack([starts, ends], axis=1)
    segments = np.stack([np.interp(at, along, points[:, 0]), np.interp(at, along, points[:, 1])], axis=2)
    lines(image, segments, colour, thickness)


def area(image: Image, polygon: Points, colour: Colour) -> None:
    """Draw a filled polygon (K, 2), which must be finite."""
    cv2.fillPoly(image, [fixed_point(polygon)], colour, cv2.LINE_AA, _FRACTION_BITS)


def disc(image: Image, centre: Points, radius_px: float, colour: Colour) -> None:
    """Draw a filled circle."""
    x, y = (int(value) for value in fixed_point(centre))
    radius = round(radius_px * (1 << _FRACTION_BITS))
    cv2.circle(image, (x, y), radius, colour, cv2.FILLED, cv2.LINE_AA, _FRACTION_BITS)


def tint(image: Image, polygon: Points, colour: Colour, opacity: float) -> None:
    """Draw a filled, translucent polygon (K, 2), which must be finite."""
    height, width = image.shape[:2]
    x0, y0 = np.clip(np.floor(polygon.min(axis=0)), 0, (width, height)).astype(int)
    x1, y1 = np.clip(np.ceil(polygon.max(axis=0)) + 1, 0, (width, height)).astype(int)
    if x0 >= x1 or y0 >= y1:
        return
    beneath = image[y0:y1, x0:x1]
    above = beneath.copy()
    area(above, polygon - (x0, y0), colour)
    cv2.addWeighted(above, opacity, beneath, 1.0 - opacity, 0.0, dst=beneath)


def box(corners: ArrayLike) -> NDArray[np.float64]:
    """Two opposite corners (x0, y0, x1, y1) as the four points around it."""
    x0, y0, x1, y1 = np.asarray(corners, np.float64).ravel()
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def arrow(image: Image, tail: Points, tip: Points, colour: Colour) -> None:
    """Draw an arrow from tail to tip with a filled head; nothing if they are less than a pixel apart."""
    along = tip - tail
    length_px = float(np.hypot(*along))
    if length_px < 1.0:
        return
    forward = along / length_px
    head_px = min(_HEAD_PX, length_px)
    neck = tip - forward * head_px
    side = np.array([-forward[1], forward[0]]) * head_px * 0.5
    line(image, np.stack([tail, neck]), colour, thickness=2)
    area(image, np.stack([tip, neck + side, neck - side]), colour)


def ellipse(image: Image, centre: Points, covariance: NDArray[np.float64], colour: Colour) -> None:
    """Draw the one-sigma ellipse of a (2, 2) covariance in square pixels, x right, y down."""
    variances, axes = np.linalg.eigh(covariance)
    angles = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    circle = np.stack([np.cos(angles), np.sin(angles)])
    outline = centre + (axes * np.sqrt(np.maximum(variances, 0.0)) @ circle).T
    line(image, outline, colour, 1, closed=True)
