"""An emulated Roboteq two-channel controller with two tracks, on a serial line.

It knows the ASCII commands that the manual documents for closed-loop speed control, and echoes every
character until told not to. It has the trap of the real watchdog: motors that the watchdog stopped run again
at their old speed as soon as any valid command comes.
"""

from __future__ import annotations

from collections.abc import Callable

from hal.api import SerialLink
from hal.clocks import NS_PER_MS
from sim.emulators.base import MotorController, as_int32
from sim.plant import TrackedPlant

_ESTOP_FLAG = 0x10  # of the fault flags, ?FF
_DEFAULT_WATCHDOG_MS = 1000  # after each start
_ACCEPTED, _REFUSED = "+", "-"


class _Refused(Exception):
    """Raised for a command that is unknown or wrong; it is answered by "-"."""


class RoboteqEmulator(MotorController):
    """Channel 1 drives the left track, channel 2 the right one.

    full_speed_mps: track speed at command 1000. max_rpm: motor speed at command 1000.
    ramp_mps2: both ramps as the device was set up; !AC and !DC change them, in 0.1 rpm/s.
    """

    def __init__(
        self,
        link: SerialLink,
        plant: TrackedPlant,
        *,
        full_speed_mps: float = 1.5,
        counts_per_m: float = 20_000.0,
        max_rpm: int = 3000,
        signs: tuple[int, int] = (1, 1),
        ramp_mps2: float = 5.0,
        boot_ms: int = 500,
    ) -> None:
        super().__init__(link, plant, boot_ms, signs)
        self._full_speed_mps = full_speed_mps
        self._counts_per_m = counts_per_m
        self._max_rpm = max_rpm
        self._button_pressed = False
        self._rise_mps2 = [ramp_mps2, ramp_mps2]
        self._fall_mps2 = [ramp_mps2, ramp_mps2]
        self.fault_flags = 0
        self.motor_flags = [0, 0]
        self.battery_v = 24.6
        self.settable_watchdog = True
        self.refused = 0
        self._power_up()

    # Faults, for tests and scenarios.

    def press_estop(self) -> None:
        """Open the emergency stop input: motors off at once, latched."""
        self._button_pressed = True
        self._shut_down()

    def release_estop(self) -> None:
        """Close the input. The controller stays in emergency stop until !MG."""
        self._button_pressed = False

    # The controller's own work.

    def _power_up(self) -> None:
        """Counters at zero, echo on, watchdog at its default. If the button is still pressed, stop again."""
        self._line = ""
        self.echo = True
        self.watchdog_ms = _DEFAULT_WATCHDOG_MS
        self.fault_flags &= ~_ESTOP_FLAG
        self._fed_ns = self._now_ns
        self._timed_out = False
        self._stop_motors()
        if self._button_pressed:
            self._shut_down()

    def _shut_down(self) -> None:
        self.fault_flags |= _ESTOP_FLAG
        self._stop_motors()

    def _handle_received(self) -> None:
        for character in self._receive().decode("latin-1"):
            if self.echo:
                self._send_text(character)
            if character not in "\r_":
                # As in the device, a line without an end does not grow for ever.
                self._line = (self._line + character)[-128:]
                continue
            line, self._line = self._line, ""
            if line:
                self._send_text(self._answer(line) + "\r")

    def _send_text(self, text: str) -> None:
        self._transmit(text.encode("latin-1"))

    def _answer(self, line: str) -> str:
        try:
            return self._execute(line)
        except (_Refused, ValueError):
            self.refused += 1
            return _REFUSED

    def _execute(self, line: str) -> str:
        """The answer to a line that is carried out. Raises _Refused or ValueError."""
        mark, (name, *arguments) = line[0], line[1:].upper().split() or [""]
        values = [int(argument) for argument in arguments]
        match mark:
            case "!":
                self._command(name, values)
                return _ACCEPTED
            case "?":
                return self._query(name, values)
            case "^":
                self._configure(name, values)
                return _ACCEPTED
            case "~":
                return self._configuration(name)
        raise _Refused

    def _command(self, name: str, values: list[int]) -> None:
        match name, values:
            case "M", [left, right]:
                self._feed_watchdog()
                self._set_speeds([left, right])
            case "G", [1 | 2 as channel, value]:
                self._feed_watchdog()
                self._set_speeds([value], channel)
            case "S", [1 | 2 as channel, rpm]:
                self._feed_watchdog()
                self._set_speeds([round(1000 * rpm / self._max_rpm)], channel)
            case "MS", [1 | 2 as channel]:
                self._feed_watchdog()
                self._set_speeds([0], channel)
            case "AC", [1 | 2 as channel, ramp]:
                self._feed_watchdog()
                self._rise_mps2[channel - 1] = self._ramp_mps2(ramp)
            case "DC", [1 | 2 as channel, ramp]:
                self._feed_watchdog()
                self._fall_mps2[channel - 1] = self._ramp_mps2(ramp)
            case "EX", []:
                self._feed_watchdog()
                self._shut_down()
            case "MG", []:
                self._feed_watchdog()
                if not self._button_pressed:
                    self.fault_flags &= ~_ESTOP_FLAG
            case _:
                raise _Refused

    def _feed_watchdog(self) -> None:
        """Feed the watchdog, as any valid command does. Motors that the watchdog stopped run again."""
        self._fed_ns = self._now_ns
        self._timed_out = False

    def _set_speeds(self, thousandths: list[int], channel: int = 1) -> None:
        if self.fault_flags:
            return
        self.commands_obeyed += 1
        for track, value in enumerate(thousandths, start=channel - 1):
            self._goal_mps[track] = min(max(value, -1000), 1000) / 1000.0 * self._full_speed_mps

    def _ramp_mps2(self, tenth_rpm_per_s: int) -> float:
        if tenth_rpm_per_s <= 0:
            raise _Refused
        return tenth_rpm_per_s / 10.0 / self._max_rpm * self._full_speed_mps

    def _query(self, name: str, values: list[int]) -> str:
        left_rpm, right_rpm = (
            round(speed / self._full_speed_mps * self._max_rpm) for speed in self._motor_speeds_mps
        )
        if name == "FID":
            return "FID=Roboteq v2.1 EMULATED 01/01/2020"
        answers: dict[str, Callable[[], tuple[int, ...]]] = {
            "C": self._counts,
            "CB": self._counts,
            "S": lambda: (left_rpm, right_rpm),
            "BS": lambda: (left_rpm, right_rpm),
            "A": self._currents,
            "BA": self._currents,
            "V": lambda: (135, round(self.battery_v * 10), 4998),
            "T": lambda: (31, 33, 34),
            "FF": lambda: (self.fault_flags,),
            "FM": lambda: tuple(self.motor_flags),
        }
        if name not in answers:
            raise _Refused
        reply = answers[name]()
        if values:  # one channel alone
            if len(values) != 1 or not 1 <= values[0] <= len(reply):
                raise _Refused
            reply = (reply[values[0] - 1],)
        return f"{name}={':'.join(map(str, reply))}"

    def _counts(self) -> tuple[int, ...]:
        return tuple(as_int32(round(travel_m * self._counts_per_m)) for travel_m in self._motor_travel_m)

    def _currents(self) -> tuple[int, ...]:
        return tuple(round(5 + 30 * abs(speed)) for speed in self._target_mps)

    def _configure(self, name: str, values: list[int]) -> None:
        match name, values:
            case "ECHOF", [0 | 1 as off]:
                self.echo = not off
            case "RWD", [timeout_ms] if 0 <= timeout_ms <= 65_000:
                if self.settable_watchdog:
                    self.watchdog_ms = timeout_ms
            case _:
                raise _Refused

    def _configuration(self, name: str) -> str:
        match name:
            case "ECHOF":
                return f"ECHOF={int(not self.echo)}"
            case "RWD":
                return f"RWD={self.watchdog_ms}"
        raise _Refused

    def _ramp(self, step_s: float) -> None:
        """Move the targets along their ramps; to zero once the watchdog has expired."""
        if self.watchdog_ms and self._now_ns - self._fed_ns >= self.watchdog_ms * NS_PER_MS:
            self._timed_out = True
        if self.fault_flags:
            # The motors stay off: the end of a fault does not bring the old speed back.
            self._goal_mps = [0.0, 0.0]
        for track in (0, 1):
            goal_mps = 0.0 if self._timed_out else self._goal_mps[track]
            rises = abs(goal_mps) > abs(self._target_mps[track])
            ramps = self._rise_mps2 if rises else self._fall_mps2
            self._ramp_towards(track, goal_mps, ramps[track], step_s)
