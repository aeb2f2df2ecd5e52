"""Does the base move as it is told? Its motors may be held or run away, its encoders dead, its reports long
old, the scale of its speed wrong, and no fault bit says so: then the robot stands for ever, drives on with
nobody knowing how far, goes faster than it may, or sets off though it is told to stand."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from hal.chassis.command import is_zero
from hal.clocks import NS_PER_S
from hal.geometry import wrap_angle_rad
from hal.types import PlanarPose, Setpoint

# What a turn counts beside a distance: travel this far from the turning centre.
_ARM_M = 0.3

# Judged when so much was commanded, and after so long at least: by then a base that lags by half a second has
# done a quarter of it from rest, and one that lags by two a tenth.
_JUDGED_M = 0.3
_JUDGED_NS = NS_PER_S
_LEAST_SHARE = 0.05

# How far a turn may be from the commanded one, and the share of all turning either way that may come on top:
# lag, where one bend follows another, and slip.
_TURN_SLACK_RAD = 0.6
_TURN_RATIO = 0.5

# How fast it may tell of going: this many times what was commanded at any time in the last seconds, whatever
# its lag, and a little more; not twice in a row is it faster, over so long each. A turn counts with its arm.
_FASTEST_SHARE, _FASTEST_MPS = 1.5, 0.15
_LAG_NS = 6 * NS_PER_S
_GLANCE_NS = NS_PER_S // 2

# How slow it may tell of going: this share of the least that was commanded in so many glances, by when a base
# that lags by two seconds makes three quarters of it; not twice in a row is it slower. Counters with half the
# scale take a robot twice as far as its path goes.
_SLOWEST_SHARE, _SLOWEST_MPS, _SLOW_GLANCES = 0.6, -0.03, 6

# Told to stand for so long, a base that lags by two seconds has slowed to a fiftieth, and may move no more
# than one that rolls back (rolling_back.py). Who pushes or turns it by hand, by more than 5 cm or 10 degrees
# in a second, latches it too: it tells the same when a motor runs away.
_REST_NS = 8 * NS_PER_S
_RESTING_MPS = 0.05


class _Ordered(NamedTuple):
    """How fast, m/s and rad/s without sign, was commanded until until_ns."""

    until_ns: int
    mps: float
    radps: float


class Following:
    """sentence: "" while the base follows, and as long as too little was commanded to tell."""

    def __init__(self) -> None:
        self.sentence = ""
        self._ordered: Setpoint | None = None
        self._pose: PlanarPose | None = None
        self._last_ns = self._since_ns = 0
        self._commanded_m = self._told_m = 0.0
        self._commanded_rad = self._turning_rad = self._told_rad = 0.0
        self._lately: deque[_Ordered] = deque()
        self._glance_ns, self._glanced_m, self._glanced_rad = 0, 0.0, 0.0
        self._too_fast = self._turns_too_fast = self._too_slow = False
        self._least_mps = math.inf
        self._leasts_mps: deque[float] = deque(maxlen=_SLOW_GLANCES)

    def step(self, pose: PlanarPose, now_ns: int) -> None:
        """What the base has told since the last step, beside what it was ordered since."""
        before, self._pose = self._pose, pose
        elapsed_s, self._last_ns = (now_ns - self._last_ns) / NS_PER_S, now_ns
        self._note_order(now_ns)
        if before is None or self._ordered is None:
            self.sentence = ""
            self._restart(now_ns)
            self._glance_anew(now_ns)
            self._too_fast = self._turns_too_fast = self._too_slow = False
            self._leasts_mps.clear()
            return
        way_m = _way_m(before, pose)
        turn_rad = wrap_angle_rad(pose.heading_rad - before.heading_rad)
        too_much = self._too_much(way_m, turn_rad, now_ns)
        if is_zero(self._ordered):
            self.sentence = too_much
            self._restart(now_ns)
            return
        self._commanded_m += (abs(self._ordered.v_mps) + _ARM_M * abs(self._ordered.w_radps)) * elapsed_s
        self._commanded_rad += self._ordered.w_radps * elapsed_s
        self._turning_rad += abs(self._ordered.w_radps) * elapsed_s
        self._told_rad += turn_rad
        self._told_m += abs(way_m) + _ARM_M * abs(turn_rad)
        if self._commanded_m >= _JUDGED_M and now_ns - self._since_ns >= _JUDGED_NS:
            self.sentence = self._judged((now_ns - self._since_ns) / NS_PER_S)
            self._restart(now_ns)
        self.sentence = self.sentence or too_much

    def ordered(self, command: Setpoint | None) -> None:
        """What the base is told from now on. Zero ends the comparison with how much was commanded, not that
        with how fast; None ends both: it is not armed, and may be pushed or driven by somebody else."""
        self._ordered = command

    def _note_order(self, now_ns: int) -> None:
        """What was commanded until now_ns. A change is enough: a base may stand for days."""
        order = self._ordered
        mps, radps = (0.0, 0.0) if order is None else (abs(order.v_mps), abs(order.w_radps))
        self._least_mps = min(self._least_mps, mps)
        if self._lately and self._lately[-1][1:] == (mps, radps):
            self._lately.pop()
        self._lately.append(_Ordered(now_ns, mps, radps))
        while self._lately[0].until_ns < self._glance_ns - _REST_NS:
            self._lately.popleft()

    def _too_much(self, way_m: float, turn_rad: float, now_ns: int) -> str:
        """What is wrong if the base, way_m on and turn_rad further, tells of going or turning faster than it
        was told of late, or of going much slower all the time."""
        # With their signs: the jitter of a counter at rest is no travel.
        self._glanced_m += way_m
        self._glanced_rad += turn_rad
        if now_ns - self._glance_ns < _GLANCE_NS:
            return ""
        seconds = (now_ns - self._glance_ns) / NS_PER_S
        told_mps, told_radps = abs(self._glanced_m) / seconds, abs(self._glanced_rad) / seconds
        resting = not any(one.mps or one.radps for one in self._lately)
        recent = [one for one in self._lately if one.until_ns >= self._glance_ns - _LAG_NS]
        mps, radps = max(one.mps for one in recent), max(one.radps for one in recent)
        slack_mps = _RESTING_MPS if resting else _FASTEST_MPS
        before, self._too_fast = self._too_fast, told_mps > _FASTEST_SHARE * mps + slack_mps
        too_fast = before and self._too_fast
        fastest_radps = _FASTEST_SHARE * radps + slack_mps / _ARM_M
        before, self._turns_too_fast = self._turns_too_fast, told_radps > fastest_radps
        turns_too_fast = before and self._turns_too_fast
        least_mps, too_slow = self._much_too_slow(told_mps)
        self._glance_anew(now_ns)
        stood = mps == 0.0 and radps == 0.0
        if too_fast:
            return _overdone(f"{told_mps:.2f} m/s", f"{mps:.2f} m/s", stood)
        if turns_too_fast:
            return _overdone(f"{told_radps:.2f} rad/s", f"{radps:.2f} rad/s", stood)
        return _underdone(told_mps, least_mps) if too_slow else ""

    def _much_too_slow(self, told_mps: float) -> tuple[float, bool]:
        """The least that was commanded in the last glances, and whether the base tells of much less."""
        self._leasts_mps.append(self._least_mps)
        least_mps = min(self._leasts_mps)
        slow = len(self._leasts_mps) == _SLOW_GLANCES and told_mps < _SLOWEST_SHARE * least_mps + _SLOWEST_MPS
        before, self._too_slow = self._too_slow, slow
        return least_mps, before and slow

    def _judged(self, seconds: float) -> str:
        apart_rad = abs(self._told_rad - self._commanded_rad)
        if self._told_m < _LEAST_SHARE * self._commanded_m:
            told, commanded = f"{self._told_m:.2f} m", f"{self._commanded_m:.2f} m"
        elif apart_rad > _TURN_SLACK_RAD + _TURN_RATIO * self._turning_rad:
            told, commanded = f"{self._told_rad:.2f} rad", f"{self._commanded_rad:.2f} rad"
        else:
            return ""
        return (
            f"the base does not follow: it tells of {told} in the {seconds:.1f} s in which {commanded} were "
            "commanded; are its tracks free and its encoders connected?"
        )

    def _glance_anew(self, now_ns: int) -> None:
        self._glance_ns, self._glanced_m, self._glanced_rad = now_ns, 0.0, 0.0
        self._least_mps = math.inf

    def _restart(self, now_ns: int) -> None:
        self._since_ns = now_ns
        self._commanded_m = self._told_m = 0.0
        self._commanded_rad = self._turning_rad = self._told_rad = 0.0


def _way_m(before: PlanarPose, after: PlanarPose) -> float:
    """From one pose to the next, negative backwards."""
    x_m, y_m = after.x_m - before.x_m, after.y_m - before.y_m
    ahead_m = x_m * math.cos(before.heading_rad) + y_m * math.sin(before.heading_rad)
    return math.copysign(math.hypot(x_m, y_m), ahead_m)


def _overdone(told: str, commanded: str, stood: bool) -> str:
    """stood: no motion was commanded at all."""
    ask = (
        "does it hold itself where it stands, and do its motors obey?"
        if stood
        else "are the scales of its speed and of its counters right in chassis:?"
    )
    return f"the base does not follow: it tells of {told} while at most {commanded} was commanded; {ask}"


def _underdone(told_mps: float, least_mps: float) -> str:
    return (
        f"the base does not follow: it tells of {told_mps:.2f} m/s while at least {least_mps:.2f} m/s was "
        "commanded for 3 s; is the scale of its counters right in chassis:, and can its motors go that fast?"
    )
