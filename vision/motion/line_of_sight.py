"""Velocities along the line of sight and across it, in their own standard deviations.

The two are known very differently: across from the image, along from depth and from changes of length.
A camera that pitches feigns what goes up and down in the image, but nothing that goes level across it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray
from vision.numerics.symmetric import inverse

_FLOOR_SIGMA_MPS = 0.03  # allowed for: an error of the camera's own motion, which no filter knows of
_CONTRADICTION_SIGMAS = 2.5  # 99 % of velocities that are the same differ by less
_CONFIRMING_SIGMAS = 2.5  # as clearly as what contradicts
_LEAST_LEVEL = 1e-6  # straight up or down nothing is level
_NEXT, _LAST = np.array([1, 2, 0]), np.array([2, 0, 1])  # of the axes, in turn
_IDENTITY = np.eye(3)
_FLOOR = _IDENTITY * _FLOOR_SIGMA_MPS**2


@dataclass(frozen=True, slots=True, eq=False)
class Split:
    """A velocity along the line of sight and across. value, variance (..., T): the component along it; rest
    (..., T, 3): what is left. along, across, total (..., T): squared distance from zero in sigmas, of either
    and of the whole; level (..., T): of what goes across and level, the same as across where the floor is not
    known."""

    value: FloatArray
    variance: FloatArray
    rest: FloatArray
    along: FloatArray
    across: FloatArray
    total: FloatArray
    level: FloatArray

    def __getitem__(self, k: int) -> Split:
        """Of the first axis, entry k."""
        return Split(
            value=self.value[k],
            variance=self.variance[k],
            rest=self.rest[k],
            along=self.along[k],
            across=self.across[k],
            total=self.total[k],
            level=self.level[k],
        )


def split(velocity: FloatArray, covariance: FloatArray, sight: FloatArray, up: FloatArray | None) -> Split:
    """Of velocity (..., T, 3) with covariance (..., T, 3, 3), seen along sight (T, 3). up (3,): the floor's
    normal, None where the floor is not known."""
    value, variance = _component(velocity, covariance, sight)
    along = value * value / (variance + _FLOOR_SIGMA_MPS**2)
    onto_sight = sight[:, :, None] * sight[:, None, :]
    onto = _IDENTITY - onto_sight
    rest = velocity - value[..., None] * sight
    # What goes across, and all of it: both at once.
    vector, doubt = np.empty((2, *rest.shape)), np.empty((2, *covariance.shape))
    vector[0], doubt[0] = rest, onto @ covariance @ onto + (onto_sight + _FLOOR)
    vector[1], doubt[1] = velocity, covariance + _FLOOR
    across, total = _squared_length(vector, doubt)
    if up is None:
        return Split(
            value=value, variance=variance, rest=rest, along=along, across=across, total=total, level=across
        )
    # Their cross product; that of NumPy takes ten times as long.
    aside = sight.take(_NEXT, axis=1) * up.take(_LAST) - sight.take(_LAST, axis=1) * up.take(_NEXT)
    aside /= np.maximum(np.sqrt(np.square(aside).sum(axis=1)), _LEAST_LEVEL)[:, None]
    sideways, sideways_variance = _component(velocity, covariance, aside)
    level = sideways * sideways / (sideways_variance + _FLOOR_SIGMA_MPS**2)
    return Split(
        value=value, variance=variance, rest=rest, along=along, across=across, total=total, level=level
    )


def _component(
    velocity: FloatArray, covariance: FloatArray, direction: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(..., T) of velocity (..., T, 3) in direction (T, 3), and its variance."""
    value: FloatArray = (velocity * direction).sum(axis=-1)
    variance: FloatArray = (direction[:, None, :] @ covariance @ direction[:, :, None])[..., 0, 0]
    return value, variance


def _squared_length(vector: FloatArray, covariance: FloatArray) -> FloatArray:
    """(...,) of vector (..., 3) in sigmas of covariance (..., 3, 3)."""
    result: FloatArray = (vector[..., None, :] @ inverse(covariance) @ vector[..., :, None])[..., 0, 0]
    return result


@dataclass(frozen=True, slots=True, eq=False)
class SecondOpinion:
    """What a body's surface says of its fragments' speed, along the line of sight and across: (T,)."""

    denies_along: NDArray[np.bool_]
    denies_across: NDArray[np.bool_]
    confirms_along: NDArray[np.bool_]
    confirms_across: NDArray[np.bool_]


def second_opinion(fragments: Split, surface: Split, apart: Split) -> SecondOpinion:
    """Of the velocities of T bodies by their fragments and by their surfaces; apart: their difference."""
    denied, least = _CONTRADICTION_SIGMAS**2, _CONFIRMING_SIGMAS**2
    denies_along = np.square(apart.value) > denied * apart.variance
    same_way = surface.value * fragments.value > 0
    same_side = (fragments.rest * surface.rest).sum(axis=1) > 0
    return SecondOpinion(
        denies_along,
        apart.across > denied,
        (surface.along > least) & same_way & ~denies_along,
        (surface.across > least) & same_side,
    )
