"""Statistics of a run: limits of the setpoints that were really sent, durations of stages, camera, frames."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from config.robot import Limits
from hal.clocks import NS_PER_S
from hal.types import LATCHED_MODES, ChassisMode, Setpoint
from vision.scene import CameraCondition, CameraHealth

TOLERANCE = 1e-6
# Maximum number of durations that are kept: one hour at 50 a second.
MAX_SAMPLES = 180_000


@dataclass
class SetpointTally:
    """Checks every setpoint that was sent: speed, acceleration, jerk, direction.

    Acceleration and jerk are the differences of consecutive sent speeds and accelerations, divided by the
    number of control steps between them times the period. So they judge the commands themselves, not what the
    profile claims, nor how late a step began by the clock. Drivers do not send at every step. The emergency
    limits are the bounds for violations.

    emergency_count: setpoints beyond the comfort limits; hard_braking_count and high_jerk_count: by their
    braking, by their jerk. One may be both.
    """

    limits: Limits
    period_s: float
    count: int = 0
    max_speed_mps: float = 0.0
    max_accel_mps2: float = 0.0
    max_jerk_mps3: float = 0.0
    reversals: int = 0
    emergency_count: int = 0
    hard_braking_count: int = 0
    high_jerk_count: int = 0
    violations: int = 0
    _last: Setpoint | None = None
    _steps: int = 0

    def add(
        self, sent: Setpoint | None, mode: ChassisMode = ChassisMode.ARMED, *, standing: bool = False
    ) -> None:
        """Add what one control step sent, as the driver reports it. None, and repeats of the last, do not
        count.

        Nor does the zero of a latched driver, which is not part of a profile: the base stops by itself then.
        The same holds for the zero that is sent to a base that stands although it was told to go (standing).
        """
        self._steps += 1
        if (standing or mode in LATCHED_MODES) and (sent is None or sent.v_mps == 0.0):
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
        hard_braking = sent.a_mps2 < -self.limits.max_accel_mps2 - TOLERANCE
        high_jerk = abs(jerk_mps3) > self.limits.max_jerk_mps3 + TOLERANCE
        self.hard_braking_count += hard_braking
        self.high_jerk_count += high_jerk
        self.emergency_count += hard_braking or high_jerk
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
        """Add the fault of one control step; "" for none."""
        if fault:
            self.count += 1
            self.first = self.first or fault

    def line(self) -> str:
        """For the summary."""
        return f"braked by the stop profile in {self.count} steps; first: {self.first}"


@dataclass
class Complaints:
    """The faults that the base has reported, each once and in the order of their appearance."""

    reported: list[str] = field(default_factory=list)

    def add(self, faults: Sequence[str]) -> list[str]:
        """Add the faults of one exchange; return those that are new."""
        new = [fault for fault in faults if fault not in self.reported]
        self.reported += new
        return new

    def line(self) -> str:
        """For the summary."""
        return "; ".join(self.reported)


@dataclass
class Standstill:
    """Since when the robot has been commanded to stand; None while it drives or turns."""

    since_ns: int | None = None

    def add(self, setpoint: Setpoint) -> None:
        """Add the setpoint of one control step."""
        if setpoint.v_mps > 0.0 or setpoint.w_radps != 0.0:
            self.since_ns = None
        elif self.since_ns is None:
            self.since_ns = setpoint.stamp_ns

    def elapsed_s(self, now_ns: int) -> float:
        """How long the robot has been commanded to stand; 0 while it drives or turns."""
        return 0.0 if self.since_ns is None else (now_ns - self.since_ns) / NS_PER_S


@dataclass
class TimingTally:
    """Durations of named stages, in milliseconds: the last MAX_SAMPLES of each."""

    samples_ms: dict[str, deque[float]] = field(default_factory=dict)

    def add(self, timing_ms: dict[str, float]) -> None:
        """Add the durations of one frame."""
        for stage, duration_ms in timing_ms.items():
            self.samples_ms.setdefault(stage, deque(maxlen=MAX_SAMPLES)).append(duration_ms)

    def line(self) -> str:
        """Median and 99th percentile of the sum, and medians of the stages, as a line."""
        if not self.samples_ms:
            return "not measured"
        total_ms = np.sum([self.samples_ms[stage] for stage in self.samples_ms], axis=0)
        stages = ", ".join(f"{stage} {np.median(values):.1f}" for stage, values in self.samples_ms.items())
        median_ms, p99_ms = np.median(total_ms), np.percentile(total_ms, 99)
        return f"{median_ms:.1f} ms median, {p99_ms:.1f} ms p99 a frame ({stages})"


@dataclass
class ConditionTally:
    """How many frames the camera was in each condition, and why it was in a bad one."""

    conditions: Counter[CameraCondition] = field(default_factory=Counter)
    reasons: Counter[str] = field(default_factory=Counter)

    def add(self, health: CameraHealth) -> None:
        """Add one frame."""
        self.conditions[health.condition] += 1
        if health.reason:
            self.reasons[health.reason] += 1

    def line(self) -> str:
        """The counts, and the most frequent reason for a bad condition."""
        counts = ", ".join(f"{count} {condition.value}" for condition, count in self.conditions.items())
        return "; mostly: ".join([counts, *(reason for reason, _ in self.reasons.most_common(1))])


@dataclass
class ObstacleTally:
    """Which obstacles were seen, by id, and how near the nearest came ahead of the camera."""

    seen: set[int] = field(default_factory=set)
    moving: set[int] = field(default_factory=set)
    nearest_m: float = math.inf

    def add(self, track_id: int, moving: bool, ahead_m: float) -> None:
        """Add an obstacle of one frame. ahead_m: of the camera."""
        self.seen.add(track_id)
        if moving:
            self.moving.add(track_id)
        self.nearest_m = min(self.nearest_m, ahead_m)

    def line(self) -> str:
        """For the summary."""
        text = f"{len(self.seen)} tracked (ids), {len(self.moving)} of them moving"
        return text + (f"; nearest {self.nearest_m:.2f} m ahead" if math.isfinite(self.nearest_m) else "")


@dataclass
class FrameTally:
    """How many of the frames that the camera counted were processed."""

    processed: int = 0
    captured: int = 0
    _last: int | None = None

    def add(self, sequence: int) -> None:
        """Add a processed frame by the camera's number. If the number goes back, the camera has restarted."""
        self.processed += 1
        self.captured += sequence - self._last if self._last is not None and sequence > self._last else 1
        self._last = sequence

    def line(self) -> str:
        """A sentence for the summary; "" if no frame was left out."""
        if self.processed == self.captured:
            return ""
        return (
            f"{self.processed} of the camera's {self.captured} were processed: perception did not keep up "
            "(a video, a recording, a simulated camera or other programs take time), or the camera lost them"
        )


def mean_speed_mps(distance_m: float, duration_s: float) -> float:
    """The mean speed; NaN if no time has passed."""
    return distance_m / duration_s if duration_s > 0.0 else math.nan
