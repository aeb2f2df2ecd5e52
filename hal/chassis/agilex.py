"""AgileX tracked bases over CAN, protocol V2, stepped by the control loop.

Every command period one motion command 0x111 goes out: zero in every mode but armed. 0x421 takes the
base out of standby while arming and puts it back afterwards. What has arrived is read at each exchange.
"""

from __future__ import annotations

from types import TracebackType
from typing import Self

from config.chassis import AgilexChassisConfig
from hal.api import CanLink
from hal.chassis import arming
from hal.chassis.agilex_feedback import AgilexFeedback
from hal.chassis.agilex_messages import AgilexMessage, ControlModeCommand, MotionCommand, decode, encode
from hal.chassis.agilex_models import model_of
from hal.chassis.arming import NS_PER_MS, Arming, ArmingLimits, Evidence
from hal.chassis.command import CommandLimits, is_zero, zero
from hal.errors import LinkLost
from hal.types import ChassisMode, ChassisState, Setpoint

# A bus at 500 kbit/s carries about 90 frames in 20 ms; more than this in one exchange is a flood.
_MAX_FRAMES = 256

# A due time may be early by a quarter of the period: a loop with jitter would else miss every other one.
_EARLY = 0.75

# How often a lost link is tried again, and 0x421 repeated while the base has not followed it.
_RETRY_NS = 500 * NS_PER_MS
_MODE_RETRY_NS = 40 * NS_PER_MS


