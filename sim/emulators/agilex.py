"""An emulated AgileX base: protocol V2, over CAN or RS-232.

Like the real base it starts in standby, follows motion commands only after 0x421, and stops by itself without
0x111. It reports the motion of its tracks, which does not include slip.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from hal.api import CanLink
from hal.chassis.agilex_messages import (
    ActuatorFast,
    ActuatorSlow,
    AgilexMessage,
    Battery,
    ControlModeCommand,
    MotionCommand,
    MotionFeedback,
    Odometer,
    SystemState,
    decode,
    encode,
)
from hal.chassis.agilex_models import BUNKER, AgilexModel
from hal.clocks import NS_PER_MS
from hal.errors import LinkLost
from sim.emulators.base import ChassisEmulator, as_int32
from sim.plant import TrackedPlant

_STANDBY, _CAN, _SERIAL, _REMOTE = 0, 1, 2, 3
_NORMAL, _ESTOP, _EXCEPTION = 0, 1, 2
# For the motors' own reports, which the driver does not use. Real bases differ.
_WHEEL_RADIUS_M, _PULSES_PER_M = 0.1, 20_000


@dataclass(slots=True)
class _Broadcast:
    """One kind of frame that the base sends by itself."""

    period_ns: int
    due_ns: int
    make: Callable[[], tuple[AgilexMessage, ...]]


class AgilexEmulator(ChassisEmulator):
    """Motors are alternately left and right. Commands are followed in the control mode of this wire (1 CAN, 2
    serial). A model that needs 0x421 repeatedly, such as BUNKER MINI, returns to standby without it.
    """

    def __init__(
        self,
        link: CanLink,
        plant: TrackedPlant,
        *,
        model: AgilexModel = BUNKER,
        over_serial: bool = False,
        state_period_ms: int = 100,
        boot_ms: int = 1000,
    ) -> None:
        super().__init__(link, plant, boot_ms)
        self._link = link
        self._actuators = model.actuators
        self._command_mode = model.command_mode(over_serial)
        self._command_timeout_ns = model.base_timeout_ms * NS_PER_MS
        # A mode that must be repeated times out as fast as the motion command.
        self._mode_timeout_ns = None if model.mode_period_ms is None else self._command_timeout_ns
        self._mode_received_ns = plant.now_ns
        start_ns = plant.now_ns
        self._broadcasts = (
            _Broadcast(20 * NS_PER_MS, start_ns, self._motion),
            _Broadcast(20 * NS_PER_MS, start_ns, self._odometer),
            _Broadcast(20 * NS_PER_MS, start_ns, self._actuators_fast),
            _Broadcast(state_period_ms * NS_PER_MS, start_ns, self._state),
            _Broadcast(100 * NS_PER_MS, start_ns, self._actuators_slow),
            _Broadcast(500 * NS_PER_MS, start_ns, self._battery),
        )
        self.mode = _STANDBY
        self.vehicle_state = _NORMAL
        self.fault_bits = 0
        self.driver_bits = 0x40
        self.battery_v = 50.0
        self._count = 0
        self._command_ns: int | None = None
        self._muted: frozenset[int] = frozenset()

    def advance_to(self, now_ns: int) -> None:
        """Follow what has arrived, move, and send what is due up to and including now_ns."""
        self._handle_received()
        while (event_ns := self._next_event_ns()) <= now_ns:
            self._move_to(event_ns)
            for broadcast in self._broadcasts:
                if broadcast.due_ns <= event_ns:
                    broadcast.due_ns += broadcast.period_ns
                    self._send(broadcast.make())
        self._move_to(now_ns)

    # Faults, for tests and scenarios.

    def press_estop(self) -> None:
        """Press the red button."""
        self.vehicle_state = _ESTOP
        self._plant.command(0.0, 0.0)

    def release_estop(self) -> None:
        """Release the red button. The mode is as before, so commands are followed again."""
        self.vehicle_state = _NORMAL

    def raise_exception(self, fault_bits: int) -> None:
        """Make the base report a fault of its own and stop."""
        self.vehicle_state = _EXCEPTION
        self.fault_bits = fault_bits
        self._plant.command(0.0, 0.0)

    def clear_exception(self) -> None:
        """Clear the fault."""
        self.vehicle_state = _NORMAL
        self.fault_bits = 0

    def take_over(self, v_mps: float = 0.0, w_radps: float = 0.0) -> None:
        """Drive with the remote control, which outranks everything."""
        self.mode = _REMOTE
        self._command_ns = None
        self._plant.command(v_mps, w_radps)

    def hand_back(self) -> None:
        """Switch the remote control to command mode; the host must still send 0x421."""
        self.mode = _STANDBY
        self._plant.command(0.0, 0.0)

    def mute(self, *arbitration_ids: int) -> None:
        """Stop sending these frames; without arguments, send all frames again."""
        self._muted = frozenset(arbitration_ids)

    # The base's own work.

    def _power_up(self) -> None:
        self.mode = _STANDBY
        self.vehicle_state = _NORMAL
        self._count = 0
        self._command_ns = None
        self._plant.command(0.0, 0.0)

    def _handle_received(self) -> None:
        try:
            while (frame := self._link.receive()) is not None:
                message = decode(frame)
                if message is not None and not self._silent:
                    self._obey(message)
        except LinkLost:
            # The base does not know that its cable is unplugged; its own time-out stops it.
            return

    def _obey(self, message: AgilexMessage) -> None:
        if isinstance(message, ControlModeCommand):
            if self.mode != _REMOTE and message.mode in (_STANDBY, _CAN, _SERIAL):
                self._mode_received_ns = self._now_ns
                self._enter(message.mode)
        elif (
            isinstance(message, MotionCommand)
            and self.mode == self._command_mode
            and self.vehicle_state == _NORMAL
        ):
            self._command_ns = self._now_ns
            self._plant.command(message.v_mps, message.w_radps)
            self.commands_obeyed += 1

    def _enter(self, mode: int) -> None:
        if mode != self.mode:
            self._plant.command(0.0, 0.0)
            self._command_ns = None
        self.mode = mode

    def _next_event_ns(self) -> int:
        next_ns = min(broadcast.due_ns for broadcast in self._broadcasts)
        if self._command_ns is not None:
            next_ns = min(next_ns, self._command_ns + self._command_timeout_ns)
        return next_ns

    def _move_to(self, now_ns: int) -> None:
        self._plant.advance_to(now_ns)
        self._now_ns = max(self._now_ns, now_ns)
        timeout_ns, commanded = self._mode_timeout_ns, self.mode in (_CAN, _SERIAL)
        if commanded and timeout_ns is not None and self._now_ns - self._mode_received_ns >= timeout_ns:
            self._enter(_STANDBY)
        if self._command_ns is not None and self._now_ns - self._command_ns >= self._command_timeout_ns:
            self._command_ns = None
            self._plant.command(0.0, 0.0)

    def _send(self, messages: tuple[AgilexMessage, ...]) -> None:
        if self._silent:
            return
        try:
            for message in messages:
                frame = encode(message)
                if frame.arbitration_id not in self._muted:
                    self._link.send(frame)
        except LinkLost:
            # As in _handle_received: the base keeps sending into an unplugged cable.
            return

    def _motion(self) -> tuple[AgilexMessage, ...]:
        return (MotionFeedback(*self._plant.track_twist),)

    def _odometer(self) -> tuple[AgilexMessage, ...]:
        left_m, right_m = self._travel_m
        return (Odometer(as_int32(round(1000.0 * left_m)), as_int32(round(1000.0 * right_m))),)

    def _state(self) -> tuple[AgilexMessage, ...]:
        count, self._count = self._count, (self._count + 1) % 256
        return (SystemState(self.vehicle_state, self.mode, self.battery_v, self.fault_bits, count),)

    def _actuators_fast(self) -> tuple[AgilexMessage, ...]:
        frames = []
        for index in range(self._actuators):
            speed_mps = self._plant.track_speeds_mps[index % 2]
            rpm = round(speed_mps / _WHEEL_RADIUS_M * 60.0 / math.tau)
            pulses = as_int32(round(self._plant.track_travel_m[index % 2] * _PULSES_PER_M))
            frames.append(ActuatorFast(index, rpm, 0.5 + 2.0 * abs(speed_mps), pulses))
        return tuple(frames)

    def _actuators_slow(self) -> tuple[AgilexMessage, ...]:
        return tuple(
            ActuatorSlow(index, self.battery_v, 35, 40, self.driver_bits) for index in range(self._actuators)
        )

    def _battery(self) -> tuple[AgilexMessage, ...]:
        return (Battery(80, 100, self.battery_v, -2.0, 25.0),)
