"""Driver for a Kobuki (the base of Turtlebot 2) on a serial line, stepped by the control loop.

The vendor's driver answers each feedback frame with one command, so it goes silent when the frames stop. This
driver sends a command every period, whatever comes back, above all a zero.
"""

from __future__ import annotations

from config.chassis import KOBUKI_TOP_SPEED_MPS, KobukiChassisConfig
from hal.api import SerialLink
from hal.chassis.arming import ArmingLimits
from hal.chassis.command import CommandLimits, due, fit_tracks, is_zero
from hal.chassis.driver import ChassisDriver
from hal.chassis.kobuki_feedback import KobukiFeedback
from hal.chassis.kobuki_packets import WHEEL_BASE_M, FrameReader, base_control, parse
from hal.chassis.reading import read_all
from hal.chassis.tracks import TrackGeometry
from hal.clocks import NS_PER_MS
from hal.types import Setpoint


class KobukiChassis(ChassisDriver):
    """hal.api.Chassis for Kobuki."""

    def __init__(self, link: SerialLink, config: KobukiChassisConfig) -> None:
        feedback = KobukiFeedback(config)
        commands = CommandLimits(
            config.max_speed_mps, config.max_yaw_rate_radps, config.command_timeout_ms * NS_PER_MS
        )
        limits = ArmingLimits(
            feedback_timeout_ns=config.feedback_timeout_ms * NS_PER_MS,
            status_timeout_ns=config.feedback_timeout_ms * NS_PER_MS,
            arming_timeout_ns=config.arming_timeout_ms * NS_PER_MS,
            max_step_gap_ns=config.base_timeout_ms * NS_PER_MS,
        )
        super().__init__(link, feedback, commands, limits, config.battery_low_v)
        self._link = link
        self._feedback = feedback
        self._geometry = TrackGeometry(WHEEL_BASE_M, config.slip_factor)
        self._period_ns = config.command_period_ms * NS_PER_MS
        self._reader = FrameReader()
        self._motion_sent_ns: int | None = None
        self._moving = False

    def _receive(self, now_ns: int) -> bool:
        arrived = read_all(self._link)
        self._feedback.bytes_received += len(arrived)
        for payload in self._reader.feed(arrived):
            feedback = parse(payload)
            if feedback is not None:
                self._feedback.take(feedback, now_ns)
        return bool(arrived)

    def _send(self, command: Setpoint, now_ns: int) -> Setpoint | None:
        stopping = self._moving and is_zero(command)
        if not (stopping or due(self._motion_sent_ns, self._period_ns, now_ns)):
            return None
        limited, _, _ = fit_tracks(command, self._geometry, KOBUKI_TOP_SPEED_MPS)
        # The base turns by 1 / slip_factor of what its wheels say, so ask for slip_factor times as much.
        self._link.write(base_control(limited.v_mps, limited.w_radps * self._geometry.slip_factor))
        self._motion_sent_ns = now_ns
        self._moving = not is_zero(command)
        return limited

    def _send_stop(self, now_ns: int) -> None:
        self._feedback.forget_setup()
        self._link.write(base_control(0.0, 0.0))
        self._motion_sent_ns = now_ns
        self._moving = False

    def _begin_arming(self) -> None:
        self._feedback.await_setup()
