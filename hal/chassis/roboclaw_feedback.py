"""What a RoboClaw has reported: speeds and pose from its encoders, status, voltage."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from config.chassis import RoboclawChassisConfig
from hal.chassis import roboclaw_packets as packets
from hal.chassis.encoder_feedback import EncoderFeedback
from hal.chassis.roboclaw_packets import Status
from hal.chassis.tracks import TrackGeometry

_UNANSWERED: Mapping[int, str] = MappingProxyType(
    {
        packets.SET_TIMEOUT: "it does not acknowledge its time-out (command 14); is its firmware too old?",
        packets.GET_TIMEOUT: "it does not tell its time-out (command 15); is its firmware too old?",
    }
)


class RoboclawFeedback(EncoderFeedback):
    """The newest value of everything the controller reports.

    Speed is the encoder step divided by the time between two replies: the controller's own speeds have a
    resolution of 300 counts/s (one count in its 1/300 s window).
    """

    def __init__(self, config: RoboclawChassisConfig, geometry: TrackGeometry) -> None:
        signs = (config.left_sign, config.right_sign)
        super().__init__(geometry, config.counts_per_m, signs, config.top_speed_mps)
        self._config = config
        self._status: Status | None = None
        self._timeout_ms: int | None = None
        self._unanswered: int | None = None

    @property
    def command_refusal(self) -> str:
        """Why the controller must not be driven: its time-out is not what was set, or it restarted; "" if it
        may be."""
        if not self._setup_requested:
            return "it was not asked to"
        if self._restarted:
            return "its encoders jumped: restarted"
        if self._timeout_ms == self._config.timeout_ms:
            return ""
        if self._unanswered is not None:
            return _UNANSWERED[self._unanswered]
        if self._timeout_ms is None:
            return "its time-out is not set"
        return f"its time-out reads {self._timeout_ms} ms, not {self._config.timeout_ms} ms"

    @property
    def silence_hint(self) -> str:
        """What came instead of a status, and what to check."""
        if self.bytes_received == 0:
            return (
                f"not one byte came; check port, power, baud, address 0x{self._config.address:X} and that "
                "packet serial is on"
            )
        return (
            f"{self.bytes_received} bytes came, none a status with a right checksum; "
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
        super().await_setup()
        self._timeout_ms = None
        self._unanswered = None

    def note_setting(self, command: int, answered: bool) -> None:
        """The time-out was set or queried, with or without an answer."""
        if not answered:
            self._unanswered = command
        elif self._unanswered == command:
            self._unanswered = None

    def take(self, command: int, data: bytes, requested_ns: int, now_ns: int) -> None:
        """Take in the valid answer to a request that was written at requested_ns."""
        match command:
            case packets.ENCODERS:
                self._take_counters(*packets.encoders(data), requested_ns, now_ns)
            case packets.STATUS:
                self._status, self.status_ns = packets.status(data), now_ns
            case packets.GET_TIMEOUT:
                self._timeout_ms = packets.timeout_ms(data)
                if self._timeout_ms == self._config.timeout_ms:
                    self._unanswered = None
            case packets.MAIN_BATTERY:
                self.battery_v = packets.main_battery_v(data)
            case packets.CURRENTS:
                self.currents_a = packets.currents_a(data)
