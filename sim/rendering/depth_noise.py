"""Turns exact inverse depth into what a D435i-like stereo camera reports.

Stereo measures disparity, which is inverse depth times a constant. Constant noise of the disparity gives a
standard deviation of depth that grows with the square of the distance, as in real cameras.
"""

from __future__ import annotations

from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from config.camera import SimulatedCameraConfig
from hal.types import DepthImage, Intrinsics
from sim.rendering.raster import Float32Image

DEPTH_SCALE_M = 0.001  # depth in millimetres, as from a RealSense

# Standard deviation of inverse depth: sigma_z = z^2 * this.
SIGMA_PER_M: dict[str, float] = {"realsense": 0.0075, "paper": 0.0005, "none": 0.0}

ScalarT = TypeVar("ScalarT", bound=np.generic)

_BASELINE_M = 0.050  # between the two imagers of a D435i (its data sheet)
# Size of the noise blobs along u and v, as a broad and a fine part. Measured on a real RealSense (plane
# residuals at 0.8 to 1.4 m: the correlation falls to 0.9 after one pixel, 0.65 and 0.35 after five).
_BLOB_PX = (3.5, 2.8)
_FINE_PX = (0.6, 0.6)
_FINE_SHARE = 0.08  # of the variance
_HOLE_BLOB_PX = (2.5, 2.0)  # holes come in blobs, somewhat finer than those of the noise
_MARGIN_PX = 96  # the noise field is larger than the image by this much, so that it can be shifted
_TOLERATED_SHIFT_PX = 1.0  # smaller steps of disparity are slanted surfaces, not edges
BAND_ROWS = 96  # rows processed at a time: their data stay in the processor's cache


class DepthSensor:
    """Adds noise, holes, occlusion shadows and range limits. The same seed and frame number give the same
    bytes."""

    def __init__(self, config: SimulatedCameraConfig, intrinsics: Intrinsics, seed: int) -> None:
        self._config = config
        self._seed = seed
        self._sigma = SIGMA_PER_M[config.depth_noise]
        shape = (intrinsics.height, intrinsics.width)
        self._shape = shape
        self._disparity_px_m = intrinsics.fx * _BASELINE_M
        self._max_shift_px = min(self._disparity_px_m / config.depth_min_m, shape[1] - 1)
        generator = np.random.default_rng((seed, 101))
        padded = (shape[0] + _MARGIN_PX, shape[1] + _MARGIN_PX)
        # A frame adds two independent noise fields, one of which it shares with the next frame: the
        # correlation of consecutive frames is 1/2.
        broad, fine = _field(generator, padded, _BLOB_PX), _field(generator, padded, _FINE_PX)
        unit = np.sqrt(1.0 - _FINE_SHARE) * broad + np.sqrt(_FINE_SHARE) * fine
        self._noise = (unit * (self._sigma / np.sqrt(2.0))).astype(np.float32)
        self._holes = _hole_field(generator, padded, config.hole_ratio)
        self._columns = np.arange(shape[1], dtype=np.float32)[None, :]
        band = (BAND_ROWS, shape[1])
        self._noisy: Float32Image = np.empty(band, np.float32)
        self._right_column: Float32Image = np.empty(band, np.float32)
        self._windows = np.empty(band, np.float32), np.empty(band, np.float32)

    def measure(self, inverse_depth: Float32Image, frame: int) -> DepthImage:
        """The depth image (H, W) uint16 in millimetres, 0 where nothing was measured.

        inverse_depth (H, W) in 1/m, 0: nothing there. frame: running number of the exposure.
        """
        depth = np.empty(self._shape, np.uint16)
        config = self._config
        noises = [self._crop(self._noise, frame + k, 0) for k in (0, 1)] if self._sigma > 0.0 else []
        holes = self._crop(self._holes, frame, 1) if config.hole_ratio > 0.0 else None
        for first in range(0, self._shape[0], BAND_ROWS):
            rows = slice(first, first + BAND_ROWS)
            exact = inverse_depth[rows]
            noisy = self._noisy[: len(exact)]
            np.copyto(noisy, exact)
            for noise in noises:
                cv2.add(noisy, noise[rows], dst=noisy)
            lost = noisy < 1.0 / config.depth_max_m
            lost |= noisy > 1.0 / config.depth_min_m
            lost |= exact == 0.0
            if holes is not None:
                lost |= holes[rows]
            if config.depth_edges:
                lost |= self.shadows(exact)
            # Pixels without depth become infinitely far, and then zero by the division.
            noisy[lost] = np.inf
            np.divide(1.0 / DEPTH_SCALE_M, noisy, out=noisy)
            np.copyto(depth[rows], np.rint(noisy, out=noisy), casting="unsafe")
        return depth

    def shadows(self, inverse_depth: Float32Image) -> NDArray[np.bool_]:
        """The pixels (R, W) that the left infrared camera sees and the right one does not, for at most
        BAND_ROWS whole rows: the strip of background to the left of every nearer object, as wide as the
        difference of their disparities."""
        count = len(inverse_depth)
        right_column = np.multiply(
            inverse_depth, np.float32(self._disparity_px_m), out=self._right_column[:count]
        )
        np.subtract(self._columns, right_column, out=right_column)
        # Minimum over all pixels to the right, as far as a shadow can reach, with windows of doubling width.
        nearest, reach = right_column, 1
        wider, spare = (window[:count] for window in self._windows)
        while reach <= self._max_shift_px:
            cv2.min(nearest[:, :-reach], nearest[:, reach:], dst=wider[:, :-reach])
            wider[:, -reach:] = nearest[:, -reach:]
            nearest, wider, spare, reach = wider, spare, wider, 2 * reach
        return right_column > np.add(nearest, np.float32(_TOLERATED_SHIFT_PX), out=wider)

    def _crop(self, field: NDArray[ScalarT], frame: int, stream: int) -> NDArray[ScalarT]:
        """The part of a noise field at a shift that is drawn for this frame."""
        generator = np.random.default_rng((self._seed, 102 + stream, frame))
        top, left = (int(shift) for shift in generator.integers(_MARGIN_PX, size=2))
        return field[top : top + self._shape[0], left : left + self._shape[1]]


def _field(
    generator: np.random.Generator, shape: tuple[int, int], blob_px: tuple[float, float]
) -> Float32Image:
    """Gaussian noise of unit standard deviation, smooth over blob_px."""
    white = generator.standard_normal(shape).astype(np.float32)
    smooth = np.asarray(cv2.GaussianBlur(white, (0, 0), blob_px[0], sigmaY=blob_px[1]))
    return np.asarray(smooth / smooth.std(), dtype=np.float32)


def _hole_field(generator: np.random.Generator, shape: tuple[int, int], ratio: float) -> NDArray[np.bool_]:
    """A mask of random blobs that cover this ratio of the area."""
    field = _field(generator, shape, _HOLE_BLOB_PX)
    return np.asarray(field > np.quantile(field, 1.0 - ratio), dtype=np.bool_)
