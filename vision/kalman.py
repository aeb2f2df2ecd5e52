"""Constant-velocity Kalman filters of T obstacles at once, in the fixed frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray


def predict(
    state: FloatArray, covariance: FloatArray, dt_s: float, accel_density: float
) -> tuple[FloatArray, FloatArray]:
    """States (T, 6), position then velocity, and covariances (T, 6, 6) dt_s later; accel_density:
    spectral density of a white acceleration, (m/s^2)^2 s."""
    move = np.eye(6)
    move[:3, 3:] = np.eye(3) * dt_s
    spread = np.zeros((6, 6))
    density = accel_density
    spread[:3, :3] = np.eye(3) * (density * dt_s**3 / 3.0)
    spread[:3, 3:] = spread[3:, :3] = np.eye(3) * (density * dt_s**2 / 2.0)
    spread[3:, 3:] = np.eye(3) * (density * dt_s)
    return state @ move.T, move @ covariance @ move.T + spread


def update(
    state: FloatArray,
    covariance: FloatArray,
    measured: FloatArray,
    noise: FloatArray,
    first: int,
    coupled: NDArray[np.bool_] | None = None,
) -> tuple[FloatArray, FloatArray]:
    """After measuring three entries from index first (0: position, 3: velocity): (T, 3) with (T, 3, 3).

    coupled (T,): whether the other three may learn from it; a centre that moves because the image's
    border cuts the surface elsewhere says nothing about the velocity. Default: all.
    """
    part = slice(first, first + 3)
    innovation = measured - state[:, part]
    gain = covariance[:, :, part] @ np.linalg.inv(covariance[:, part, part] + noise)
    if coupled is not None:
        other = slice(3 - first, 6 - first)
        gain[:, other] *= coupled[:, None, None]
    new_state = state + (gain @ innovation[:, :, None])[:, :, 0]
    keep = np.eye(6) - _pad(gain, first)
    # Joseph's form: stays symmetric and positive whatever the rounding.
    new_covariance = keep @ covariance @ keep.transpose(0, 2, 1) + gain @ noise @ gain.transpose(0, 2, 1)
    return new_state, new_covariance


def _pad(gain: FloatArray, first: int) -> FloatArray:
    full = np.zeros((len(gain), 6, 6))
    full[:, :, first : first + 3] = gain
    return full
