"""Measured velocities -> averaged velocities, which are extrapolated for seconds ahead.

The newest velocity of something far away is mostly noise, and a prediction made from it would change with
every frame. So a Kalman filter for each axis follows good measurements at once and averages poor ones. By how
much the newest measurement differs beyond noise, and may go on to differ, is kept as innovation_mps for the
worst case. controller/decision/known_bodies.py calls it once a scene.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from controller.decision.bodies import Bodies
from hal.clocks import NS_PER_S
from hal.compiled import compiled
from hal.types import FloatArray

# Process noise: people change their velocity by this standard deviation in one second, as a random walk (it
# grows with the square root of time).
_PROCESS_SIGMA_MPS = 0.3
# Perception measures each velocity over this time, so the errors of successive measurements are correlated.
_CORRELATED_S = 0.25
# Only this much of a difference is taken for noise, so that a body that sets off is noticed at once. The rest
# counts twice: the body is still changing its velocity, and before the robot reacts it will have changed once
# more by as much as the average lags behind.
_NOISE_SIGMAS, _SURPRISE_GAIN = 0.5, 2.0
# A body that was seen standing and sets off is measured late, and accelerates for about a second up to a
# walking speed. For that time innovation_mps is at least what is missing to that speed. Most people who ever
# walked into the robot's side had set off as they left the view, measured at a third of their later speed.
_SETTING_OFF_S, _WALKING_MPS = 1.0, 1.2
# A body that moves when it is first seen may have moved for long. So the track must be older than the motion
# by this.
_STOOD_S = 0.3
_LEAST_MPS = 1e-3  # lower bound of a divisor


class VelocityFilter:
    """The filters' state by body id; call update once a scene."""

    def __init__(self) -> None:
        self._ids = np.zeros(0, np.int64)
        self._moving_s = np.zeros(0)
        self._velocity: FloatArray = np.zeros((0, 2))
        self._variance: FloatArray = np.zeros((0, 2))
        self._captured_ns = 0

    def update(self, seen: Bodies) -> Bodies:
        """The bodies with averaged velocities, and with innovation_mps from the newest measurements."""
        dt_s = max((seen.captured_ns - self._captured_ns) / NS_PER_S, 1e-3)
        self._captured_ns = seen.captured_ns
        moving = seen.moving
        if not np.count_nonzero(moving):
            self._ids = self._ids[:0]
            return seen
        moving_s, velocity, variance, innovation = _averaged(
            seen, self._ids, self._moving_s, self._velocity, self._variance, dt_s
        )
        self._ids, self._moving_s, self._velocity, self._variance = seen.ids, moving_s, velocity, variance
        return replace(seen, velocity_mps=velocity, innovation_mps=innovation)


@compiled("float64[:, :]")
def missing_to_walking(velocity_mps: FloatArray) -> FloatArray:
    """(N, 2) how much faster bodies that set off with velocity_mps (N, 2) may become, straight on."""
    missing = np.zeros_like(velocity_mps)
    for k in range(len(velocity_mps)):
        speed_mps = max(math.hypot(velocity_mps[k, 0], velocity_mps[k, 1]), _LEAST_MPS)
        for axis in range(2):
            missing[k, axis] = velocity_mps[k, axis] * max(_WALKING_MPS / speed_mps - 1.0, 0.0)
    return missing


@compiled(Bodies, "int64[:], float64[:], float64[:, :], float64[:, :], float64")
def _averaged(
    seen: Bodies,
    before_ids: NDArray[np.int64],
    before_moving_s: FloatArray,
    before_mps: FloatArray,
    before_variance: FloatArray,
    dt_s: float,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """For how long N bodies have moved (N,); velocity, its variance, and the innovation, (N, 2) each.

    seen: with measured velocities. before_ids, before_moving_s (M,), before_mps and before_variance (M, 2):
    the bodies of the last scene. A body that did not move then starts with its measurement.
    """
    moving_s, velocity = np.zeros(len(seen.ids)), np.zeros(seen.velocity_mps.shape)
    variance, innovation = np.zeros(velocity.shape), np.zeros(velocity.shape)
    correlated = max(_CORRELATED_S / dt_s, 1.0)
    for k in range(len(seen.ids)):
        before = -1
        for m in range(len(before_ids)):
            if seen.moving[k] and before_moving_s[m] > 0.0 and seen.ids[k] == before_ids[m]:
                before = m
        if seen.moving[k]:
            moving_s[k] = dt_s if before < 0 else before_moving_s[before] + dt_s
        for axis in range(2):
            measured, spread = seen.velocity_mps[k, axis], seen.covariance[k, axis, axis]
            velocity[k, axis], variance[k, axis] = measured, spread
            if before < 0:
                continue
            expected = before_variance[before, axis] + _PROCESS_SIGMA_MPS**2 * dt_s
            gain = expected / (expected + spread * correlated)
            average = before_mps[before, axis] + gain * (measured - before_mps[before, axis])
            velocity[k, axis], variance[k, axis] = average, (1.0 - gain) * expected
            differs = measured - average
            beyond_noise = max(abs(differs) - _NOISE_SIGMAS * math.sqrt(spread), 0.0)
            innovation[k, axis] = _SURPRISE_GAIN * math.copysign(beyond_noise, differs)
        if 0.0 < moving_s[k] < min(_SETTING_OFF_S, seen.tracked_s[k] - _STOOD_S):
            missing_mps = missing_to_walking(velocity[k : k + 1])[0]
            for axis in range(2):
                if abs(missing_mps[axis]) > abs(innovation[k, axis]):
                    innovation[k, axis] = missing_mps[axis]
    return moving_s, velocity, variance, innovation
