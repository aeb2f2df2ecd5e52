"""Measured velocities -> the motion that is extrapolated for seconds ahead: averaged as their spread demands.

The newest velocity of something far away is mostly noise, and whatever is foreseen from it would change with
every frame. So each axis has a filter of its own: it follows at once what is measured well and averages what
is not. What the newest measurement says beyond that, and that it goes on, is kept as surprise, for the worst
case.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from controller.decision.bodies import Bodies
from hal.clocks import NS_PER_S
from hal.types import FloatArray

# How people change their velocity: by so much in a second, growing with the root of time.
_CHANGES_MPS = 0.3
# Errors of velocities are alike for as long as perception measures them over.
_ALIKE_S = 0.25
# Who has begun to change its velocity is still at it: before anything is done about it, it has changed once
# more by what the average lags behind by. So little is taken for noise that who sets off is noticed at once.
_NOISE_SIGMAS, _GOES_ON = 0.5, 2.0


class SteadyVelocities:
    """One update a scene."""

    def __init__(self) -> None:
        self._ids = np.zeros(0, np.int64)
        self._velocity: FloatArray = np.zeros((0, 2))
        self._variance: FloatArray = np.zeros((0, 2))
        self._captured_ns = 0

    def update(self, seen: Bodies) -> Bodies:
        """The bodies with averaged velocities; the rest of what was measured is their surprise_mps."""
        dt_s = max((seen.captured_ns - self._captured_ns) / NS_PER_S, 1e-3)
        self._captured_ns = seen.captured_ns
        if not seen.moving.any():
            self._ids = self._ids[:0]
            return seen
        measured = seen.velocity_mps
        spread = np.diagonal(seen.covariance, axis1=1, axis2=2)
        velocity, variance = measured.copy(), spread.copy()
        now, before = np.nonzero((seen.ids[:, None] == self._ids) & seen.moving[:, None])
        if len(now):
            expected = self._variance[before] + _CHANGES_MPS**2 * dt_s
            gain = expected / (expected + spread[now] * max(_ALIKE_S / dt_s, 1.0))
            velocity[now] = self._velocity[before] + gain * (measured[now] - self._velocity[before])
            variance[now] = (1.0 - gain) * expected
        moving = seen.moving
        self._ids, self._velocity, self._variance = seen.ids[moving], velocity[moving], variance[moving]
        if not len(now):
            return seen
        differs = measured - velocity
        beyond_noise = np.maximum(np.abs(differs) - _NOISE_SIGMAS * np.sqrt(spread), 0.0)
        surprise = _GOES_ON * np.sign(differs) * beyond_noise
        return replace(seen, velocity_mps=velocity, surprise_mps=surprise)
