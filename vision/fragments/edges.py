"""Edges by the Canny detector (Daeef 2020, "Initialize featured fragments")."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

GreyImage = NDArray[np.uint8]

_LOW_SHARE = 0.4  # Canny's lower threshold, with which an edge is continued, as a share of the upper one


def find_edges(grey: GreyImage, contrast: float) -> GreyImage:
    """(H, W) uint8, 255 on edges. contrast: upper threshold of the gradient (3x3 Sobel, L1), grey levels."""
    return np.asarray(cv2.Canny(grey, _LOW_SHARE * contrast, contrast), dtype=np.uint8)
