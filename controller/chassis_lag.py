"""How far a chassis lags behind its commands, learnt from commands and odometry while driving.

    commanded - travelled = lag * v + drift * distance

commanded: distance commanded so far, in m; travelled: by odometry, in m; v: speed at which the chassis
follows (commanded speed less lag * commanded acceleration), in m/s; distance: again the commanded one, in m.
The part lag * v (lag in s) comes back when the robot stops. The part drift * distance (a wrong wheel radius,
slipping tracks) does not. Both lag and drift are estimated by recursive least squares, because closing in on
the target point needs the lag to a few hundredths of a second.
"""

from __future__ import annotations

_LAG_SIGMA_S = 0.1
_DRIFT_SIGMA = 0.03
# Errors of odometry are alike from step to step: this is far more than the noise of one reading.
_NOISE_M = 0.03
_OUTLIER_M = 0.25
_LONGEST_S = 0.6
_MOST_DRIFT = 0.1


class ChassisLag:
    """prior_s: what is configured, and believed until more is known."""

    def __init__(self, prior_s: float) -> None:
        self._lag_s, self._drift_share = prior_s, 0.0
        # Variances and covariance of the two; plain floats, ten times as fast as arrays of two.
        self._p_lag, self._p_both, self._p_drift = _LAG_SIGMA_S**2, 0.0, _DRIFT_SIGMA**2
        self._commanded_m = 0.0
        self._started_at_m: float | None = None

    @property
    def seconds(self) -> float:
        """The lag, kept within 0..0.6 s."""
        return min(max(self._lag_s, 0.0), _LONGEST_S)

    def to_command_m(self, to_end_m: float, v_mps: float, a_mps2: float) -> float:
        """What has still to be commanded so that the odometry says 0 at rest, for what it says now."""
        return (to_end_m - self.seconds * self._following_mps(v_mps, a_mps2)) / (1.0 - self._drift)

    @property
    def _drift(self) -> float:
        return min(max(self._drift_share, -_MOST_DRIFT), _MOST_DRIFT)

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
        along, way = self._following_mps(v_mps, a_mps2), self._commanded_m
        surprise_m = behind_m - along * self._lag_s - way * self._drift_share
        if abs(surprise_m) > _OUTLIER_M:
            self.restart()
            return
        lag_gain = self._p_lag * along + self._p_both * way
        drift_gain = self._p_both * along + self._p_drift * way
        spread = along * lag_gain + way * drift_gain + _NOISE_M**2
        self._lag_s += lag_gain / spread * surprise_m
        self._drift_share += drift_gain / spread * surprise_m
        self._p_lag -= lag_gain * lag_gain / spread
        self._p_both -= lag_gain * drift_gain / spread
        self._p_drift -= drift_gain * drift_gain / spread
