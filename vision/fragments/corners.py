"""Pairs of corners on a body without enough straight edges, as fragments: two points suffice for a length."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from hal.types import DepthImage
from vision.fragments.edges import GreyImage

_MAX_CORNERS = 16
_MIN_DISTANCE_PX = 8.0
_QUALITY = 0.02  # relative to the best corner of the body; the absolute threshold is that of any end
_RIM_PX = 9  # size of the erosion


def corners(grey: GreyImage, depth: DepthImage, nearest: float, farthest: float) -> NDArray[np.float32]:
    """(N, 2) from top to bottom."""
    inner = cv2.erode(cv2.inRange(depth, nearest, farthest), np.ones((_RIM_PX, _RIM_PX), np.uint8), borderValue=0)
    found = cv2.goodFeaturesToTrack(grey, _MAX_CORNERS, _QUALITY, _MIN_DISTANCE_PX, mask=inner, blockSize=7)
    return np.empty((0, 2), np.float32) if found is None else found[:, 0]


def pairs(points: NDArray[np.float32]) -> NDArray[np.float32]:
    """(N, 2, 2) of points, neighbours in height."""
    points = points[np.argsort(points[:, 1], kind="stable")]
    count = len(points) // 2
    return np.ascontiguousarray(points[: 2 * count].reshape(count, 2, 2))
