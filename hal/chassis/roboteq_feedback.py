"""What a Roboteq has told: track speeds and pose from its counters, flags, voltage. Pure bookkeeping."""

from __future__ import annotations

import math

from config.chassis import RoboteqChassisConfig
from hal.chassis import roboteq_lines as lines
from hal.chassis.roboteq_lines import MotorFlags
from hal.chassis.tracks import DeadReckoning, TrackCounter, TrackGeometry
from hal.types import PlanarPose

_NS_PER_S = 1e9

# A counter step larger than this times what the motors can do is a restart or noise, not travel.
_JUMP_RATIO = 1.5
_JUMP_SLACK_M = 0.05

_STANDING_MPS = 0.005
_STANDING_RADPS = 0.01

# Single refusals are noise on the line; so many in a row are a controller that takes no commands.
_MOST_REFUSALS = 5


class RoboteqFeedback:
    """The newest of everything the controller says. Speed is counter steps over the time between answers."""

    def __init__(self, config: RoboteqChassisConfig, geometry: TrackGeometry) -> None:
        self._config = config
        self._geometry = geometry
        self._reckoning = DeadReckoning()
        self._counter = TrackCounter()
        self._flags = 0
        self._motors = MotorFlags((), ())
        self._watchdog_ms: int | None = None
        self._refusals = 0
        self._restarted = False
        self._wanted = False
        self.bytes_heard = 0
        self.pose_ns: int | None = None
        self.feedback_ns: int | None = None
        self.status_ns: int | None = None
        self.v_mps = math.nan
        self.w_radps = math.nan
        self.battery_v = math.nan
        self.currents_a = (math.nan, math.nan)

    @property
    def pose(self) -> PlanarPose:
        """Dead reckoning since the driver was made."""
        return self._reckoning.pose

    @property
    def standing(self) -> bool:
        """Measured speed is zero but for a count or two of jitter; False while unknown."""
        return abs(self.v_mps) <= _STANDING_MPS and abs(self.w_radps) <= _STANDING_RADPS

    @property
    def disobeys(self) -> str:
        """Why the controller must not be driven: its own watchdog is not what was set."""
        if not self._wanted:
            return "nobody asked it to"
        if self._restarted:
            return "its counters jumped: restarted"
        if self._watchdog_ms is None:
            return "its watchdog is not set"
        if self._watchdog_ms != self._config.watchdog_ms:
            return f"its watchdog reads {self._watchdog_ms} ms, not {self._config.watchdog_ms} ms"
        if self._refusals >= _MOST_REFUSALS:
            return "it refuses commands"
        return ""

    @property
    def silence(self) -> str:
        """What came instead of a status, and what to check."""
        if self.bytes_heard == 0:
            return "not one byte came; check port, power, baud and the crossed lines"
        return (
            f"{self.bytes_heard} bytes came, none an answer to ?FF; check baud and that it is a Roboteq "
            "whose serial input takes ASCII commands"
        )

    @property
    def estop(self) -> bool:
        """The controller's own latch: it stays after the button is out, until !MG."""
        return bool(self._flags & lines.ESTOP_FLAG)

    @property
    def errors(self) -> tuple[str, ...]:
        """What stops the motors, but for the emergency stop."""
        return lines.describe_faults(self._flags) + self._motors.faults

    @property
    def stop_cause(self) -> str:
        """Emergency stop or a fault; "" for none."""
        if self.errors:
            return ", ".join(self.errors)
        return "emergency stop is active; release the button, then arm" if self.estop else ""

    @property
    def faults(self) -> tuple[str, ...]:
        """Errors and warnings."""
        return self.errors + self._motors.warnings

    def await_setup(self) -> None:
        """Arming begins: what was set before is no longer trusted, it must be set and read back."""
        self._wanted = True
        self._watchdog_ms = None
        self._restarted = False
        self._refusals = 0

    def forget_setup(self) -> None:
        """The controller is no longer asked to obey."""
        self._wanted = False

    def note_reply(self, accepted: bool) -> None:
        """A command was accepted or refused."""
        self._refusals = 0 if accepted else self._refusals + 1

    def take(self, name: str, values: tuple[int, ...], asked_ns: int, now_ns: int) -> None:
        """Take in the answer to a query that was written at asked_ns."""
        match name:
            case lines.ENCODERS | lines.HALL_COUNTERS:
                self._count(values[0], values[1], asked_ns, now_ns)
            case lines.FAULT_FLAGS:
                self._flags, self.status_ns = values[0], now_ns
            case lines.MOTOR_FLAGS:
                self._motors = lines.describe_motors(values)
            case lines.WATCHDOG:
                self._watchdog_ms = values[0]
            case lines.VOLTAGES:
                self.battery_v = values[1] / 10.0
            case lines.CURRENTS:
                self.currents_a = (values[0] / 10.0, values[1] / 10.0)

    def _count(self, left: int, right: int, asked_ns: int, now_ns: int) -> None:
        config = self._config
        last_ns, self.pose_ns = self.pose_ns, asked_ns
        elapsed_s = 0.0 if last_ns is None else (asked_ns - last_ns) / _NS_PER_S
        limit_m = _JUMP_RATIO * config.full_speed_mps * elapsed_s + _JUMP_SLACK_M
        steps = self._counter.increments(left, right, limit_m * config.counts_per_m)
        if steps is None:
            self._restarted = True
            self.v_mps = self.w_radps = math.nan
            return
        if last_ns is None or elapsed_s <= 0.0:
            return
        distance_m, turn_rad = self._geometry.to_twist(
            config.left_sign * steps[0] / config.counts_per_m,
            config.right_sign * steps[1] / config.counts_per_m,
        )
        self._reckoning.advance(distance_m, turn_rad)
        self.v_mps, self.w_radps = distance_m / elapsed_s, turn_rad / elapsed_s
        self.feedback_ns = now_ns
