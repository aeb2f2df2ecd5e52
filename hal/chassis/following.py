"""Does the base move as it is told? Its motors may be held, its encoders dead, its reports long old, the
scale of its speed wrong, and no fault bit says so: then the robot stands for ever, drives on with nobody
knowing how far, or goes faster than it may."""

from __future__ import annotations

import math
from collections import deque

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
# its lag, and a little more; not twice in a row is it faster, over so long each.
_FASTEST_SHARE, _FASTEST_MPS = 1.5, 0.15
_LAG_NS = 6 * NS_PER_S
_GLANCE_NS = NS_PER_S // 2


class Following:
    """sentence: "" while the base follows, and as long as too little was commanded to tell."""

    def __init__(self) -> None:
        self.sentence = ""
        self._ordered = Setpoint(0, 0.0, 0.0, 0.0)
        self._pose: PlanarPose | None = None
        self._last_ns = self._since_ns = 0
        self._commanded_m = self._told_m = 0.0
        self._commanded_rad = self._turning_rad = self._told_rad = 0.0
        self._lately: deque[tuple[int, float]] = deque()  # until when which speed was commanded
        self._glance_ns, self._glanced_m, self._too_fast = 0, 0.0, False

    def step(self, pose: PlanarPose, now_ns: int) -> None:
        """What the base has told since the last step, beside what it was ordered since."""
        before, self._pose = self._pose, pose
        elapsed_s, self._last_ns = (now_ns - self._last_ns) / NS_PER_S, now_ns
        self._note_speed(now_ns)
        if before is None or is_zero(self._ordered):
            self.sentence = ""
            self._restart(now_ns)
            self._glance_ns, self._glanced_m, self._too_fast = now_ns, 0.0, False
            return
        way_m = math.hypot(pose.x_m - before.x_m, pose.y_m - before.y_m)
        overspeed = self._overspeed(way_m, now_ns)
        if overspeed:
            self.sentence = overspeed
            return
        self._commanded_m += (abs(self._ordered.v_mps) + _ARM_M * abs(self._ordered.w_radps)) * elapsed_s
        self._commanded_rad += self._ordered.w_radps * elapsed_s
        self._turning_rad += abs(self._ordered.w_radps) * elapsed_s
        turn_rad = wrap_angle_rad(pose.heading_rad - before.heading_rad)
        self._told_rad += turn_rad
        self._told_m += way_m + _ARM_M * abs(turn_rad)
        if self._commanded_m < _JUDGED_M or now_ns - self._since_ns < _JUDGED_NS:
            return
        self.sentence = self._judged((now_ns - self._since_ns) / NS_PER_S)
        self._restart(now_ns)

    def ordered(self, command: Setpoint) -> None:
        """What the base is told from now on; zero ends the comparison."""
        self._ordered = command

    def _note_speed(self, now_ns: int) -> None:
        """What was commanded until now_ns. A change is enough: a base may stand for days."""
        speed_mps = abs(self._ordered.v_mps)
        if self._lately and self._lately[-1][1] == speed_mps:
            self._lately.pop()
        self._lately.append((now_ns, speed_mps))
        while self._lately[0][0] < self._glance_ns - _LAG_NS:
            self._lately.popleft()

    def _overspeed(self, way_m: float, now_ns: int) -> str:
        """What is wrong if the base, way_m on, tells of going faster than it was told of late."""
        self._glanced_m += way_m
        if now_ns - self._glance_ns < _GLANCE_NS:
            return ""
        told_mps = self._glanced_m * NS_PER_S / (now_ns - self._glance_ns)
        commanded_mps = max(mps for _, mps in self._lately)
        before, self._too_fast = self._too_fast, told_mps > _FASTEST_SHARE * commanded_mps + _FASTEST_MPS
        self._glance_ns, self._glanced_m = now_ns, 0.0
        if not (before and self._too_fast):
            return ""
        return (
            f"the base does not follow: it tells of {told_mps:.2f} m/s while at most {commanded_mps:.2f} m/s "
            "was commanded; are the scales of its speed and of its counters right in chassis:?"
        )

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

    def _restart(self, now_ns: int) -> None:
        self._since_ns = now_ns
        self._commanded_m = self._told_m = 0.0
        self._commanded_rad = self._turning_rad = self._told_rad = 0.0
