"""Constant-velocity Kalman filters of T tracks at once, in the fixed frame (vision/bodies/tracks.py)."""

from __future__ import annotations

import math

import numpy as np

from hal.compiled import compiled, inlined
from hal.types import FloatArray, Integers

_VERTICAL_S = 0.1  # time constant of a vertical velocity: limbs have one, bodies do not
_UNKNOWNS = 6  # position, then velocity
_MEASURED = 3  # entries measured at once: either position or velocity
POSITION, VELOCITY = 0, 3  # index of the first entry of each in a state
_NOWHERE = np.zeros(3)
_UNKNOWN_MPS = 100.0  # standard deviation of a velocity in directions in which it is not measured


def predict(
    state: FloatArray,
    covariance: FloatArray,
    dt_s: float,
    accel_density: float,
    up: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """States (T, 6), position then velocity, and covariances (T, 6, 6), predicted dt_s ahead.

    accel_density: spectral density of a white acceleration, (m/s^2)^2 s. up (3,): the floor's normal, along
    which a velocity decays, since bodies stay on the floor; None where the floor is not known.
    """
    lost, along = (0.0, _NOWHERE) if up is None else (1.0 - math.exp(-dt_s / _VERTICAL_S), up)
    return _predicted(
        np.ascontiguousarray(state),
        np.ascontiguousarray(covariance),
        np.ascontiguousarray(along),
        lost,
        dt_s,
        accel_density,
    )


def update(
    state: FloatArray,
    covariance: FloatArray,
    index: Integers,
    measured: FloatArray,
    noise: FloatArray,
    first: int,
) -> tuple[FloatArray, FloatArray]:
    """States (T, 6) and covariances (T, 6, 6) after measurements of three entries of states index (K,).

    measured (K, 3), noise (K, 3, 3): the measurements and their covariance. first: POSITION or VELOCITY.
    """
    return _updated(
        state, covariance, index, np.ascontiguousarray(measured), np.ascontiguousarray(noise), first
    )


@compiled("float64[:, ::1], float64[:, :, ::1], int64[::1], float64[:, :], float64[:, :, :]")
def reset_position(
    state: FloatArray, covariance: FloatArray, index: Integers, position: FloatArray, noise: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """States (T, 6) and covariances (T, 6, 6) with positions (K, 3) of states index (K,), covariance noise.

    noise: (K, 3, 3). The velocity stays as it is, and its covariance with the position becomes 0. This is for
    a centre that jumps because the image border or a neighbour cuts the surface elsewhere.
    """
    new_state, new_covariance = state.copy(), covariance.copy()
    for k in range(len(index)):
        new_state[index[k], :3], spread = position[k], new_covariance[index[k]]
        spread[:3, :3] = noise[k]
        spread[:3, 3:] = 0.0
        spread[3:, :3] = 0.0
    return new_state, new_covariance


@compiled("float64[:, ::1], float64[::1]")
def along_only(direction: FloatArray, variance: FloatArray) -> FloatArray:
    """(K, 3, 3) covariance of velocities that are measured along one direction each, unit vectors (K, 3).

    variance (K,): along it, (m/s)^2.
    """
    result = np.empty((len(direction), 3, 3))
    for k in range(len(direction)):
        for i in range(3):
            for j in range(3):
                along = direction[k, i] * direction[k, j]
                result[k, i, j] = _UNKNOWN_MPS**2 * ((1.0 if i == j else 0.0) - along) + variance[k] * along
    return result


def forget_velocity(state: FloatArray, covariance: FloatArray, index: Integers, sigma_mps: float) -> None:
    """Set the velocities of tracks index (K,) to 0 with a standard deviation of sigma_mps per axis, in place.

    state (T, 6), covariance (T, 6, 6). The positions stay as they are.
    """
    state[index, 3:] = 0.0
    covariance[index, :3, 3:] = covariance[index, 3:, :3] = 0.0
    covariance[index, 3:, 3:] = sigma_mps**2 * np.eye(3)


@inlined
def _propagate(vector: FloatArray, up: FloatArray, lost: float, dt_s: float) -> None:
    """Move a vector (6,), position then velocity, dt_s ahead.

    lost: the share of its velocity along up (3,) that decays in this time.
    """
    along = lost * (up[0] * vector[3] + up[1] * vector[4] + up[2] * vector[5])
    for i in range(3):
        vector[i] += dt_s * vector[i + 3]
        vector[i + 3] -= along * up[i]


@compiled("float64[:, ::1], float64[:, :, ::1], float64[::1], float64, float64, float64")
def _predicted(
    state: FloatArray,
    covariance: FloatArray,
    up: FloatArray,
    lost: float,
    dt_s: float,
    accel_density: float,
) -> tuple[FloatArray, FloatArray]:
    """As predict. The linear map is applied to each column of a covariance, then to each row."""
    new_state, new_covariance = state.copy(), covariance.copy()
    for t in range(len(state)):
        _propagate(new_state[t], up, lost, dt_s)
        spread = new_covariance[t]
        for j in range(_UNKNOWNS):
            _propagate(spread[:, j], up, lost, dt_s)
        for i in range(_UNKNOWNS):
            _propagate(spread[i], up, lost, dt_s)
        for i in range(3):
            spread[i, i] += accel_density * dt_s**3 / 3.0
            spread[i, i + 3] += accel_density * dt_s**2 / 2.0
            spread[i + 3, i] += accel_density * dt_s**2 / 2.0
            spread[i + 3, i + 3] += accel_density * dt_s
    return new_state, new_covariance


@inlined
def _invert(matrix: FloatArray, result: FloatArray) -> None:
    """Put the inverse of a symmetric matrix (3, 3), by its cofactors, into result."""
    result[0, 0] = matrix[1, 1] * matrix[2, 2] - matrix[1, 2] * matrix[1, 2]
    result[0, 1] = matrix[0, 2] * matrix[1, 2] - matrix[0, 1] * matrix[2, 2]
    result[0, 2] = matrix[0, 1] * matrix[1, 2] - matrix[0, 2] * matrix[1, 1]
    result[1, 1] = matrix[0, 0] * matrix[2, 2] - matrix[0, 2] * matrix[0, 2]
    result[1, 2] = matrix[0, 1] * matrix[0, 2] - matrix[0, 0] * matrix[1, 2]
    result[2, 2] = matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[0, 1]
    determinant = matrix[0, 0] * result[0, 0] + matrix[0, 1] * result[0, 1] + matrix[0, 2] * result[0, 2]
    for i in range(3):
        for j in range(i, 3):
            result[i, j] /= determinant
            result[j, i] = result[i, j]


@inlined
def _add_propagated(change: FloatArray, covariance: FloatArray, result: FloatArray) -> None:
    """Add change C change^T to result (6, 6), for a covariance C (K, K) and change (6, K)."""
    for i in range(_UNKNOWNS):
        for j in range(len(covariance)):
            between = 0.0
            for k in range(len(covariance)):
                between += change[i, k] * covariance[k, j]
            for k in range(_UNKNOWNS):
                result[i, k] += between * change[k, j]


@compiled(
    "float64[:, ::1], float64[:, :, ::1], int64[::1], float64[:, ::1], float64[:, :, ::1], int64",
)
def _updated(
    state: FloatArray,
    covariance: FloatArray,
    index: Integers,
    measured: FloatArray,
    noise: FloatArray,
    first: int,
) -> tuple[FloatArray, FloatArray]:
    """As update."""
    new_state, new_covariance = state.copy(), covariance.copy()
    innovation_covariance, information = np.empty((_MEASURED, _MEASURED)), np.empty((_MEASURED, _MEASURED))
    gain, keep = np.empty((_UNKNOWNS, _MEASURED)), np.empty((_UNKNOWNS, _UNKNOWNS))
    for n in range(len(index)):
        t = index[n]
        for i in range(_MEASURED):
            for j in range(_MEASURED):
                innovation_covariance[i, j] = covariance[t, first + i, first + j] + noise[n, i, j]
        _invert(innovation_covariance, information)
        for i in range(_UNKNOWNS):
            for j in range(_UNKNOWNS):
                keep[i, j] = 1.0 if i == j else 0.0
            for j in range(_MEASURED):
                gain[i, j] = 0.0
                for m in range(_MEASURED):
                    gain[i, j] += covariance[t, i, first + m] * information[m, j]
                keep[i, first + j] -= gain[i, j]
                new_state[t, i] += gain[i, j] * (measured[n, j] - state[t, first + j])
        # Joseph form: stays symmetric and positive definite despite rounding.
        new_covariance[t] = 0.0
        _add_propagated(keep, covariance[t], new_covariance[t])
        _add_propagated(gain, noise[n], new_covariance[t])
    return new_state, new_covariance
