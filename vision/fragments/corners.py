"""Pairs of corners on a body that has too few straight edges; each pair becomes a fragment.

A fragment measures by its two ends alone: by their flow, and by the length between them (Daeef 2020, eq. 4).
The straight edge between them only serves to find ends that belong together. A person far away, in plain
clothes or half hidden has hardly an edge of the minimum length, but corners: hands, collar, shoes, folds.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from hal.types import DepthImage
from vision.fragments.edges import GreyImage

Points = NDArray[np.float32]

_MAX_CORNERS = 16  # enough for the four fragments of one look, though half of the corners are not usable
_MIN_DISTANCE_PX = 8.0  # as between the two ends of a segment on a body (attention.py)
_QUALITY = 0.02  # of the best corner; the absolute minimum is that of any end (candidates.py)
_BLOCK_PX = 7  # as where ends are moved to corners (segments.py)
_INNER = np.ones((9, 9), np.uint8)  # distance from the outline at which nothing of the background is tracked
NO_CORNERS = np.empty((0, 2), np.float32)


def corners_within(grey: GreyImage, depth: DepthImage, nearest: float, farthest: float) -> Points:
    """(N, 2) corners of grey, the best first, in the inner part of what is between two raw depths."""
    between = cv2.inRange(depth, np.array(max(nearest, 1.0)), np.array(farthest))
    inner = cv2.erode(between, _INNER, borderType=cv2.BORDER_CONSTANT, borderValue=0)
    # OpenCV's type hints do not say that it returns None where there is no corner.
    found: NDArray[np.generic] | None = cv2.goodFeaturesToTrack(
        grey, _MAX_CORNERS, _QUALITY, _MIN_DISTANCE_PX, mask=inner, blockSize=_BLOCK_PX
    )
    return NO_CORNERS if found is None else np.asarray(found, np.float32).reshape(-1, 2)


def in_pairs(points: Points) -> Points:
    """Segments (N // 2, 2, 2) between points (N, 2) that are next to each other in height.

    Neighbours in height are mostly on the same limb, which matters for their length; the limbs of a person
    who stands upright are one below the other.
    """
    count = len(points) // 2
    from_top = points[np.argsort(points[:, 1], kind="stable")]
    return np.ascontiguousarray(from_top[: 2 * count].reshape(count, 2, 2))
