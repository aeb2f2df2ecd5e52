"""Velocities split into components along and across the line of sight, in their own standard deviations.

The two are known with very different precision: across it from the image, along it from depth and from
changes of length. A pitching camera causes false vertical motion in the image, but no false level motion, so
the level component across is given separately. vision/bodies/proof.py uses the result.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hal.compiled import compiled, inlined
from hal.types import Flags, FloatArray, Matrices, Matrix

FLOOR_SIGMA_MPS = 0.03  # added sigma: error of the camera's own motion, which no filter models
_CONTRADICTION_SIGMAS = 2.5  # 99 % of equal velocities differ by less
CONFIRMING_SIGMAS = 2.5  # as clear as a contradiction has to be
_MIN_LEVEL = 1e-6  # lower bound of a length: in a vertical line of sight no direction is level
_FLOOR = FLOOR_SIGMA_MPS**2
_AXES = 3
_NOWHERE = np.zeros(3)


class Split(NamedTuple):
    """K velocities of each of T bodies, split along and across the line of sight.

    speed, sigma: of the whole velocity: its length, and the root of the sum of its variances, (K, T).
    value, variance: the component along it, (K, T).
    rest: the remainder, across it, (K, T, 3).
    along, across, total: squared Mahalanobis distance from zero of the component along, of the remainder, and
        of the whole velocity, (K, T).
    level: the same of the level component across, (K, T); equal to across where the floor is not known.
    """

    speed: Matrix
    sigma: Matrix
    value: Matrix
    variance: Matrix
    rest: Matrices
    along: Matrix
    across: Matrix
    total: Matrix
    level: Matrix


def decompose(
    velocity: FloatArray, covariance: FloatArray, sight: FloatArray, up: FloatArray | None
) -> Split:
    """Split velocity (K, T, 3) with covariance (K, T, 3, 3).

    sight (T, 3): unit vectors along the lines of sight. up (3,): the floor's normal, None if not known.
    """
    split = _split(velocity, covariance, sight, _NOWHERE if up is None else up)
    return split._replace(level=split.across) if up is None else split


@inlined
def _component(velocity: FloatArray, covariance: FloatArray, direction: FloatArray) -> tuple[float, float]:
    """The component of velocity (3,) in direction (3,), and its variance."""
    value, variance = 0.0, 0.0
    for i in range(_AXES):
        value += velocity[i] * direction[i]
        for j in range(_AXES):
            variance += direction[i] * covariance[i, j] * direction[j]
    return value, variance


@inlined
def _squared_sigmas(vector: FloatArray, covariance: FloatArray) -> float:
    """Squared Mahalanobis length of vector (3,) under covariance (3, 3), by cofactors."""
    c = covariance
    c00 = c[1, 1] * c[2, 2] - c[1, 2] * c[1, 2]
    c01 = c[0, 2] * c[1, 2] - c[0, 1] * c[2, 2]
    c02 = c[0, 1] * c[1, 2] - c[0, 2] * c[1, 1]
    c11 = c[0, 0] * c[2, 2] - c[0, 2] * c[0, 2]
    c12 = c[0, 1] * c[0, 2] - c[0, 0] * c[1, 2]
    c22 = c[0, 0] * c[1, 1] - c[0, 1] * c[0, 1]
    x, y, z = vector[0], vector[1], vector[2]
    squared = c00 * x * x + c11 * y * y + c22 * z * z + 2.0 * (c01 * x * y + c02 * x * z + c12 * y * z)
    result: float = squared / (c[0, 0] * c00 + c[0, 1] * c01 + c[0, 2] * c02)
    return result


@inlined
def _put_across(covariance: FloatArray, variance: float, sight: FloatArray, regularised: FloatArray) -> None:
    """Put the covariance across sight s (3,), (I - s s') C (I - s s'), into regularised (3, 3).

    variance: s' C s. Along s the entry is set to 1, so that regularised has an inverse.
    """
    for i in range(_AXES):
        for j in range(_AXES):
            mixed = 0.0
            for k in range(_AXES):
                mixed += sight[i] * sight[k] * covariance[k, j] + covariance[i, k] * sight[k] * sight[j]
            regularised[i, j] = covariance[i, j] - mixed + (variance + 1.0) * sight[i] * sight[j]


@inlined
def _put_level_direction(sight: FloatArray, up: FloatArray, level_direction: FloatArray) -> None:
    """Put the unit vector perpendicular to sight and up into level_direction (3,)."""
    level_direction[0] = sight[1] * up[2] - sight[2] * up[1]
    level_direction[1] = sight[2] * up[0] - sight[0] * up[2]
    level_direction[2] = sight[0] * up[1] - sight[1] * up[0]
    length = math.sqrt(
        level_direction[0] * level_direction[0]
        + level_direction[1] * level_direction[1]
        + level_direction[2] * level_direction[2]
    )
    for i in range(_AXES):
        level_direction[i] /= max(length, _MIN_LEVEL)


@compiled("float64[:, :, ::1], float64[:, :, :, ::1], float64[:, ::1], float64[::1]")
def _split(velocity: FloatArray, covariance: FloatArray, sight: FloatArray, up: FloatArray) -> Split:
    """As decompose, with the floor's normal up (3,)."""
    shape = velocity.shape[:2]
    split = Split(
        speed=np.empty(shape),
        sigma=np.empty(shape),
        value=np.empty(shape),
        variance=np.empty(shape),
        rest=np.empty(velocity.shape),
        along=np.empty(shape),
        across=np.empty(shape),
        total=np.empty(shape),
        level=np.empty(shape),
    )
    regularised, level_direction = np.empty((_AXES, _AXES)), np.empty(_AXES)
    for k in range(shape[0]):
        for t in range(shape[1]):
            own, spread, towards = velocity[k, t], covariance[k, t], sight[t]
            split.speed[k, t] = math.sqrt(own[0] * own[0] + own[1] * own[1] + own[2] * own[2])
            split.sigma[k, t] = math.sqrt(spread[0, 0] + spread[1, 1] + spread[2, 2])
            value, variance = _component(own, spread, towards)
            split.value[k, t], split.variance[k, t] = value, variance
            split.along[k, t] = value * value / (variance + _FLOOR)
            for i in range(_AXES):
                split.rest[k, t, i] = own[i] - value * towards[i]
            _put_across(spread, variance, towards, regularised)
            for i in range(_AXES):
                regularised[i, i] += _FLOOR
            split.across[k, t] = _squared_sigmas(split.rest[k, t], regularised)
            regularised[:] = spread
            for i in range(_AXES):
                regularised[i, i] += _FLOOR
            split.total[k, t] = _squared_sigmas(own, regularised)
            _put_level_direction(towards, up, level_direction)
            sideways, sideways_variance = _component(own, spread, level_direction)
            split.level[k, t] = sideways * sideways / (sideways_variance + _FLOOR)
    return split


