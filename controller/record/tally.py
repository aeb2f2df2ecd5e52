"""What a run adds up to: limits kept by the setpoints that were really sent, and how long stages took."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from config.robot import Limits
from hal.clocks import NS_PER_S
from hal.types import LATCHED_MODES, ChassisMode, Setpoint

TOLERANCE = 1e-6
# Of what is told of durations: an hour at 50 a second.
MOST_SAMPLES = 180_000


@dataclass
class SetpointTally:
    """Watches every setpoint that went out: speed, acceleration, jerk, direction.

    Acceleration and jerk are the differences of consecutive sent speeds and accelerations over the control
    steps between them, a period each, so they judge the commands themselves: neither what the profile claims
    nor how late the clock let a step begin. Drivers do not send at every step. The emergency limits are the
    outer bounds; how often braking went beyond comfort is counted on its own.
    """

    limits: Limits
    period_s: float
    count: int = 0
    max_speed_mps: float = 0.0
    max_accel_mps2: float = 0.0
    max_jerk_mps3: float = 0.0
    reversals: int = 0
    emergency_count: int = 0
    violations: int = 0
    _last: Setpoint | None = None
    _steps: int = 0

    def add(self, sent: Setpoint | None, mode: ChassisMode = ChassisMode.ARMED) -> None:
        """What one control step sent, as the driver reports it; None and repeats of the last are nothing.

        Nor is the zero of a driver that has latched: it stands for no profile, but for the base's own stop.
        """
        self._steps += 1
        if mode in LATCHED_MODES and (sent is None or sent.v_mps == 0.0):
            self._last, self._steps = sent or self._last, 0
            return
        if sent is None or (self._last is not None and sent.stamp_ns == self._last.stamp_ns):
            return
        self.count += 1
        self.max_speed_mps = max(self.max_speed_mps, sent.v_mps)
        self.reversals += sent.v_mps < -TOLERANCE
        accel_mps2, jerk_mps3 = self._differences(sent)
        self.max_accel_mps2 = max(self.max_accel_mps2, abs(accel_mps2))
        self.max_jerk_mps3 = max(self.max_jerk_mps3, abs(jerk_mps3))
        self.emergency_count += sent.a_mps2 < -self.limits.max_accel_mps2 - TOLERANCE
        limits = self.limits
        self.violations += (
            sent.v_mps > limits.max_speed_mps + TOLERANCE
            or sent.v_mps < -TOLERANCE
            or accel_mps2 > limits.max_accel_mps2 + TOLERANCE
            or accel_mps2 < -limits.emergency_decel_mps2 - TOLERANCE
            or abs(jerk_mps3) > limits.emergency_jerk_mps3 + TOLERANCE
        )
        self._last, self._steps = sent, 0

    def _differences(self, sent: Setpoint) -> tuple[float, float]:
        if self._last is None:
            return 0.0, 0.0
        dt_s = self._steps * self.period_s
        return (sent.v_mps - self._last.v_mps) / dt_s, (sent.a_mps2 - self._last.a_mps2) / dt_s


@dataclass
class ShaperFaults:
    """How often the shaper had to brake by the stop profile, and why it first did."""

    count: int = 0
    first: str = ""

    def add(self, fault: str) -> None:
        """Of one control step; "" is none."""
        if fault:
            self.count += 1
            self.first = self.first or fault

    def line(self) -> str:
        """For the summary."""
        return f"braked by the stop profile in {self.count} steps; first: {self.first}"


@dataclass
class Complaints:
    """What the base has complained of, each once and in the order in which it came."""

    told: list[str] = field(default_factory=list)

    def add(self, faults: Sequence[str]) -> list[str]:
        """Of one exchange; those that are new."""
        new = [fault for fault in faults if fault not in self.told]
        self.told += new
        return new

    def line(self) -> str:
        """For the summary."""
        return "; ".join(self.told)


@dataclass
class Standstill:
    """Since when the robot has been told to stand; None while it drives."""

    since_ns: int | None = None

    def add(self, setpoint: Setpoint) -> None:
        """What one control step asked for."""
        if setpoint.v_mps > 0.0:
            self.since_ns = None
        elif self.since_ns is None:
            self.since_ns = setpoint.stamp_ns

    def lasted_s(self, now_ns: int) -> float:
        """0 while it drives."""
        return 0.0 if self.since_ns is None else (now_ns - self.since_ns) / NS_PER_S


@dataclass
class TimingTally:
    """Durations of named stages, in milliseconds: the last MOST_SAMPLES of each."""

    samples_ms: dict[str, deque[float]] = field(default_factory=dict)

    def add(self, timing_ms: dict[str, float]) -> None:
        """One frame's durations."""
        for stage, duration_ms in timing_ms.items():
            self.samples_ms.setdefault(stage, deque(maxlen=MOST_SAMPLES)).append(duration_ms)

    def line(self) -> str:
        """Median and 99th percentile of the sum, medians of the stages."""
        if not self.samples_ms:
            return "not measured"
        total_ms = np.sum([self.samples_ms[stage] for stage in self.samples_ms], axis=0)
        stages = ", ".join(f"{stage} {np.median(values):.1f}" for stage, values in self.samples_ms.items())
        median_ms, p99_ms = np.median(total_ms), np.percentile(total_ms, 99)
        return f"{median_ms:.1f} ms median, {p99_ms:.1f} ms p99 a frame ({stages})"


@dataclass
class FrameTally:
    """How many of the frames that the camera counted were looked at."""

    looked_at: int = 0
    counted: int = 0
    _last: int | None = None

    def add(self, sequence: int) -> None:
        """The camera's number of a frame that was looked at. One that goes back: the camera began anew."""
        self.looked_at += 1
        self.counted += sequence - self._last if self._last is not None and sequence > self._last else 1
        self._last = sequence

    def line(self) -> str:
        """For the summary; "" if none was left out."""
        if self.looked_at == self.counted:
            return ""
        return (
            f"{self.looked_at} of the camera's {self.counted} were looked at: perception did not keep up "
            "(a video or a recording takes time from it), or the camera lost them"
        )


def mean_speed_mps(distance_m: float, duration_s: float) -> float:
    """NaN when no time has passed."""
    return distance_m / duration_s if duration_s > 0.0 else math.nan
