"""Whether the base moves as commanded, judged by its odometry.

No fault bit tells that motors are held or run away, that encoders are dead, that reports are long old or that
a speed has the wrong scale. Then the robot would stand for ever, drive on while nobody knows how far, exceed
its speed limit, or set off although it is commanded to stand.

Following compares the reported poses with the commands in two ways. Over each distance commanded, the base
must report a minimum share of it and about the commanded turn. At all times, it must not report a speed or
yaw rate well above the commands of the last seconds. hal/chassis/driver.py steps it and latches its sentence.
"""

from __future__ import annotations

import math
import operator
from collections import deque
from typing import NamedTuple

from hal.chassis.command import is_zero
from hal.clocks import NS_PER_S
from hal.geometry import wrap_angle_rad
from hal.types import PlanarPose, Setpoint

# A turn counts as the distance that a point this far from the turning centre travels.
_ARM_M = 0.3

# Too little motion is judged each time that at least this distance was commanded in at least this time. By
# then a base that lags by 0.5 s has travelled a quarter of it from rest, and one that lags by 2 s a tenth.
_JUDGED_M = 0.3
_JUDGED_NS = NS_PER_S
_MIN_SHARE = 0.05  # of the commanded distance that must be reported

# Greatest difference between reported and commanded turn, plus this share of all turning in both directions:
# for lag, where one bend follows another, and for slip.
_TURN_SLACK_RAD = 0.6
_TURN_RATIO = 0.5

# Greatest speed that may be reported: this many times the fastest command of the last _LAG_NS, whatever the
# base's lag, plus a constant. For a yaw rate the constant is divided by _ARM_M.
_MAX_SHARE, _MAX_EXTRA_MPS = 1.5, 0.15
_LAG_NS = 6 * NS_PER_S
# The reported speed is averaged over windows of this length; two in a row must exceed the limit.
_WINDOW_NS = NS_PER_S // 2

# Least speed that may be reported: this share of the least command of the last windows, less a constant; two
# windows in a row must be below the limit. In that time a base that lags by 2 s reaches three quarters of a
# command. Counters with half the scale would take the robot twice as far as its path goes.
_MIN_SPEED_SHARE, _MIN_SPEED_LESS_MPS, _SLOW_WINDOWS = 0.6, 0.03, 6

# A base that lags by 2 s has slowed to a fiftieth when it has been commanded to stand for _REST_NS. From then
# on it may move no faster than a base that rolls back (rolling_back.py). Whoever pushes or turns it by hand,
# by more than 5 cm or 10 degrees in a second, latches it, too: a motor that runs away is reported the same.
_REST_NS = 8 * NS_PER_S
_RESTING_EXTRA_MPS = 0.05

_NOTHING_WRONG = (False, False, False)  # too fast, turns too fast, too slow: in one window


class _Ordered(NamedTuple):
    """The magnitudes of speed and yaw rate that were commanded until until_ns."""

    until_ns: int
    mps: float
    radps: float