class SecondOpinion(NamedTuple):
    """Whether the surface's velocity denies or confirms the fragments', along and across: (T,) each."""

    denies_along: Flags
    denies_across: Flags
    confirms_along: Flags
    confirms_across: Flags


@compiled(Split, "int64, int64, int64")
def second_opinion(parts: Split, fragments: int, surface: int, apart: int) -> SecondOpinion:
    """Compare two of the K velocities: fragments and surface. apart is their difference."""
    count = parts.value.shape[1]
    result = SecondOpinion(
        denies_along=np.empty(count, np.bool_),
        denies_across=np.empty(count, np.bool_),
        confirms_along=np.empty(count, np.bool_),
        confirms_across=np.empty(count, np.bool_),
    )
    denied, least = _CONTRADICTION_SIGMAS**2, CONFIRMING_SIGMAS**2
    for t in range(count):
        side = 0.0
        for i in range(_AXES):
            side += parts.rest[fragments, t, i] * parts.rest[surface, t, i]
        same_way = parts.value[surface, t] * parts.value[fragments, t] > 0.0
        denies_along = parts.value[apart, t] * parts.value[apart, t] > denied * parts.variance[apart, t]
        result.denies_along[t], result.denies_across[t] = denies_along, parts.across[apart, t] > denied
        result.confirms_along[t] = parts.along[surface, t] > least and same_way and not denies_along
        result.confirms_across[t] = parts.across[surface, t] > least and side > 0.0
    return result
