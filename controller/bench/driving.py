"""Measures the control step among ten obstacles, and the exchange of a chassis driver."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from controller.bench.busy_scene import OBSTACLES, busy_scene
from controller.bench.figures import Durations
from controller.bench.reel import Tick
from controller.control import ControlLoop
from hal.api import Chassis, Device
from hal.clocks import NS_PER_S
from hal.device_wrapper import DeviceWrapper
from hal.types import ChassisMode, ChassisState, Setpoint
from sim.simulation import Emulator

PERIOD_NS = NS_PER_S // 50  # of the control step
_FRAME_NS = NS_PER_S // 30
_LATENCY_NS = NS_PER_S * 60 // 1000  # from the exposure of a frame to its scene
_MAX_ARM_STEPS = 250  # a base that takes more steps to arm will never arm, so the bench gives up


class TimedChassis(DeviceWrapper):
    """A chassis whose exchanges are timed. spent_ns: duration of the last one."""

    def __init__(self, chassis: Chassis, stopwatch_ns: Callable[[], int]) -> None:
        super().__init__(chassis)
        self._chassis = chassis
        self._stopwatch_ns = stopwatch_ns
        self.spent_ns = 0

    def exchange(self, setpoint: Setpoint | None, now_ns: int) -> ChassisState:
        """See hal.api.Chassis."""
        start_ns = self._stopwatch_ns()
        state = self._chassis.exchange(setpoint, now_ns)
        self.spent_ns = self._stopwatch_ns() - start_ns
        return state

    def arm(self, now_ns: int) -> None:
        """See hal.api.Chassis."""
        self._chassis.arm(now_ns)

    def stop(self, now_ns: int) -> None:
        """See hal.api.Chassis."""
        self._chassis.stop(now_ns)


@dataclass(frozen=True, slots=True)
class ControlFigures:
    """Figures of the control step. step: localise, decide, shape, follow; without the driver's exchange."""

    obstacles: int
    step: Durations

    def as_json(self) -> dict[str, object]:
        """Plain values."""
        return {"obstacles": self.obstacles, "step": self.step.as_json()}


def measure_control(
    loop: ControlLoop,
    chassis: TimedChassis,
    emulator: Emulator,
    steps: int,
    stopwatch_ns: Callable[[], int],
    tick: Tick,
) -> ControlFigures:
    """Time the steps of loop while the base is armed. Scenes come at 30 Hz, 60 ms after their exposure.

    chassis: the one that loop drives.
    Raises RuntimeError if the emulated base does not arm, which is a bug in the program.
    """
    spent_ns: list[int] = []
    with emulator, chassis:
        for index in range(steps + _MAX_ARM_STEPS):
            now_ns = index * PERIOD_NS
            emulator.advance_to(now_ns)
            sequence = max(now_ns - _LATENCY_NS, 0) // _FRAME_NS
            captured_ns = sequence * _FRAME_NS
            scene = busy_scene(captured_ns, sequence, loop.localiser.body_pose(captured_ns))
            start_ns = stopwatch_ns()
            result = loop.step(scene, now_ns)
            step_ns = stopwatch_ns() - start_ns
            if result.chassis.mode is ChassisMode.ARMED:
                spent_ns.append(step_ns - chassis.spent_ns)
                tick()
            if len(spent_ns) == steps:
                return ControlFigures(OBSTACLES, Durations.of(spent_ns))
    raise RuntimeError(
        f"the emulated base obeyed in {len(spent_ns)} of {steps + _MAX_ARM_STEPS} control steps"
    )


class EmulatedBase(Device, Protocol):
    """The base at the other end of the link."""

    def advance_to(self, now_ns: int) -> None:
        """Simulate up to now_ns: take commands, move, answer."""
        ...


def measure_exchange(
    chassis: TimedChassis,
    emulator: EmulatedBase,
    exchanges: int,
    tick: Tick,
    wait_for_link: Callable[[], None] = lambda: None,
) -> Durations:
    """Time exchanges with an armed base that drives a bend at 0.5 m/s, without the emulator's own work.

    wait_for_link: waits until what was written at one end of the link has arrived at the other.
    Raises RuntimeError if the emulated base does not arm, which is a bug in the program.
    """
    spent_ns: list[int] = []
    with emulator, chassis:
        chassis.arm(0)
        for index in range(exchanges + _MAX_ARM_STEPS):
            now_ns = index * PERIOD_NS
            wait_for_link()
            emulator.advance_to(now_ns)
            wait_for_link()
            # Accelerates at 0.25 m/s^2, because the output guard does not let a jump in speed pass.
            v_mps = min(0.005 * len(spent_ns), 0.5)
            setpoint = Setpoint(now_ns, v_mps, 0.0, 0.4 * v_mps)
            state = chassis.exchange(setpoint, now_ns)
            if state.mode is ChassisMode.ARMED:
                spent_ns.append(chassis.spent_ns)
                tick()
            if len(spent_ns) == exchanges:
                return Durations.of(spent_ns)
    raise RuntimeError(
        f"the emulated base obeyed in {len(spent_ns)} of {exchanges + _MAX_ARM_STEPS} exchanges"
    )
