"""Removes lens distortion from colour and depth, with look-up tables that are made once."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from hal.types import ColourImage, DepthImage, Intrinsics

_NO_FRACTIONS = np.empty(0, np.uint16)


class Undistorter:
    """Maps distorted images to the pinhole camera with the same intrinsics (Brown's model, as in OpenCV)."""

    def __init__(self, intrinsics: Intrinsics, coefficients: Sequence[float]) -> None:
        """coefficients: k1, k2, p1, p2 and optionally k3."""
        k = intrinsics
        matrix = np.array([[k.fx, 0.0, k.cx], [0.0, k.fy, k.cy], [0.0, 0.0, 1.0]])
        map_u, map_v = cv2.initUndistortRectifyMap(
            matrix, np.asarray(coefficients, np.float64), np.eye(3), matrix, (k.width, k.height), cv2.CV_32FC1
        )
        # Fixed point: half the time of the float maps for colour, and the same pixels for depth.
        self._linear = cv2.convertMaps(map_u, map_v, cv2.CV_16SC2)
        self._nearest, _ = cv2.convertMaps(map_u, map_v, cv2.CV_16SC2, nninterpolation=True)

    def colour(self, image: ColourImage) -> ColourImage:
        """Undistort with linear interpolation. Pixels outside the sensor repeat its border: black ones would
        make a false edge."""
        straight = cv2.remap(image, *self._linear, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return straight.astype(np.uint8, copy=False)

    def depth(self, image: DepthImage) -> DepthImage:
        """Undistort with the nearest pixel, because the mean of two surfaces would be a point in empty space.
        Outside the sensor: no data."""
        straight = cv2.remap(
            image,
            self._nearest,
            _NO_FRACTIONS,
            cv2.INTER_NEAREST,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=0,
        )
        return straight.astype(np.uint16, copy=False)
