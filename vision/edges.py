"""Edges by Canny's detector (Daeef 2020, "Initialize featured fragments")."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

GreyImage = NDArray[np.uint8]


def find_edges(grey: GreyImage, low: float, high: float) -> GreyImage:
    """(H, W) uint8, 255 on edges. low, high: gradient in grey levels (3x3 Sobel, L1 norm)."""
    return np.asarray(cv2.Canny(grey, low, high), dtype=np.uint8)
