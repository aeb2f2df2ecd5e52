"""Edges by Canny's detector (Daeef 2020, "Initialize featured fragments")."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

GreyImage = NDArray[np.uint8]

_LOW_SHARE = 0.4  # of the contrast that makes an edge: with so much of it, one goes on


def find_edges(grey: GreyImage, contrast: float) -> GreyImage:
    """(H, W) uint8, 255 on edges. contrast: the gradient that makes one, grey levels (3x3 Sobel, L1 norm)."""
    return np.asarray(cv2.Canny(grey, _LOW_SHARE * contrast, contrast), dtype=np.uint8)
