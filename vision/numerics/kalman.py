"""Constant-velocity Kalman filters of T obstacles at once, in the fixed frame."""

from __future__ import annotations

import math

import numpy as np

from hal.types import FloatArray
from vision.numerics.symmetric import inverse

_VERTICAL_S = 0.1  # how long a vertical velocity lasts: limbs have one, bodies have not
_IDENTITY = np.eye(6)
# Position is moved by velocity; and where the blocks of a covariance stand.
_BY_VELOCITY = np.eye(6, k=3)
_OF_POSITION, _OF_VELOCITY = np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]), np.diag([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])
_OF_BOTH = _BY_VELOCITY + _BY_VELOCITY.T


def predict(
    state: FloatArray,
    covariance: FloatArray,
    dt_s: float,
    accel_density: float,
    up: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """States (T, 6), position then velocity, and covariances (T, 6, 6) dt_s later; accel_density:
    spectral density of a white acceleration, (m/s^2)^2 s.

    up (3,): what stands on the floor keeps no velocity along it; None where the floor is not known.
    """
    move = _IDENTITY + dt_s * _BY_VELOCITY
    if up is not None:
        move[3:, 3:] -= ((1.0 - math.exp(-dt_s / _VERTICAL_S)) * up[:, None]) * up
    spread = (accel_density * dt_s**3 / 3.0) * _OF_POSITION
    spread += (accel_density * dt_s**2 / 2.0) * _OF_BOTH
    spread += (accel_density * dt_s) * _OF_VELOCITY
    return state @ move.T, move @ covariance @ move.T + spread


def update(
    state: FloatArray,
    covariance: FloatArray,
    measured: FloatArray,
    noise: FloatArray,
    first: int,
) -> tuple[FloatArray, FloatArray]:
    """After measuring three entries from index first (0: position, 3: velocity): (T, 3) with (T, 3, 3)."""
    part = slice(first, first + 3)
    innovation = measured - state[:, part]
    gain = covariance[:, :, part] @ inverse(covariance[:, part, part] + noise)
    new_state = state + (gain @ innovation[:, :, None])[:, :, 0]
    keep = _IDENTITY - _pad(gain, first)
    # Joseph's form: stays symmetric and positive whatever the rounding.
    new_covariance = keep @ covariance @ keep.transpose(0, 2, 1) + gain @ noise @ gain.transpose(0, 2, 1)
    return new_state, new_covariance


def place(
    state: FloatArray, covariance: FloatArray, position: FloatArray, noise: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Put the states (T, 6) at position (T, 3), known to noise (T, 3, 3), and learn nothing of the velocity.

    For a centre that jumps because the surface was cut elsewhere, by the image's border or by a neighbour.
    """
    new_state, new_covariance = state.copy(), covariance.copy()
    new_state[:, :3] = position
    new_covariance[:, :3, :3] = noise
    new_covariance[:, :3, 3:] = new_covariance[:, 3:, :3] = 0.0
    return new_state, new_covariance


def _pad(gain: FloatArray, first: int) -> FloatArray:
    full = np.zeros((len(gain), 6, 6))
    full[:, :, first : first + 3] = gain
    return full
