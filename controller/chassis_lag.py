"""How far a chassis lags behind its commands, learnt from commands and odometry while driving.

What was commanded minus what was travelled is lag * speed + drift * distance: the first part comes back when
the robot stops, the second (a wheel radius, slipping tracks) does not. Both are estimated by recursive least
squares, because the closing on the target point needs the first one to a few hundredths of a second.
"""

from __future__ import annotations

import numpy as np

_LAG_SIGMA_S = 0.1
_DRIFT_SIGMA = 0.03
# Errors of odometry are alike from step to step: this is far more than the noise of one reading.
_NOISE_M = 0.03
_OUTLIER_M = 0.25
_LONGEST_S = 0.6
_MOST_DRIFT = 0.1


class ChassisLag:
    """seconds: the estimate; prior_s: what is configured."""

    def __init__(self, prior_s: float) -> None:
        self._prior_s = prior_s
        self._state = np.array([prior_s, 0.0])
        self._covariance = np.diag([_LAG_SIGMA_S**2, _DRIFT_SIGMA**2])
        self._commanded_m = 0.0
        self._started_at_m: float | None = None

    @property
    def seconds(self) -> float:
        """The lag, kept within 0..0.6 s."""
        return float(min(max(self._state[0], 0.0), _LONGEST_S))

    def to_command_m(self, to_end_m: float, v_mps: float, a_mps2: float) -> float:
        """What has still to be commanded so that the odometry says 0 at rest, for what it says now."""
        return (to_end_m - self.seconds * self._following_mps(v_mps, a_mps2)) / (1.0 - self._drift)

    @property
    def _drift(self) -> float:
        return float(min(max(self._state[1], -_MOST_DRIFT), _MOST_DRIFT))

    def _following_mps(self, v_mps: float, a_mps2: float) -> float:
        """How fast the chassis goes while it follows v, a."""
        return max(v_mps - self.seconds * a_mps2, 0.0)

    def restart(self) -> None:
        """Begin to measure anew (another path, motion that was not commanded here); keep what was learnt."""
        self._commanded_m, self._started_at_m = 0.0, None

    def update(self, commanded_m: float, v_mps: float, a_mps2: float, to_end_m: float) -> None:
        """commanded_m: since the last update. v, a: commanded now. to_end_m: left, by odometry, now."""
        if self._started_at_m is None:
            self._started_at_m = to_end_m + self.seconds * v_mps
            return
        self._commanded_m += commanded_m
        behind_m = self._commanded_m - (self._started_at_m - to_end_m)
        regressor = np.array([self._following_mps(v_mps, a_mps2), self._commanded_m])
        surprise_m = behind_m - float(regressor @ self._state)
        if abs(surprise_m) > _OUTLIER_M:
            self.restart()
            return
        gain = self._covariance @ regressor
        gain /= float(regressor @ gain) + _NOISE_M**2
        self._state = self._state + gain * surprise_m
        self._covariance = self._covariance - np.outer(gain, regressor @ self._covariance)
