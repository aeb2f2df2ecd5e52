"""Whether the base responds to its commands, judged by its measured speed. If not, no command may get faster.

A base that receives nothing for a while is stopped by its own time-out. If the command went on rising
meanwhile, the base would jump to it as soon as it receives again. So it is commanded to zero, and the profile
begins anew from rest. That zero is a step of the command but no jolt: the base stands, or is about to. The
driver latches what lasts (hal/chassis/following.py, rolling_back.py); this file covers the time until then.
"""

from __future__ import annotations

import math
from collections import deque

from hal.clocks import NS_PER_MS, NS_PER_S
from hal.records import record

# Window beyond the base's lag in which it has to do part of the least speed that was commanded.
_RESPONSE_S = 0.4
# Minimum command that is judged: bases that have just begun to move report less.
_CLEAR_MPS = 0.1
# Shares of that command. From the first one on the base follows. A base that had followed and falls below the
# second no longer receives. One that never followed and stays below the third is not commanded any faster. A
# base with a lag of two seconds reaches 0.45 on its first ramp.
_FOLLOWS, _FELL, _CONTRADICTS = 0.6, 0.5, 0.4
# A base that has not followed yet is still commanded up to this: it may need that to overcome stiction.
_BREAKS_LOOSE_MPS = 0.2
# A dip: the base receives again before it has fallen that far. Its speed drops by this much within this time,
# although no lower speed was commanded.
_DIPS_MPS, _DIPS_NS = 0.1, 400 * NS_PER_MS
# Too fast: above the greatest command of the last _LAG_NS by this share and this constant, as in
# hal/chassis/following.py. The time covers any lag of a base.
_LAG_NS = 6 * NS_PER_S
_FASTEST_SHARE, _FASTEST_MPS = 1.5, 0.15
# Too fast as well: above the robot's top speed by this share and this constant.
_ABOVE_TOP_SHARE, _ABOVE_TOP_MPS = 1.1, 0.1
_BACKWARDS_MPS = -0.05
# Consecutive reports that have to agree.
_REPORTS = 2


@record(frozen=True, slots=True)
class SpeedCap:
    """What the base's response permits of the next command.

    cap_mps: greatest command; inf: the base responds.
    hard: slow down to cap_mps with the jerk of an emergency.
    zero_reason: why zero is commanded now and the profile begins anew; "" if it is not.
    ends: commanding zero does not help, and the drive has to end.
    dips: nothing can be learnt of the base's lag now.
    """

    cap_mps: float = math.inf
    hard: bool = False
    zero_reason: str = ""
    ends: bool = False
    dips: bool = False


# The base follows its commands.
NO_CAP = SpeedCap()


