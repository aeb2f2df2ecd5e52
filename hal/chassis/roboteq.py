"""Driver for a tracked base with one Roboteq controller, over a serial line (ASCII commands).

One motion command !M is sent every command period, followed by one query. The controller's watchdog has a
trap (manual V1.8 p. 286): after it has stopped the motors, any valid command makes them run again at the
speed from before. So the first command after any gap is !M 0 0.
"""

from __future__ import annotations

from itertools import cycle

from config.chassis import RoboteqChassisConfig
from hal.api import SerialLink
from hal.chassis import roboteq_lines as lines
from hal.chassis.arming import ArmingLimits
from hal.chassis.command import CommandLimits, due, fit_tracks, is_zero
from hal.chassis.driver import ChassisDriver
from hal.chassis.roboteq_feedback import RoboteqFeedback
from hal.chassis.roboteq_lines import Query, Reply
from hal.chassis.roboteq_port import RoboteqPort
from hal.chassis.tracks import TrackGeometry
from hal.clocks import NS_PER_MS, NS_PER_S
from hal.errors import LinkLost
from hal.types import ChassisMode, Setpoint

# Queries in between those of the counters, which take every second turn. ?FF and ?FM take every sixth each:
# the status is as old as the older of the two. The watchdog is queried regularly because a restart clears it.
_OTHER_QUERIES = (
    lines.FAULT_FLAGS,
    lines.MOTOR_FLAGS,
    lines.WATCHDOG,
    lines.FAULT_FLAGS,
    lines.MOTOR_FLAGS,
    lines.VOLTAGES,
    lines.FAULT_FLAGS,
    lines.MOTOR_FLAGS,
    lines.CURRENTS,
)

# A base that still moves after this time of zero commands does not follow them: !EX cuts the motors.
_STOP_TIMEOUT_NS = 3 * NS_PER_S


class RoboteqChassis(ChassisDriver):
    """hal.api.Chassis for Roboteq. Channel 1 drives the left track, channel 2 the right one."""

    def __init__(self, link: SerialLink, config: RoboteqChassisConfig) -> None:
        geometry = TrackGeometry(config.track_width_m, config.slip_factor)
        feedback = RoboteqFeedback(config, geometry)
        commands = CommandLimits(
            max_speed_mps=config.top_speed_mps,
            max_yaw_rate_radps=config.top_yaw_rate_radps(0.0),
            timeout_ns=config.command_timeout_ms * NS_PER_MS,
        )
        limits = ArmingLimits(
            feedback_timeout_ns=config.feedback_timeout_ms * NS_PER_MS,
            status_timeout_ns=config.status_timeout_ms * NS_PER_MS,
            arming_timeout_ns=config.arming_timeout_ms * NS_PER_MS,
            max_step_gap_ns=config.watchdog_ms * NS_PER_MS,
        )
        super().__init__(link, feedback, commands, limits, config.battery_low_v)
        self._port = RoboteqPort(link)
        self._config = config
        self._geometry = geometry
        self._feedback = feedback
        self._period_ns = config.command_period_ms * NS_PER_MS
        # Half of the watchdog's time: the delay of the line is unknown, and an extra zero costs nothing.
        self._gap_ns = config.watchdog_ms * NS_PER_MS // 2
        counters = lines.ENCODERS if config.encoder == "quadrature" else lines.HALL_COUNTERS
        self._queries = cycle([lines.QUERIES[name] for other in _OTHER_QUERIES for name in (counters, other)])
        self._setup = b""
        self._motion_sent_ns: int | None = None
        self._moving = False

    def _receive(self, now_ns: int) -> bool:
        received_before = self._port.bytes_received
        for line in self._port.poll(now_ns):
            if line is Reply.ECHO:
                self._feedback.note_echo()
            elif isinstance(line, Reply):
                self._feedback.note_reply(line is Reply.ACCEPTED)
            else:
                self._feedback.take(line.value.name, line.value.values, line.requested_ns, now_ns)
        self._feedback.bytes_received = self._port.bytes_received
        return self._port.bytes_received > received_before

    def _send(self, command: Setpoint, now_ns: int) -> Setpoint | None:
        stopping = self._moving and is_zero(command)
        # The setup ends with !MG. Sent after a lost link, it would end an emergency stop without consent.
        setup = self._setup if self._arming.mode is ChassisMode.ARMING else b""
        if not (stopping or setup or due(self._motion_sent_ns, self._period_ns, now_ns)):
            return None
        self._setup = b""
        motion, sent = self._motion(command)
        data = self._stop_after_gap(now_ns) + setup + motion
        if self._ignores_zero(now_ns):
            data += lines.EMERGENCY_STOP
        query = None
        if self._port.idle(now_ns):
            query = lines.QUERIES[lines.WATCHDOG] if setup else next(self._queries)
        self._write(data, query, now_ns)
        self._moving = not is_zero(command)
        return sent

    def _query(self, now_ns: int) -> None:
        # A query is no command: it does not make motors run again that the watchdog has stopped.
        if self._port.idle(now_ns):
            self._port.write(b"", next(self._queries), now_ns)

    def _send_stop(self, now_ns: int) -> None:
        self._feedback.forget_setup()
        self._setup = b""
        self._write(lines.STOP, None, now_ns)
        self._moving = False

    def _begin_arming(self) -> None:
        # !MG is sent here and nowhere else: only a person's consent may end the controller's own emergency
        # stop.
        self._feedback.await_setup()
        watchdog = lines.set_watchdog(self._config.watchdog_ms)
        self._setup = lines.STOP + lines.ECHO_OFF + watchdog + lines.RELEASE

    def _late_answer(self) -> str:
        return self._port.late_answer

    def _resettable(self) -> bool:
        # Only an emergency stop can be reset. A fault beside it must disappear by itself.
        return self._feedback.estop and not self._feedback.errors

    def _stop_after_gap(self, now_ns: int) -> bytes:
        last_ns = self._motion_sent_ns
        return b"" if last_ns is not None and 0 <= now_ns - last_ns < self._gap_ns else lines.STOP

    def _write(self, data: bytes, query: Query | None, now_ns: int) -> None:
        try:
            self._port.write(data, query, now_ns)
        except LinkLost:
            # It is unknown how much of it arrived, so the next command must be zero.
            self._motion_sent_ns = None
            raise
        self._motion_sent_ns = now_ns

    def _ignores_zero(self, now_ns: int) -> bool:
        """Whether the base still moves although it was latched, and commanded zero, long ago."""
        latched = self._arming.mode is ChassisMode.ESTOP
        return latched and now_ns - self._arming.since_ns > _STOP_TIMEOUT_NS and not self._feedback.standing

    def _motion(self, command: Setpoint) -> tuple[bytes, Setpoint]:
        """The line for this command, and the command as it fits the tracks."""
        config = self._config
        fitted, left_mps, right_mps = fit_tracks(command, self._geometry, config.full_speed_mps)
        scale = lines.FULL_SCALE / config.full_speed_mps
        return lines.motors(
            config.left_sign * left_mps * scale, config.right_sign * right_mps * scale
        ), fitted
