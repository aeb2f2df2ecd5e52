"""Driver for a tracked base with one RoboClaw in packet serial mode, stepped by the control loop.

The controller answers one request at a time, so motion commands and queries alternate: with a 50 Hz loop, a
motion command is sent every 40 ms. A motion command whose answer is lost is not repeated: the next one is
newer, and is sent before any query. A query with a garbled answer is repeated once, at once, by the port, and
a setting without an answer again and again. Queries have no checksum, and they reset the
controller's own time-out: a controller that takes queries but no commands would keep its speed while it is
being queried.
"""

from __future__ import annotations

from collections import deque
from itertools import cycle

from config.chassis import RoboclawChassisConfig
from hal.api import SerialLink
from hal.chassis import roboclaw_packets as packets
from hal.chassis.arming import ArmingLimits
from hal.chassis.command import CommandLimits, fit_tracks, is_zero
from hal.chassis.driver import ChassisDriver
from hal.chassis.roboclaw_feedback import RoboclawFeedback
from hal.chassis.roboclaw_packets import Request
from hal.chassis.roboclaw_port import Answer, RoboclawPort
from hal.chassis.tracks import TrackGeometry
from hal.clocks import NS_PER_MS
from hal.types import ChassisMode, Setpoint

# The encoders take every second turn, the status (emergency stop) every fourth, the others share the rest.
# The time-out is queried regularly because a restart clears it.
_QUERIES = (
    packets.ENCODERS_REQUEST,
    packets.STATUS_REQUEST,
    packets.ENCODERS_REQUEST,
    packets.MAIN_BATTERY_REQUEST,
    packets.ENCODERS_REQUEST,
    packets.STATUS_REQUEST,
    packets.ENCODERS_REQUEST,
    packets.GET_TIMEOUT_REQUEST,
    packets.ENCODERS_REQUEST,
    packets.STATUS_REQUEST,
    packets.ENCODERS_REQUEST,
    packets.CURRENTS_REQUEST,
)

_SETTINGS = frozenset({packets.SET_TIMEOUT, packets.GET_TIMEOUT})

# Turns of zeros and queries before a setting without an answer is repeated: encoders and status must not grow
# old in the meantime.
_RETRY_TURNS = 4


class RoboclawChassis(ChassisDriver):
    """hal.api.Chassis for RoboClaw. Motor 1 drives the left track, motor 2 the right one."""

    def __init__(self, link: SerialLink, config: RoboclawChassisConfig) -> None:
        geometry = TrackGeometry(config.track_width_m, config.slip_factor)
        feedback = RoboclawFeedback(config, geometry)
        commands = CommandLimits(
            max_speed_mps=config.top_speed_mps,
            max_yaw_rate_radps=config.top_yaw_rate_radps(0.0),
            timeout_ns=config.command_timeout_ms * NS_PER_MS,
        )
        limits = ArmingLimits(
            feedback_timeout_ns=config.feedback_timeout_ms * NS_PER_MS,
            status_timeout_ns=config.status_timeout_ms * NS_PER_MS,
            arming_timeout_ns=config.arming_timeout_ms * NS_PER_MS,
            max_step_gap_ns=config.timeout_ms * NS_PER_MS,
        )
        super().__init__(link, feedback, commands, limits, config.battery_low_v)
        self._config = config
        self._geometry = geometry
        self._feedback = feedback
        self._port = RoboclawPort(link, config.address)
        self._setup: deque[Request] = deque()
        self._turns_before_setup = 0
        self._queries = cycle(_QUERIES)
        self._query_turn = False
        self._motion_acknowledged = True
        self._moving = False
        self._listening_since_ns: int | None = None

    def _receive(self, now_ns: int) -> bool:
        received_before = self._port.bytes_received
        answer = self._port.poll(now_ns)
        self._feedback.bytes_received = self._port.bytes_received
        if answer is not None:
            self._take(answer, now_ns)
        return self._port.bytes_received > received_before

    def _take(self, answer: Answer, now_ns: int) -> None:
        if answer.request.command == packets.RAMPED_SPEEDS:
            self._motion_acknowledged = answer.data is not None
        if answer.request.command in _SETTINGS:
            self._feedback.note_setting(answer.request.command, answer.data is not None)
        if answer.data is not None:
            self._feedback.take(answer.request.command, answer.data, answer.requested_ns, now_ns)
        elif answer.request.command in _SETTINGS and self._arming.mode is ChassisMode.ARMING:
            self._setup.appendleft(answer.request)
            self._turns_before_setup = _RETRY_TURNS

    def _send(self, command: Setpoint, now_ns: int) -> Setpoint | None:
        if not self._port.idle(now_ns):
            return None
        stopping = self._moving and is_zero(command)
        if self._arming.mode is not ChassisMode.ARMING:
            # Left over from an arming that a lost link or a fault ended; the consent ended with it.
            self._setup.clear()
        if self._setup and self._turns_before_setup == 0:
            self._port.start(self._setup.popleft(), now_ns)
            return None
        self._turns_before_setup = max(0, self._turns_before_setup - 1)
        self._query_turn = not self._query_turn and not stopping and self._motion_acknowledged
        if self._query_turn:
            self._port.start(next(self._queries), now_ns)
            return None
        return self._send_motion(command, now_ns)

    def _query(self, now_ns: int) -> None:
        # Not before the controller's time-out: queries would keep a base moving whose program has just died.
        if self._listening_since_ns is None:
            self._listening_since_ns = now_ns
        waited = now_ns - self._listening_since_ns > self._limits.max_step_gap_ns
        if waited and self._port.idle(now_ns):
            self._port.start(next(self._queries), now_ns)

    def _send_stop(self, now_ns: int) -> None:
        # The zero does not wait for an answer that is under way; the controller takes packets in order.
        self._port.abandon(now_ns)
        self._feedback.forget_setup()
        self._port.start(packets.speeds(0, 0), now_ns)
        self._port.abandon(now_ns)
        self._moving = False

    def _late_answer(self) -> str:
        return self._port.late_answer

    def _begin_arming(self) -> None:
        self._feedback.await_setup()
        self._turns_before_setup = 0
        self._setup = deque((packets.set_timeout(self._config.timeout_ms), packets.GET_TIMEOUT_REQUEST))

    def _send_motion(self, command: Setpoint, now_ns: int) -> Setpoint:
        config = self._config
        fitted, left_mps, right_mps = fit_tracks(command, self._geometry, config.top_speed_mps)
        left_qpps = config.left_sign * left_mps * config.counts_per_m
        right_qpps = config.right_sign * right_mps * config.counts_per_m
        self._port.start(packets.ramped_speeds(config.accel_qpps2, left_qpps, right_qpps), now_ns)
        self._moving = not is_zero(command)
        return fitted