class ResponseMonitor:
    """Compares commanded and measured speed, once for each report of the base.

    lag_s: configured lag of the base. top_mps: the robot's greatest speed.
    """

    def __init__(self, lag_s: float, top_mps: float) -> None:
        self._window_ns = round((_RESPONSE_S + lag_s) * NS_PER_S)
        self._least = _Extreme(self._window_ns, sign=-1.0)
        self._most = _Extreme(_LAG_NS, sign=1.0)
        self._did = _Extreme(_DIPS_NS, sign=1.0)
        self._too_fast_mps = _ABOVE_TOP_SHARE * top_mps + _ABOVE_TOP_MPS
        self._report_ns: int | None = None
        self._since_ns: int | None = None
        self._fell = self._behind = self._dips = self._runs = self._back = 0
        self._followed = self._went_back = False
        self._cap = NO_CAP

    def restart(self) -> None:
        """Forget all reports: the base does not obey now, so what it does is no response."""
        self._forget()
        self._went_back = False

    def step(
        self, commanded_mps: float, measured_mps: float, feedback_ns: int | None, now_ns: int
    ) -> SpeedCap:
        """Compare commanded_mps, commanded until now_ns, with measured_mps, reported at feedback_ns."""
        if self._since_ns is None:
            self._since_ns = now_ns
        self._least.add(commanded_mps, now_ns)
        self._most.add(commanded_mps, now_ns)
        if feedback_ns is None or feedback_ns == self._report_ns or not math.isfinite(measured_mps):
            return self._cap
        self._report_ns = feedback_ns
        since_long = now_ns - self._since_ns >= self._window_ns
        least_mps = self._least.value if since_long else 0.0
        self._did.add(measured_mps, now_ns)
        self._count(commanded_mps, measured_mps, least_mps)
        self._cap = NO_CAP
        if self._back >= _REPORTS:
            return self._goes_back(measured_mps)
        if self._fell >= _REPORTS and self._followed:
            return self._begin_anew(
                f"the base fell to {measured_mps:.2f} m/s while at least {least_mps:.2f} m/s was commanded"
            )
        if self._runs >= _REPORTS:
            # Not lower than now: the driver sees a base that runs away best at this command, and latches it.
            self._cap = SpeedCap(commanded_mps, hard=True)
        elif self._behind >= _REPORTS:
            self._cap = SpeedCap(max(measured_mps, _BREAKS_LOOSE_MPS))
        elif self._dips >= _REPORTS and self._followed:
            self._cap = SpeedCap(commanded_mps, dips=True)
        return self._cap

    def _count(self, commanded_mps: float, measured_mps: float, least_mps: float) -> None:
        clear = least_mps >= _CLEAR_MPS
        runs = measured_mps > min(_FASTEST_SHARE * self._most.value + _FASTEST_MPS, self._too_fast_mps)
        # Compare with the command too: on a ramp the least command is far below it, and a base that reports
        # half of its speed would seem to follow.
        most_mps = max(least_mps, commanded_mps)
        self._followed = self._followed or (clear and measured_mps >= _FOLLOWS * most_mps)
        self._went_back = self._went_back and not self._followed
        self._fell = self._fell + 1 if clear and measured_mps < _FELL * least_mps else 0
        self._behind = self._behind + 1 if clear and measured_mps < _CONTRADICTS * least_mps else 0
        dips = clear and measured_mps < min(least_mps, self._did.value - _DIPS_MPS)
        self._dips = self._dips + 1 if dips else 0
        self._runs = self._runs + 1 if runs else 0
        self._back = self._back + 1 if measured_mps < _BACKWARDS_MPS and commanded_mps > 0.0 else 0

    def _goes_back(self, measured_mps: float) -> SpeedCap:
        """Begin anew the first time, since the base may have rolled back; end the drive the second time.

        A base that goes back again before it has followed would do so for ever, each time too briefly for
        rolling_back.py.
        """
        why = f"the base goes back at {-measured_mps:.2f} m/s while told to go ahead"
        again, self._went_back = self._went_back, True
        if not again:
            return self._begin_anew(why)
        self._forget()
        return SpeedCap(zero_reason=f"{why}, again; do its motors turn the right way?", ends=True)

    def _begin_anew(self, why: str) -> SpeedCap:
        self._forget()
        return SpeedCap(zero_reason=f"{why}; it was told zero, and begins again gently")

    def _forget(self) -> None:
        self._least.clear()
        self._since_ns = None
        self._fell = self._behind = self._dips = self._runs = self._back = 0
        self._followed = False
        self._cap = NO_CAP


class _Extreme:
    """The greatest value (sign 1) or the least (sign -1) of the last span_ns."""

    def __init__(self, span_ns: int, sign: float) -> None:
        self._span_ns, self._sign = span_ns, sign
        self._values: deque[tuple[int, float]] = deque()

    @property
    def value(self) -> float:
        return self._sign * self._values[0][1]

    def add(self, value: float, now_ns: int) -> None:
        signed, values = self._sign * value, self._values
        while values and values[-1][1] <= signed:
            values.pop()
        values.append((now_ns, signed))
        while values[0][0] < now_ns - self._span_ns:
            values.popleft()

    def clear(self) -> None:
        self._values.clear()
