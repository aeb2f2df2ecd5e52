"""What a RoboClaw has told: track speeds and pose from its encoders, status, voltage. Pure bookkeeping."""

from __future__ import annotations

import math

from config.chassis import RoboclawChassisConfig
from hal.chassis import roboclaw_packets as packets
from hal.chassis.roboclaw_packets import Status
from hal.chassis.tracks import DeadReckoning, TrackCounter, TrackGeometry
from hal.types import PlanarPose

_NS_PER_S = 1e9

# An encoder step larger than this times what the motors can do is a restart, not travel.
_JUMP_RATIO = 1.5
_JUMP_SLACK_M = 0.05

_STANDING_MPS = 0.005
_STANDING_RADPS = 0.01


class RoboclawFeedback:
    """The newest of everything the controller says.

    Speed is encoder steps over the time between two replies: the controller's own speeds come in
    steps of 300 counts/s (one count in its 1/300 s window).
    """

    def __init__(self, config: RoboclawChassisConfig, geometry: TrackGeometry) -> None:
        self._config = config
        self._geometry = geometry
        self._reckoning = DeadReckoning()
        self._counter = TrackCounter()
        self._status: Status | None = None
        self._timeout_ms: int | None = None
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
        """Why the controller must not be driven: its own time-out is not what was set."""
        if not self._wanted:
            return "nobody asked it to"
        if self._restarted:
            return "its encoders jumped: restarted"
        if self._timeout_ms is None:
            return "its time-out is not set"
        if self._timeout_ms != self._config.timeout_ms:
            return f"its time-out reads {self._timeout_ms} ms, not {self._config.timeout_ms} ms"
        return ""

    @property
    def silence(self) -> str:
        """What came instead of a status, and what to check."""
        if self.bytes_heard == 0:
            return (
                f"not one byte came; check port, power, baud, address 0x{self._config.address:X} and that "
                "packet serial is on"
            )
        return (
            f"{self.bytes_heard} bytes came, none a status with a right checksum; "
            f"check baud, address 0x{self._config.address:X} and that it is a RoboClaw"
        )

    @property
    def stop_cause(self) -> str:
        """Emergency stop or an error; "" for none."""
        if self._status is None:
            return ""
        if self._status.estop:
            return "emergency stop is active"
        return ", ".join(self._status.errors)

    @property
    def faults(self) -> tuple[str, ...]:
        """Errors and warnings."""
        return () if self._status is None else self._status.errors + self._status.warnings

    def await_setup(self) -> None:
        """Arming begins: what was set before is no longer trusted, it must be set and read back."""
        self._wanted = True
        self._timeout_ms = None
        self._restarted = False

    def forget_setup(self) -> None:
        """The controller is no longer asked to obey."""
        self._wanted = False

    def take(self, command: int, data: bytes, asked_ns: int, now_ns: int) -> None:
        """Take in the valid answer to a request that was written at asked_ns."""
        match command:
            case packets.ENCODERS:
                self._count(*packets.encoders(data), asked_ns, now_ns)
            case packets.STATUS:
                self._status, self.status_ns = packets.status(data), now_ns
            case packets.GET_TIMEOUT:
                self._timeout_ms = packets.timeout_ms(data)
            case packets.MAIN_BATTERY:
                self.battery_v = packets.main_battery_v(data)
            case packets.CURRENTS:
                self.currents_a = packets.currents_a(data)

    def _count(self, left: int, right: int, asked_ns: int, now_ns: int) -> None:
        config = self._config
        last_ns, self.pose_ns = self.pose_ns, asked_ns
        elapsed_s = 0.0 if last_ns is None else (asked_ns - last_ns) / _NS_PER_S
        limit = _JUMP_RATIO * config.max_qpps * elapsed_s + _JUMP_SLACK_M * config.counts_per_m
        steps = self._counter.increments(left, right, limit)
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