class Following:
    """Compares each reported pose with the command before it.

    sentence: what is wrong; "" while the base follows, or as long as too little was commanded to judge.
    """

    def __init__(self) -> None:
        self.sentence = ""
        self._ordered: Setpoint | None = None
        self._pose: PlanarPose | None = None
        self._last_ns = self._since_ns = 0
        self._commanded_m = self._reported_m = 0.0
        self._commanded_rad = self._turning_rad = self._reported_rad = 0.0
        self._orders: deque[_Ordered] = deque()
        self._window_began_ns, self._window_m, self._window_rad = 0, 0.0, 0.0
        self._wrong_before = _NOTHING_WRONG
        self._min_command_mps = math.inf
        self._min_commands_mps: deque[float] = deque(maxlen=_SLOW_WINDOWS)

    def step(self, pose: PlanarPose, now_ns: int) -> None:
        """Compare what the base has reported since the last step with what was commanded meanwhile."""
        before, self._pose = self._pose, pose
        elapsed_s, self._last_ns = (now_ns - self._last_ns) / NS_PER_S, now_ns
        self._note_order(now_ns)
        if before is None or self._ordered is None:
            self.sentence = ""
            self._restart(now_ns)
            self._begin_window(now_ns)
            self._wrong_before = _NOTHING_WRONG
            self._min_commands_mps.clear()
            return
        way_m = _way_m(before, pose)
        turn_rad = wrap_angle_rad(pose.heading_rad - before.heading_rad)
        excess = self._out_of_limits(way_m, turn_rad, now_ns)
        if is_zero(self._ordered):
            self.sentence = excess
            self._restart(now_ns)
            return
        self._commanded_m += (abs(self._ordered.v_mps) + _ARM_M * abs(self._ordered.w_radps)) * elapsed_s
        self._commanded_rad += self._ordered.w_radps * elapsed_s
        self._turning_rad += abs(self._ordered.w_radps) * elapsed_s
        self._reported_rad += turn_rad
        self._reported_m += abs(way_m) + _ARM_M * abs(turn_rad)
        if self._commanded_m >= _JUDGED_M and now_ns - self._since_ns >= _JUDGED_NS:
            self.sentence = self._shortfall((now_ns - self._since_ns) / NS_PER_S)
            self._restart(now_ns)
        self.sentence = self.sentence or excess

    def ordered(self, command: Setpoint | None) -> None:
        """Take the command that holds from now on.

        Zero ends the check for too little motion, but not that for too much. None ends both: the base is not
        armed, so somebody may push it or drive it otherwise.
        """
        self._ordered = command

    def _note_order(self, now_ns: int) -> None:
        """Store what was commanded until now_ns.

        Equal commands share one entry, because a base may stand for days.
        """
        order = self._ordered
        mps, radps = (0.0, 0.0) if order is None else (abs(order.v_mps), abs(order.w_radps))
        self._min_command_mps = min(self._min_command_mps, mps)
        if self._orders and self._orders[-1][1:] == (mps, radps):
            self._orders.pop()
        self._orders.append(_Ordered(now_ns, mps, radps))
        while self._orders[0].until_ns < self._window_began_ns - _REST_NS:
            self._orders.popleft()

    def _out_of_limits(self, way_m: float, turn_rad: float, now_ns: int) -> str:
        """What is wrong if the base reports a speed or yaw rate beyond the limits; "" if it does not.

        way_m, turn_rad: reported since the last step.
        """
        # Signed sums, so that the jitter of a counter at rest adds up to nothing.
        self._window_m += way_m
        self._window_rad += turn_rad
        if now_ns - self._window_began_ns < _WINDOW_NS:
            return ""
        seconds = (now_ns - self._window_began_ns) / NS_PER_S
        reported_mps, reported_radps = abs(self._window_m) / seconds, abs(self._window_rad) / seconds
        resting = not any(one.mps or one.radps for one in self._orders)
        recent = [one for one in self._orders if one.until_ns >= self._window_began_ns - _LAG_NS]
        mps, radps = max(one.mps for one in recent), max(one.radps for one in recent)
        slack_mps = _RESTING_EXTRA_MPS if resting else _MAX_EXTRA_MPS
        self._min_commands_mps.append(self._min_command_mps)
        min_mps, full = min(self._min_commands_mps), len(self._min_commands_mps) == _SLOW_WINDOWS
        wrong = (
            reported_mps > _MAX_SHARE * mps + slack_mps,
            reported_radps > _MAX_SHARE * radps + slack_mps / _ARM_M,
            full and reported_mps < _MIN_SPEED_SHARE * min_mps - _MIN_SPEED_LESS_MPS,
        )
        too_fast, turns_too_fast, too_slow = map(operator.and_, self._wrong_before, wrong)
        self._wrong_before = wrong
        self._begin_window(now_ns)
        stood = mps == 0.0 and radps == 0.0
        if too_fast:
            return _excess_text(f"{reported_mps:.2f} m/s", f"{mps:.2f} m/s", stood)
        if turns_too_fast:
            return _excess_text(f"{reported_radps:.2f} rad/s", f"{radps:.2f} rad/s", stood)
        return _shortfall_text(reported_mps, min_mps) if too_slow else ""

    def _shortfall(self, seconds: float) -> str:
        """What is wrong if the base has moved too little or turned otherwise in these seconds, else ""."""
        apart_rad = abs(self._reported_rad - self._commanded_rad)
        if self._reported_m < _MIN_SHARE * self._commanded_m:
            told, commanded = f"{self._reported_m:.2f} m", f"{self._commanded_m:.2f} m"
        elif apart_rad > _TURN_SLACK_RAD + _TURN_RATIO * self._turning_rad:
            told, commanded = f"{self._reported_rad:.2f} rad", f"{self._commanded_rad:.2f} rad"
        else:
            return ""
        return (
            f"the base does not follow: it reports {told} in the {seconds:.1f} s in which {commanded} were "
            "commanded; are its tracks free and its encoders connected?"
        )

    def _begin_window(self, now_ns: int) -> None:
        self._window_began_ns, self._window_m, self._window_rad = now_ns, 0.0, 0.0
        self._min_command_mps = math.inf

    def _restart(self, now_ns: int) -> None:
        self._since_ns = now_ns
        self._commanded_m = self._reported_m = 0.0
        self._commanded_rad = self._turning_rad = self._reported_rad = 0.0


def _way_m(before: PlanarPose, after: PlanarPose) -> float:
    """Distance from one pose to the next; negative if it leads backwards."""
    x_m, y_m = after.x_m - before.x_m, after.y_m - before.y_m
    ahead_m = x_m * math.cos(before.heading_rad) + y_m * math.sin(before.heading_rad)
    return math.copysign(math.hypot(x_m, y_m), ahead_m)


def _excess_text(told: str, commanded: str, stood: bool) -> str:
    """The sentence on too much motion. stood: no motion at all was commanded."""
    ask = (
        "does it hold itself where it stands, and do its motors obey?"
        if stood
        else "are the scales of its speed and of its counters right in chassis:?"
    )
    return f"the base does not follow: it reports {told} while at most {commanded} was commanded; {ask}"


def _shortfall_text(reported_mps: float, min_mps: float) -> str:
    return (
        f"the base does not follow: it reports {reported_mps:.2f} m/s while at least {min_mps:.2f} m/s was "
        "commanded for 3 s; is the scale of its counters right in chassis:, and can its motors go that fast?"
    )
