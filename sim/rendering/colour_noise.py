"""The noise of a small colour sensor: constant read noise, and shot noise that grows with the light."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from hal.types import ColourImage, Intrinsics

_READ_GREY = 1.0  # standard deviation in the dark, grey levels
_SHOT_GREY = 0.02  # variance per grey level of light
_MARGIN_PX = 96  # room to shift the noise field for every frame
_BLUR_PX = 0.45  # demosaicing spreads the noise of a pixel a little
_BAND_ROWS = 64  # rows processed at a time: their data stay in the processor's cache

# Fixed point: sigma and noise are kept in these fractions, so that the sum stays within 16 bits.
_SIGMA_STEPS = 16
_NOISE_STEPS = 32


class ColourSensor:
    """Adds noise to images. The same seed and frame number give the same bytes."""

    def __init__(self, intrinsics: Intrinsics, seed: int) -> None:
        self._seed = seed
        self._shape = (intrinsics.height, intrinsics.width)
        generator = np.random.default_rng((seed, 201))
        white = generator.standard_normal((self._shape[0] + _MARGIN_PX, self._shape[1] + _MARGIN_PX, 3))
        smooth = np.asarray(cv2.GaussianBlur(white.astype(np.float32), (0, 0), _BLUR_PX))
        unit = smooth / smooth.std()
        self._field: NDArray[np.int16] = np.rint(unit * _NOISE_STEPS).astype(np.int16)
        sigma = np.array([expected_sigma(grey) for grey in range(256)])
        self._sigma = np.rint(sigma * _SIGMA_STEPS).astype(np.uint8)
        self._value = np.empty((_BAND_ROWS, self._shape[1], 3), np.int16)

    def expose(self, clean: ColourImage, frame: int) -> ColourImage:
        """A new image (H, W, 3) uint8: clean, with this frame's noise."""
        generator = np.random.default_rng((self._seed, 202, frame))
        top, left = (int(shift) for shift in generator.integers(_MARGIN_PX, size=2))
        field = self._field[top : top + self._shape[0], left : left + self._shape[1]]
        noisy = np.empty_like(clean)
        for first in range(0, self._shape[0], _BAND_ROWS):
            rows = slice(first, first + _BAND_ROWS)
            light = clean[rows]
            value = self._value[: len(light)]
            np.multiply(cv2.LUT(light, self._sigma), field[rows], out=value)
            # Add half a step first, because shifting rounds down and the mean must not change.
            value += _SIGMA_STEPS * _NOISE_STEPS // 2
            value >>= (_SIGMA_STEPS * _NOISE_STEPS).bit_length() - 1
            value += light
            np.clip(value, 0, 255, out=value)
            np.copyto(noisy[rows], value, casting="unsafe")
        return noisy


def expected_sigma(grey: float) -> float:
    """Standard deviation in grey levels at a clean value of grey, before rounding to bytes."""
    return float(np.sqrt(_READ_GREY**2 + _SHOT_GREY * grey))
