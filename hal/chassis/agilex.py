"""Driver for AgileX tracked and skid-steer bases: protocol V2 over CAN or RS-232.

One motion command 0x111 is sent every command period: zero in every mode except armed. 0x421 takes the base
out of standby while arming, and puts it back afterwards. Where somebody else commands the base over CAN, the
driver does not arm, and latches if it is armed. Before it has begun to arm it then sends nothing at all,
since a zero would stop a drive that is not its own.

Frames that no node acknowledges wait in the adapter and in the kernel until the cable is plugged in again.
So motion goes out only while the base is heard, and what waits behind it is zero.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from config.chassis import AgilexChassisConfig
from hal.api import CanLink
from hal.chassis.agilex_feedback import AgilexFeedback
from hal.chassis.agilex_messages import (
    ACTUATORS,
    AgilexMessage,
    ControlModeCommand,
    MotionCommand,
    decode,
    encode,
)
from hal.chassis.agilex_models import battery_low_v_of, model_of, over_serial
from hal.chassis.arming import ArmingLimits
from hal.chassis.command import CommandLimits, due, is_zero, zero
from hal.chassis.driver import ChassisDriver
from hal.chassis.other_master import HOST_FRAMES, OtherMaster
from hal.clocks import NS_PER_MS
from hal.types import ChassisMode, Setpoint

# All that this driver ever sends: identifier -> maximum number of bytes.
COMMANDS: Mapping[int, int] = MappingProxyType({0x111: 8, 0x421: 1})

# Maximum for one exchange. A bus at 500 kbit/s carries about 90 frames in 20 ms; more than this is a flood.
_MAX_FRAMES = 256

# Motor speeds and currents, 100 frames a second, which are not used.
_FIRST_ACTUATOR = 0x251
_UNUSED_IDS = frozenset(range(_FIRST_ACTUATOR, _FIRST_ACTUATOR + ACTUATORS))

# Period of 0x421 while the base has not followed it.
_MODE_RETRY_NS = 40 * NS_PER_MS

# Once this many frames were sent since the base was last heard, motion is held back. So is the mode that some
# models need again and again while armed. A base that works sends several frames each 20 ms. SocketCAN queues
# 10 frames (txqueuelen), so there is room for a zero behind these.
_MAX_UNHEARD = 2


def no_can_frames_hint() -> str:
    """What to check if the bus is silent."""
    return "not one frame came; check power, wiring, termination and 500 kbit/s"


class AgilexChassis(ChassisDriver):
    """hal.api.Chassis for AgileX V2.

    link: over RS-232, a hal.chassis.agilex_serial.AgilexSerialBus. no_frames_hint: over RS-232, its
    silence_hint().
    """

    def __init__(
        self,
        link: CanLink,
        config: AgilexChassisConfig,
        no_frames_hint: Callable[[], str] = no_can_frames_hint,
    ) -> None:
        model = model_of(config)
        other_master = OtherMaster()
        feedback = AgilexFeedback(config, model, no_frames_hint, other_master)
        commands = CommandLimits(
            max_speed_mps=config.top_speed_mps,
            max_yaw_rate_radps=config.top_yaw_rate_radps(0.0),
            timeout_ns=config.command_timeout_ms * NS_PER_MS,
        )
        limits = ArmingLimits(
            feedback_timeout_ns=config.feedback_timeout_ms * NS_PER_MS,
            status_timeout_ns=config.status_timeout_ms * NS_PER_MS,
            arming_timeout_ns=config.arming_timeout_ms * NS_PER_MS,
            max_step_gap_ns=model.base_timeout_ms * NS_PER_MS,
        )
        super().__init__(link, feedback, commands, limits, battery_low_v_of(config))
        self._link = link
        self._model = model
        self._command_mode = model.command_mode(over_serial(config))
        # A serial line has one computer at its end; a command that comes from there is an echo.
        self._other_master = None if over_serial(config) else other_master
        self._arming_begun = False
        self._feedback = feedback
        self._slip_factor = config.slip_factor
        self._period_ns = config.command_period_ms * NS_PER_MS
        self._motion_sent_ns: int | None = None
        self._moving = False
        self._sent_unheard = 0
        self._mode_sent_ns: int | None = None

    def _receive(self, now_ns: int) -> bool:
        messages: list[AgilexMessage] = []
        received = heard = False
        try:
            for _ in range(_MAX_FRAMES):
                frame = self._link.receive()
                if frame is None:
                    break
                received = True
                if frame.arbitration_id in _UNUSED_IDS:
                    heard = True
                    self._feedback.note_actuator(frame.arbitration_id - _FIRST_ACTUATOR)
                    continue
                message = decode(frame)
                if self._other_master is not None and frame.arbitration_id in HOST_FRAMES:
                    self._other_master.note_frame(frame.arbitration_id, now_ns)
                elif message is None:
                    self._feedback.note_foreign(frame.arbitration_id)
                else:
                    messages.append(message)
        finally:
            # What arrived before the link was lost is still valid.
            if self._other_master is not None:
                self._other_master.step(now_ns)
            self._feedback.update(messages, now_ns)
            if heard or messages:
                self._sent_unheard = 0
        return received

    def _send(self, command: Setpoint, now_ns: int) -> Setpoint | None:
        if self._other_master_drives:
            return None
        motion_due = due(self._motion_sent_ns, self._period_ns, now_ns) or (self._moving and is_zero(command))
        motion_due = motion_due and (is_zero(command) or self._heard_lately)
        if motion_due:
            self._send_motion(command, now_ns)
        mode = self._mode_to_send(now_ns)
        if mode is not None:
            self._send_mode(mode, now_ns)
        return command if motion_due else None

    def _send_stop(self, now_ns: int) -> None:
        if self._other_master_drives:
            return
        self._send_motion(zero(now_ns), now_ns)
        self._send_mode(self._model.mode_standby, now_ns)

    def _begin_arming(self) -> None:
        # Arming counts only a 0x211 that arrives from now on, so the old mode need not be forgotten. Send
        # 0x421 at once.
        self._feedback.await_setup()
        self._mode_sent_ns = None
        self._arming_begun = True

    def _missing_feedback(self) -> str:
        return self._feedback.missing_message

    @property
    def _other_master_drives(self) -> bool:
        """Whether somebody else commands a base that this driver never asked to obey."""
        return not self._arming_begun and self._other_master is not None and self._other_master.sentence != ""

    @property
    def _heard_lately(self) -> bool:
        return self._sent_unheard < _MAX_UNHEARD

    def _mode_to_send(self, now_ns: int) -> int | None:
        """The mode of the 0x421 that is due, or None.

        Command mode while arming, and repeatedly while armed if the model needs that; else standby, until the
        base is in it.
        """
        mode = self._arming.mode
        if mode is ChassisMode.ARMED:
            period_ms = self._model.mode_period_ms
            repeated = period_ms is not None and due(self._mode_sent_ns, period_ms * NS_PER_MS, now_ns)
            return self._command_mode if repeated and self._heard_lately else None
        if not due(self._mode_sent_ns, _MODE_RETRY_NS, now_ns):
            return None
        if mode is ChassisMode.ARMING:
            return self._command_mode
        return self._model.mode_standby if self._feedback.in_command_mode else None

    def _send_motion(self, command: Setpoint, now_ns: int) -> None:
        # The base turns by 1 / slip_factor of what its tracks say, so ask for slip_factor times as much.
        w_radps = command.w_radps * self._slip_factor
        self._send_message(MotionCommand(command.v_mps, w_radps))
        self._motion_sent_ns = now_ns
        self._moving = not is_zero(command)

    def _send_mode(self, mode: int, now_ns: int) -> None:
        self._send_message(ControlModeCommand(mode))
        self._mode_sent_ns = now_ns

    def _send_message(self, message: MotionCommand | ControlModeCommand) -> None:
        self._sent_unheard += 1
        self._link.send(encode(message))