class AgilexChassis:
    """hal.api.Chassis for AgileX V2. Never raises from exchange(), arm() or stop()."""

    def __init__(self, link: CanLink, config: AgilexChassisConfig) -> None:
        model = model_of(config)
        self._link = link
        self._model = model
        self._slip_factor = config.slip_factor
        self._period_ns = config.command_period_ms * NS_PER_MS
        self._commands = CommandLimits(
            model.max_speed_mps, model.max_yaw_rate_radps, config.command_timeout_ms * NS_PER_MS
        )
        self._limits = ArmingLimits(
            feedback_timeout_ns=config.feedback_timeout_ms * NS_PER_MS,
            status_timeout_ns=config.status_timeout_ms * NS_PER_MS,
            arming_timeout_ns=config.arming_timeout_ms * NS_PER_MS,
            stall_ns=model.base_timeout_ms * NS_PER_MS,
        )
        self._feedback = AgilexFeedback(config, model)
        self._arming = Arming()
        self._asked: Setpoint | None = None
        self._objection = ""
        self._link_error = ""
        self._retry_ns = 0
        self._motion_sent_ns: int | None = None
        self._moving_sent = False
        self._mode_sent_ns: int | None = None
        self._now_ns = 0

    def __enter__(self) -> Self:
        """Open the link. Raises DeviceNotFound, DeviceRefused."""
        self._link.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.stop(self._now_ns)
        finally:
            self._link.__exit__(kind, error, trace)

    def exchange(self, setpoint: Setpoint | None, now_ns: int) -> ChassisState:
        """See hal.api.Chassis. sent is the setpoint after slowing to the base's limits, before
        rounding to the wire's 1 mm/s and 1 mrad/s."""
        self._now_ns = now_ns
        self._asked = setpoint
        self._objection = self._commands.objection(setpoint, now_ns)
        self._receive(now_ns)
        self._arming = arming.step(self._arming, self._evidence(now_ns), self._limits)
        sent = self._send_due(setpoint, now_ns)
        return self._state(now_ns, sent)

    def arm(self, now_ns: int) -> None:
        """See hal.api.Chassis. A refusal is told in the state's reason."""
        self._now_ns = now_ns
        self._arming = arming.consent(self._arming, self._evidence(now_ns), self._limits)
        self._mode_sent_ns = None

    def stop(self, now_ns: int) -> None:
        """See hal.api.Chassis."""
        self._now_ns = now_ns
        self._arming = arming.release(self._arming, now_ns)
        if not self._link_error:
            self._send_motion(zero(now_ns), now_ns)
            self._send_mode(self._model.mode_standby, now_ns)

    def _receive(self, now_ns: int) -> None:
        if self._link_error and now_ns < self._retry_ns:
            return
        messages: list[AgilexMessage] = []
        try:
            for _ in range(_MAX_FRAMES):
                frame = self._link.receive()
                if frame is None:
                    break
                message = decode(frame)
                if message is not None:
                    messages.append(message)
        except LinkLost as error:
            self._lose(error, now_ns)
        else:
            self._link_error = ""
        self._feedback.update(messages, now_ns)

    def _evidence(self, now_ns: int) -> Evidence:
        feedback = self._feedback
        return Evidence(
            now_ns=now_ns,
            link_error=self._link_error,
            feedback_ns=feedback.feedback_ns,
            status_ns=feedback.state_ns,
            obeys=feedback.obeys,
            stop_cause=feedback.stop_cause or self._objection,
            standing=feedback.standing,
            command_is_zero=is_zero(self._asked),
        )

    def _send_due(self, setpoint: Setpoint | None, now_ns: int) -> Setpoint | None:
        """The motion command if it is due, and 0x421 if the base is not in the mode it should be in."""
        if self._link_error:
            return None
        command = self._commands.fit(setpoint, now_ns) if self._arming.may_move else zero(now_ns)
        # A zero that replaces motion does not wait for the period.
        due = self._due(self._motion_sent_ns, self._period_ns, now_ns) or (
            self._moving_sent and is_zero(command)
        )
        sent = command if due and self._send_motion(command, now_ns) else None
        mode = self._mode_to_send(now_ns)
        if mode is not None:
            self._send_mode(mode, now_ns)
        return sent

    def _mode_to_send(self, now_ns: int) -> int | None:
        mode = self._arming.mode
        if mode is ChassisMode.ARMED:
            period_ms = self._model.mode_period_ms
            if period_ms is not None and self._due(self._mode_sent_ns, period_ms * NS_PER_MS, now_ns):
                return self._model.mode_can
            return None
        if not self._due(self._mode_sent_ns, _MODE_RETRY_NS, now_ns):
            return None
        if mode is ChassisMode.ARMING:
            return None if self._feedback.obeys_since(self._arming.since_ns) else self._model.mode_can
        return self._model.mode_standby if self._feedback.obeys else None

    @staticmethod
    def _due(last_ns: int | None, period_ns: int, now_ns: int) -> bool:
        return last_ns is None or not 0 <= now_ns - last_ns < _EARLY * period_ns

    def _send_motion(self, command: Setpoint, now_ns: int) -> bool:
        # The base turns slip_factor times less than its tracks say, so ask for that much more.
        w_radps = command.w_radps * self._slip_factor
        if not self._send(MotionCommand(command.v_mps, w_radps), now_ns):
            return False
        self._motion_sent_ns = now_ns
        self._moving_sent = not is_zero(command)
        return True

    def _send_mode(self, mode: int, now_ns: int) -> None:
        if self._send(ControlModeCommand(mode), now_ns):
            self._mode_sent_ns = now_ns

    def _send(self, message: AgilexMessage, now_ns: int) -> bool:
        if self._link_error:
            return False
        try:
            self._link.send(encode(message))
        except LinkLost as error:
            self._lose(error, now_ns)
            return False
        return True

    def _lose(self, error: LinkLost, now_ns: int) -> None:
        """Told to the machine at once: the state of this very exchange says lost."""
        self._link_error = str(error)
        self._retry_ns = now_ns + _RETRY_NS
        self._arming = arming.step(self._arming, self._evidence(now_ns), self._limits)

    def _state(self, now_ns: int, sent: Setpoint | None) -> ChassisState:
        feedback = self._feedback
        return ChassisState(
            stamp_ns=now_ns,
            mode=self._arming.mode,
            reason=self._arming.reason,
            feedback_ns=feedback.feedback_ns,
            v_mps=feedback.v_mps,
            w_radps=feedback.w_radps,
            pose=feedback.pose,
            battery_v=feedback.battery_v,
            faults=feedback.faults,
            sent=sent,
        )
