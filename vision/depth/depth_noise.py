"""Standard deviation of measured depth; used wherever depths are compared."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from config.perception import DepthNoise
from hal.compiled import inlined

Depths = TypeVar("Depths", NDArray[np.float32], NDArray[np.float64])


@inlined
def depth_sigma_of(depth_m: float, noise: DepthNoise) -> float:
    """One standard deviation of a depth, in metres (Khoshelham's model, sigma_z ~ z^2, with a floor)."""
    return noise.floor_m + noise.quadratic_per_m * depth_m * depth_m


def depth_sigma_m(depth_m: Depths, noise: DepthNoise) -> Depths:
    """The same for an array of depths of any shape; float32 stays float32."""
    sigma_m: Depths = noise.floor_m + noise.quadratic_per_m * depth_m * depth_m
    return sigma_m
