"""How far a chassis lags behind its commands, learnt from commands and odometry while driving.

    commanded - travelled = lag * v + drift * distance

commanded: distance commanded so far, in m; travelled: by odometry, in m; v: speed at which the chassis
follows (commanded speed less lag * commanded acceleration), in m/s; distance: again the commanded one, in m.
The part lag * v (lag in s) comes back when the robot stops. The part drift * distance (a wrong wheel radius,
slipping tracks) does not. Both lag and drift are estimated by recursive least squares, because closing in on
the target point needs the lag to a few hundredths of a second.
"""

from __future__ import annotations

from hal.compiled import compiled, inlined

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
        # Variance of the lag, covariance, and variance of the drift.
        self._spread = _LAG_SIGMA_S**2, 0.0, _DRIFT_SIGMA**2
        self._commanded_m = 0.0
        self._started_at_m: float | None = None

    @property
    def seconds(self) -> float:
        """The lag, kept within 0..0.6 s."""
        return min(max(self._lag_s, 0.0), _LONGEST_S)

    def to_command_m(self, to_end_m: float, v_mps: float, a_mps2: float) -> float:
        """What has still to be commanded so that the odometry says 0 at rest, for what it says now."""
        return _to_command_m(self._lag_s, self._drift_share, to_end_m, v_mps, a_mps2)

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
        outlier, self._lag_s, self._drift_share, self._spread = _learnt(
            self._lag_s, self._drift_share, self._spread, self._commanded_m, behind_m, v_mps, a_mps2
        )
        if outlier:
            self.restart()


@inlined
def _within(lag_s: float) -> float:
    return min(max(lag_s, 0.0), _LONGEST_S)


@inlined
def _following_mps(lag_s: float, v_mps: float, a_mps2: float) -> float:
    """How fast the chassis goes while it follows v, a."""
    return max(v_mps - _within(lag_s) * a_mps2, 0.0)


@compiled("float64, float64, float64, float64, float64")
def _to_command_m(lag_s: float, drift_share: float, to_end_m: float, v_mps: float, a_mps2: float) -> float:
    drift = min(max(drift_share, -_MOST_DRIFT), _MOST_DRIFT)
    return (to_end_m - _within(lag_s) * _following_mps(lag_s, v_mps, a_mps2)) / (1.0 - drift)


@compiled("float64, float64, UniTuple(float64, 3), float64, float64, float64, float64")
def _learnt(
    lag_s: float,
    drift_share: float,
    spread: tuple[float, float, float],
    way_m: float,
    behind_m: float,
    v_mps: float,
    a_mps2: float,
) -> tuple[bool, float, float, tuple[float, float, float]]:
    """Lag, drift and their spread after one step more, in which the chassis is behind_m behind after way_m;
    what they were, and True, for an outlier."""
    p_lag, p_both, p_drift = spread
    along = _following_mps(lag_s, v_mps, a_mps2)
    surprise_m = behind_m - along * lag_s - way_m * drift_share
    if abs(surprise_m) > _OUTLIER_M:
        return True, lag_s, drift_share, spread
    lag_gain = p_lag * along + p_both * way_m
    drift_gain = p_both * along + p_drift * way_m
    total = along * lag_gain + way_m * drift_gain + _NOISE_M**2
    lag_s += lag_gain / total * surprise_m
    drift_share += drift_gain / total * surprise_m
    p_lag -= lag_gain * lag_gain / total
    p_both -= lag_gain * drift_gain / total
    p_drift -= drift_gain * drift_gain / total
    return False, lag_s, drift_share, (p_lag, p_both, p_drift)
