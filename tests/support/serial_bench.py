"""A serial driver and its emulator on a wire in memory, for the tests of one driver."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from itertools import count
from typing import Generic, TypeVar

from config.plant import PlantConfig
from hal.api import Chassis, SerialLink
from hal.links.scripted import ScriptedSerialLink, serial_pair
from hal.types import ChassisMode, ChassisState, Setpoint
from sim.emulators.base import SerialEmulator
from sim.plant import TrackedPlant
from tests.support.chassis_rig import MS

EmulatorT = TypeVar("EmulatorT", bound=SerialEmulator)


class SerialBench(Generic[EmulatorT]):
    """The driver with the emulator, and the line between them; near is the driver's end.

    arming_periods: how many control periods arming may take.
    """

    arming_periods = 40

    def __init__(
        self,
        plant: PlantConfig,
        make_emulator: Callable[[SerialLink, TrackedPlant], EmulatorT],
        make_chassis: Callable[[SerialLink], Chassis],
    ) -> None:
        self.near, self.far = serial_pair()
        self.plant = TrackedPlant(plant)
        self.emulator = make_emulator(self.far, self.plant)
        self.chassis = make_chassis(self.near)
        self.now_ns = 0
        self._delay_ns = 0
        self._held_back: deque[tuple[int, bytes]] = deque()

    def delay_answers(self, delay_ms: int) -> None:
        """From now on, what the emulator says reaches the driver this much later."""
        self._delay_ns = delay_ms * MS
        self.far.peer = None
        self.far.written.clear()

    def step(self, v_mps: float | None = None, w_radps: float = 0.0, after_ms: int = 20) -> ChassisState:
        """Emulator, then driver; near.written is what this exchange wrote."""
        self.now_ns += after_ms * MS
        self.emulator.advance_to(self.now_ns)
        self._deliver_held_back()
        self.near.written.clear()
        command = None if v_mps is None else Setpoint(self.now_ns, v_mps, 0.0, w_radps)
        return self.chassis.exchange(command, self.now_ns)

    def _deliver_held_back(self) -> None:
        if self.far.peer is None:
            self._held_back += [(self.now_ns + self._delay_ns, data) for data in self.far.written]
            self.far.written.clear()
        while self._held_back and self._held_back[0][0] <= self.now_ns:
            self.near.deliver(self._held_back.popleft()[1])

    def run(self, steps: int, v_mps: float | None = None, w_radps: float = 0.0) -> ChassisState:
        """Many periods."""
        for _ in range(steps):
            state = self.step(v_mps, w_radps)
        return state

    def arm(self) -> None:
        """Consent, and wait until it is followed."""
        self.run(10)
        self.chassis.arm(self.now_ns)
        state = self.run(self.arming_periods)
        assert state.mode is ChassisMode.ARMED, state.reason


def every(nth: int, change: Callable[[bytes], bytes]) -> Callable[[bytes], bytes]:
    """For ScriptedSerialLink.set_filter: each nth message is changed, the others pass."""
    numbers = count(1)
    return lambda data: change(data) if next(numbers) % nth == 0 else data


def first_with_speed(states: list[ChassisState]) -> int:
    """The first state with a speed. Before it there is none, and it begins with standing."""
    known = next(k for k, state in enumerate(states) if state.feedback_ns is not None)
    assert all(state.v_mps != state.v_mps for state in states[:known])
    assert states[known].v_mps == 0.0
    return known


def arming_failure_reason(make_chassis: Callable[[SerialLink], Chassis], noise: bytes) -> str:
    """What the driver says when the base at the other end says nothing but this, again and again."""
    link = ScriptedSerialLink()
    chassis = make_chassis(link)
    chassis.arm(0)
    for k in range(1, 160):
        link.deliver(noise)
        state = chassis.exchange(None, k * 20 * MS)
    assert state.mode is ChassisMode.STANDBY
    prefix = "arming gave up after 3.0 s: no status heard from the base: "
    assert state.reason.startswith(prefix)
    return state.reason.removeprefix(prefix)
