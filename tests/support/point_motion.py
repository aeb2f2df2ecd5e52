"""What tests need to say of points that move before a camera."""

from __future__ import annotations

from hal.types import FloatArray


def static_miss(static_m: FloatArray, ray: FloatArray) -> FloatArray:
    """(N, 2) x' Z - X and y' Z - Y: how far, in metres at its depth, a point is from where it should be."""
    return ray * static_m[:, 2:3] - static_m[:, :2]
