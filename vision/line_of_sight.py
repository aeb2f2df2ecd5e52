"""Velocities along the line of sight and across it, in their own standard deviations.

The two are known very differently: across from the image, along from depth and from changes of length.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hal.types import FloatArray
from vision.symmetric import inverse

_FLOOR_SIGMA_MPS = 0.03
_IDENTITY = np.eye(3)
_FLOOR = _IDENTITY * _FLOOR_SIGMA_MPS**2


@dataclass(frozen=True, slots=True, eq=False)
class Split:
    """A velocity along the line of sight and across. value, variance (..., T): the component along it; rest
    (..., T, 3): what is left. along, across (..., T): squared distance from zero in sigmas, of either."""

    value: FloatArray
    variance: FloatArray
    rest: FloatArray
    along: FloatArray
    across: FloatArray

    def __getitem__(self, k: int) -> Split:
        """Of the first axis, entry k."""
        return Split(self.value[k], self.variance[k], self.rest[k], self.along[k], self.across[k])


def split(velocity: FloatArray, covariance: FloatArray, sight: FloatArray) -> Split:
    """Of velocity (..., T, 3) with covariance (..., T, 3, 3), seen along sight (T, 3)."""
    upright, level = sight[:, :, None], sight[:, None, :]
    value = (velocity * sight).sum(axis=-1)
    variance = (level @ covariance @ upright)[..., 0, 0]
    along = value * value / (variance + _FLOOR_SIGMA_MPS**2)
    onto_sight = upright * level
    onto = _IDENTITY - onto_sight
    rest = velocity - value[..., None] * sight
    doubt = onto @ covariance @ onto + (onto_sight + _FLOOR)
    across = _squared_length(rest, doubt)
    return Split(value, variance, rest, along, across)


def squared_sigmas(velocity: FloatArray, covariance: FloatArray) -> FloatArray:
    """(T,) squared distance of velocity (T, 3) from zero in its own standard deviations."""
    return _squared_length(velocity, covariance + _FLOOR)


def _squared_length(vector: FloatArray, covariance: FloatArray) -> FloatArray:
    """(...,) of vector (..., 3) in sigmas of covariance (..., 3, 3)."""
    result: FloatArray = (vector[..., None, :] @ inverse(covariance) @ vector[..., :, None])[..., 0, 0]
    return result
