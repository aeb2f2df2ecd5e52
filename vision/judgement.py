"""Moving or static, with hysteresis: a verdict needs consistent evidence over time, of two kinds.

Fragments: the body's velocity over ground differs from zero by many sigmas, and most of its fragments
agree with it. Arrivals: the body stands where free space was seen, and its surface has moved.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.perception import MotionSettings
from hal.types import FloatArray

_RISE_S = 0.10
_FALL_S = 0.30
_MAX_EVIDENCE = 1.5
_MIN_ENDS = 4
_MIN_AGREEMENT = 0.5
_SPEED_PER_METRE = 0.02
_FLOOR_SIGMA_MPS = 0.03
_ARRIVED_CELLS = 8
_ARRIVED_SHARE = 0.05
_MUCH_CELLS = 20
_MUCH_SHARE = 0.2


@dataclass(frozen=True, slots=True, eq=False)
class MotionEvidence:
    """Of T tracks: velocity (T, 3) and covariance (T, 3, 3) as filtered; the same of this frame's fragments
    alone (own_velocity, own_covariance) from ends (T,) points of which agreement (T,) agree; distance_m
    (T,); arrived (T,) and cells (T,) of their surface. trusted: the camera's motion is known."""

    velocity: FloatArray
    covariance: FloatArray
    own_velocity: FloatArray
    own_covariance: FloatArray
    ends: NDArray[np.intp]
    agreement: FloatArray
    distance_m: FloatArray
    arrived: NDArray[np.intp]
    cells: NDArray[np.intp]
    trusted: bool


@dataclass(frozen=True, slots=True, eq=False)
class Verdict:
    """evidence (T,), moving (T,) and confidence (T,) 0..1 after this frame."""

    evidence: FloatArray
    moving: NDArray[np.bool_]
    confidence: FloatArray


def judge(
    seen: MotionEvidence,
    evidence: FloatArray,
    moving: NDArray[np.bool_],
    dt_s: float,
    settings: MotionSettings,
) -> Verdict:
    """Raise or lower the evidence of each track, and decide."""
    significance = squared_sigmas(seen.velocity, seen.covariance)
    own = squared_sigmas(seen.own_velocity, seen.own_covariance)
    speed = np.sqrt(np.square(seen.velocity).sum(axis=1))
    least = settings.min_speed_mps + _SPEED_PER_METRE * seen.distance_m
    threshold = settings.sigmas**2
    by_fragments = (
        (significance > threshold)
        & (own > 0.5 * threshold)
        & (seen.ends >= _MIN_ENDS)
        & (seen.agreement >= _MIN_AGREEMENT)
    )
    has_arrived = (seen.arrived >= _ARRIVED_CELLS) & (seen.arrived >= _ARRIVED_SHARE * seen.cells)
    by_arrival = has_arrived & (significance > 0.5 * threshold)
    much = (seen.arrived >= _MUCH_CELLS) & (seen.arrived >= _MUCH_SHARE * seen.cells)
    rising = (((by_fragments | by_arrival) & (speed > least)) | much) & seen.trusted
    holding = moving & (speed > 0.6 * least) & ((significance > 4.0) | has_arrived)
    change = np.where(rising, dt_s / _RISE_S, np.where(holding, 0.0, -dt_s / _FALL_S))
    new_evidence = np.clip(evidence + change, 0.0, _MAX_EVIDENCE)
    new_moving = np.where(moving, new_evidence > 0.0, new_evidence >= 1.0)
    confidence = 1.0 - np.exp(-significance / 60.0)
    return Verdict(new_evidence, new_moving, confidence)


def squared_sigmas(velocity: FloatArray, covariance: FloatArray) -> FloatArray:
    """(T,) squared distance of velocity (T, 3) from zero in its own standard deviations."""
    doubt = covariance + np.eye(3) * _FLOOR_SIGMA_MPS**2
    result: FloatArray = (velocity[:, None, :] @ np.linalg.solve(doubt, velocity[:, :, None]))[:, 0, 0]
    return result
