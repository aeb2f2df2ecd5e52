"""What a Roboteq has reported: speeds and pose from its counters, flags, voltage."""

from __future__ import annotations

from config.chassis import RoboteqChassisConfig
from hal.chassis import roboteq_lines as lines
from hal.chassis.encoder_feedback import EncoderFeedback
from hal.chassis.roboteq_lines import MotorFlags
from hal.chassis.tracks import TrackGeometry

# Single refusals are noise on the line. This many in a row mean that the controller takes no commands.
_MAX_REFUSALS = 5

# A controller that echoes returns two lines between two answers: a command and a query. A single one may be
# noise.
_MIN_ECHOES = 2


class RoboteqFeedback(EncoderFeedback):
    """The newest value of everything the controller reports. Speed is the counter step divided by the time
    between two answers."""

    def __init__(self, config: RoboteqChassisConfig, geometry: TrackGeometry) -> None:
        signs = (config.left_sign, config.right_sign)
        super().__init__(geometry, config.counts_per_m, signs, config.full_speed_mps, checksum=False)
        self._config = config
        self._flags = 0
        self._flags_ns: int | None = None
        self._motors_ns: int | None = None
        self._motors = MotorFlags((), ())
        self._watchdog_ms: int | None = None
        self._refusals = 0
        self._echoes = 0
        self._echo_off = False
        self._echo_resumed = False

    @property
    def command_refusal(self) -> str:
        """Why the controller must not be driven: its watchdog is not what was set, it restarted, or it
        refuses commands; "" if it may be."""
        if not self._setup_requested:
            return "it was not asked to"
        if self._restarted:
            return "its counters jumped: restarted"
        if self._echo_resumed:
            return "it echoes again: restarted"
        if self._watchdog_ms is None:
            return "its watchdog is not set"
        if self._watchdog_ms != self._config.watchdog_ms:
            return f"its watchdog reads {self._watchdog_ms} ms, not {self._config.watchdog_ms} ms"
        if self._refusals >= _MAX_REFUSALS:
            return "it refuses commands"
        return ""

    @property
    def silence_hint(self) -> str:
        """What came instead of a status, and what to check."""
        if self.bytes_received == 0:
            return "not one byte came; check port, power, baud and the crossed lines"
        if self._flags_ns is not None:
            return "it answers ?FF, but not ?FM (motor flags) for two motors; is it a two-channel controller?"
        return (
            f"{self.bytes_received} bytes came, none an answer to ?FF; check baud and that it is a Roboteq "
            "whose serial input takes ASCII commands"
        )

    @property
    def estop(self) -> bool:
        """The controller's own emergency stop, which stays latched after the button is released, until
        !MG."""
        return bool(self._flags & lines.ESTOP_FLAG)

    @property
    def errors(self) -> tuple[str, ...]:
        """What stops the motors, except the emergency stop."""
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
        super().await_setup()
        self._watchdog_ms = None
        self._refusals = 0
        self._echo_off = False
        self._echo_resumed = False

    def note_echo(self) -> None:
        """A written line came back. ^ECHOF 1 switched the echo off; a restart switches it on again."""
        self._echoes += 1
        self._echo_resumed = self._echo_resumed or (self._echo_off and self._echoes >= _MIN_ECHOES)

    def note_reply(self, accepted: bool) -> None:
        """A command was accepted or refused."""
        self._refusals = 0 if accepted else self._refusals + 1

    def take(self, name: str, values: tuple[int, ...], requested_ns: int, now_ns: int) -> None:
        """Take in the answer to a query that was written at requested_ns."""
        # The first answer about the watchdog follows ^ECHOF 1. Only silence after that shows that the echo is
        # off.
        self._echo_off = self._echo_off or (self._watchdog_ms is not None and self._echoes == 0)
        self._echoes = 0
        match name:
            case lines.ENCODERS | lines.HALL_COUNTERS:
                self._take_counters(values[0], values[1], requested_ns, now_ns)
            case lines.FAULT_FLAGS:
                self._flags, self._flags_ns = values[0], now_ns
            case lines.MOTOR_FLAGS:
                self._motors, self._motors_ns = lines.describe_motors(values), now_ns
            case lines.WATCHDOG:
                self._watchdog_ms = values[0]
            case lines.VOLTAGES:
                self.battery_v = values[1] / 10.0
            case lines.CURRENTS:
                self.currents_a = (values[0] / 10.0, values[1] / 10.0)
        # Either may report a stop, so the status is as old as the older of the two.
        if self._flags_ns is not None and self._motors_ns is not None:
            self.status_ns = min(self._flags_ns, self._motors_ns)
