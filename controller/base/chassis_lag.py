"""Lag of a chassis behind its commands, learnt from commands and odometry while driving.

    commanded - travelled = lag * v + drift * distance

commanded: distance commanded so far, in m; travelled: by odometry, in m; v: speed at which the chassis
follows (commanded speed less lag * commanded acceleration), in m/s; distance: again the commanded one, in m.
The part lag * v (lag in s) is made up when the robot stops. The part drift * distance (a wrong wheel radius,
slipping tracks) is not. Both lag and drift are estimated by recursive least squares, because the stop at the
target point needs the lag to a few hundredths of a second. controller/shape.py uses it.
"""

from __future__ import annotations

from collections import deque

from hal.compiled import compiled, inlined

# Standard deviations before anything is learnt.
_LAG_SIGMA_S = 0.1
_DRIFT_SIGMA = 0.03
# Errors of odometry are correlated from step to step, so this is far more than the noise of one reading.
_NOISE_M = 0.03
_OUTLIER_M = 0.25  # a larger residual starts the measurement anew
# The estimate is stored every _KEPT_EVERY steps, and the last _KEPT are kept: at 50 Hz the oldest is 1.5 to
# 2 s old. That is longer than any base goes on at its last command when it receives nothing.
_KEPT_EVERY, _KEPT = 25, 4
# After that, it may coast without a command for this many steps.
_COASTS = 50
# Greatest lag and drift that are used.
_LONGEST_S = 0.6
_MOST_DRIFT = 0.1


class ChassisLag:
    """Estimates lag and drift. prior_s: the configured lag, used until more is known."""

    def __init__(self, prior_s: float) -> None:
        self._lag_s, self._drift_share = prior_s, 0.0
        # Variance of the lag, covariance, and variance of the drift.
        self._spread = _LAG_SIGMA_S**2, 0.0, _DRIFT_SIGMA**2
        self._commanded_m = 0.0
        self._started_at_m: float | None = None
        self._kept = deque([self._known], maxlen=_KEPT)
        self._until_kept = _KEPT_EVERY
        self._skipped = 0

    @property
    def seconds(self) -> float:
        """The lag, kept within 0..0.6 s."""
        return min(max(self._lag_s, 0.0), _LONGEST_S)

    def to_command_m(self, to_end_m: float, v_mps: float, a_mps2: float) -> float:
        """Distance still to be commanded so that to_end_m, by odometry, is 0 when the robot is at rest."""
        return _to_command_m(self._lag_s, self._drift_share, to_end_m, v_mps, a_mps2)

    def restart(self) -> None:
        """Restart the measurement, after a new path or motion that was not commanded here; keep the lag."""
        self._commanded_m, self._started_at_m = 0.0, None

    def take_back(self) -> None:
        """Undo what was learnt in the last two seconds, and learn nothing in the next two.

        Call it when the chassis has not followed its commands.
        """
        self._lag_s, self._drift_share, self._spread = self._kept[0]
        self._kept = deque([self._known], maxlen=_KEPT)
        self._skipped = _COASTS
        self.restart()

    @property
    def _known(self) -> tuple[float, float, tuple[float, float, float]]:
        return self._lag_s, self._drift_share, self._spread

    def update(self, commanded_m: float, v_mps: float, a_mps2: float, to_end_m: float) -> None:
        """Learn from one step.

        commanded_m: distance commanded since the last update.
        v_mps, a_mps2: commanded now.
        to_end_m: distance to the end of the path now, by odometry.
        """
        if self._skipped > 0:
            self._skipped -= 1
            return
        if self._started_at_m is None:
            # Measured from where the robot will be once the chassis has followed what was commanded before.
            self._started_at_m = to_end_m - self.seconds * max(v_mps - self.seconds * a_mps2, 0.0)
            return
        self._until_kept -= 1
        if self._until_kept <= 0:
            self._kept.append(self._known)
            self._until_kept = _KEPT_EVERY
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
    """Speed of the chassis while it follows the commands v_mps, a_mps2."""
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
    """Whether this step is an outlier; lag, drift and their covariance after it (unchanged for an outlier).

    spread: variance of the lag, covariance, variance of the drift. way_m: distance commanded so far.
    behind_m: by how much the chassis is behind it.
    """
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
