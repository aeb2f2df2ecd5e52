"""What all chassis emulators share: one end of a link, a plant that moves, and the failures of a real
base."""

from __future__ import annotations

from abc import ABC, abstractmethod

from hal.api import Device, SerialLink
from hal.clocks import NS_PER_MS, NS_PER_S
from hal.device_wrapper import DeviceWrapper
from hal.errors import LinkLost
from sim.plant import TrackedPlant

_STEP_NS = NS_PER_MS  # in which the controller's own ramp is followed


class ChassisEmulator(DeviceWrapper, ABC):
    """An emulator that is stepped with the time. What has arrived counts as of the time of the last step, so
    the order "advance the emulator, then exchange with the driver" has no hidden delay in lockstep.

    boot_ms: how long the base is silent after a restart.
    """

    def __init__(self, link: Device, plant: TrackedPlant, boot_ms: int) -> None:
        super().__init__(link)
        self._plant = plant
        self._boot_ns = boot_ms * NS_PER_MS
        self._now_ns = plant.now_ns
        self._silent_until_ns = plant.now_ns
        self._travel_zero_m = plant.track_travel_m
        self._frozen = False
        self.commands_obeyed = 0

    @property
    def plant(self) -> TrackedPlant:
        """The plant that this base moves."""
        return self._plant

    @abstractmethod
    def advance_to(self, now_ns: int) -> None:
        """Follow what has arrived, move, and send what is due up to and including now_ns."""

    def restart(self) -> None:
        """Interrupt the power: the base is silent while booting, counts travel from zero and loses its
        settings."""
        self._silent_until_ns = self._now_ns + self._boot_ns
        self._travel_zero_m = self._plant.track_travel_m
        self._power_up()

    def freeze(self) -> None:
        """Make its processor hang: it neither sends nor obeys, but the motors' own time-out still runs."""
        self._frozen = True

    def thaw(self) -> None:
        """Let it go on."""
        self._frozen = False

    @abstractmethod
    def _power_up(self) -> None:
        """Enter the state after power-up: motors off."""

    @property
    def _silent(self) -> bool:
        return self._frozen or self._now_ns < self._silent_until_ns

    @property
    def _travel_m(self) -> tuple[float, float]:
        """Travel of the tracks (left, right) since power-up."""
        left_m, right_m = self._plant.track_travel_m
        return left_m - self._travel_zero_m[0], right_m - self._travel_zero_m[1]


class SerialEmulator(ChassisEmulator):
    """An emulator at the end of a serial line. If the cable is unplugged, it receives nothing and keeps
    sending."""

    def __init__(self, link: SerialLink, plant: TrackedPlant, boot_ms: int) -> None:
        super().__init__(link, plant, boot_ms)
        self._link = link

    def _receive(self) -> bytes:
        """What has arrived; nothing while the base is silent."""
        try:
            arrived = self._link.read()
        except LinkLost:
            return b""
        return b"" if self._silent else arrived

    def _transmit(self, data: bytes) -> None:
        try:
            self._link.write(data)
        except LinkLost:
            return


class MotorController(SerialEmulator):
    """A controller that answers only when asked, and moves two tracks along ramps, in steps of a millisecond.

    signs: the directions of the motors (left, right) that move their tracks ahead; -1 for a mirrored motor.
    """

    def __init__(
        self, link: SerialLink, plant: TrackedPlant, boot_ms: int, signs: tuple[int, int] = (1, 1)
    ) -> None:
        super().__init__(link, plant, boot_ms)
        self._signs = signs
        self._goal_mps = [0.0, 0.0]
        self._target_mps = [0.0, 0.0]

    def advance_to(self, now_ns: int) -> None:
        """Answer what has arrived, then move on to now_ns."""
        self._handle_received()
        while self._now_ns < now_ns:
            step_ns = min(_STEP_NS, now_ns - self._now_ns)
            self._ramp(step_ns / NS_PER_S)
            self._plant.command_tracks(*self._signed(*self._target_mps))
            self._now_ns += step_ns
            self._plant.advance_to(self._now_ns)

    @property
    def _motor_travel_m(self) -> tuple[float, float]:
        """Travel of the tracks since power-up, with the signs of the motors."""
        return self._signed(*self._travel_m)

    @property
    def _motor_speeds_mps(self) -> tuple[float, float]:
        """Speeds of the tracks, with the signs of the motors."""
        return self._signed(*self._plant.track_speeds_mps)

    def _signed(self, left: float, right: float) -> tuple[float, float]:
        return self._signs[0] * left, self._signs[1] * right

    @abstractmethod
    def _handle_received(self) -> None:
        """Handle what has arrived."""

    @abstractmethod
    def _ramp(self, step_s: float) -> None:
        """Move the targets towards the goals."""

    def _ramp_towards(self, track: int, goal_mps: float, ramp_mps2: float, step_s: float) -> None:
        limit_mps = ramp_mps2 * step_s
        change_mps = goal_mps - self._target_mps[track]
        self._target_mps[track] += min(max(change_mps, -limit_mps), limit_mps)

    def _stop_motors(self) -> None:
        self._goal_mps = [0.0, 0.0]
        self._target_mps = [0.0, 0.0]
        self._plant.command_tracks(0.0, 0.0)


def as_int32(value: int) -> int:
    """The value of a counter that wraps at 32 bits, signed."""
    return (value + (1 << 31)) % (1 << 32) - (1 << 31)
