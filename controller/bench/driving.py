"""The driving side: the control step among ten obstacles, and the exchange of each chassis driver."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from controller.bench.busy_scene import OBSTACLES, busy_scene
from controller.bench.figures import Durations
from controller.bench.reel import Tick
from controller.control import ControlLoop
from hal.api import Chassis, Closing
from hal.clocks import NS_PER_S
from hal.enclosing import Enclosing
from hal.types import ChassisMode, ChassisState, Setpoint
from sim.simulation import Emulator

PERIOD_NS = NS_PER_S // 50
_FRAME_NS = NS_PER_S // 30
_LATENCY_NS = NS_PER_S * 60 // 1000
# No base takes longer to obey; a bench that waited on would wait for ever.
_ARM_STEPS = 250


class TimedChassis(Enclosing):
    """A chassis with a stopwatch on its exchange: spent_ns of the last one."""

    def __init__(self, chassis: Chassis, stopwatch_ns: Callable[[], int]) -> None:
        super().__init__(chassis)
        self._chassis = chassis
        self._stopwatch_ns = stopwatch_ns
        self.spent_ns = 0

    def exchange(self, setpoint: Setpoint | None, now_ns: int) -> ChassisState:
        """See hal.api.Chassis."""
        started_ns = self._stopwatch_ns()
        state = self._chassis.exchange(setpoint, now_ns)
        self.spent_ns = self._stopwatch_ns() - started_ns
        return state

    def arm(self, now_ns: int) -> None:
        """See hal.api.Chassis."""
        self._chassis.arm(now_ns)

    def stop(self, now_ns: int) -> None:
        """See hal.api.Chassis."""
        self._chassis.stop(now_ns)


@dataclass(frozen=True, slots=True)
class ControlFigures:
    """step: one control step without the driver's exchange (localise, decide, shape, follow)."""

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
    """Armed steps of loop, which must drive chassis; scenes come at 30 Hz, 60 ms after their exposure.

    Raises RuntimeError if the emulated base does not obey: that is a fault of the program.
    """
    spent_ns: list[int] = []
    with emulator, chassis:
        for index in range(steps + _ARM_STEPS):
            now_ns = index * PERIOD_NS
            emulator.advance_to(now_ns)
            sequence = max(now_ns - _LATENCY_NS, 0) // _FRAME_NS
            captured_ns = sequence * _FRAME_NS
            scene = busy_scene(captured_ns, sequence, loop.localiser.body_pose(captured_ns))
            started_ns = stopwatch_ns()
            done = loop.step(scene, now_ns)
            step_ns = stopwatch_ns() - started_ns
            if done.chassis.mode is ChassisMode.ARMED:
                spent_ns.append(step_ns - chassis.spent_ns)
                tick()
            if len(spent_ns) == steps:
                return ControlFigures(OBSTACLES, Durations.of(spent_ns))
    raise RuntimeError(f"the emulated base obeyed in {len(spent_ns)} of {steps + _ARM_STEPS} control steps")


class Answering(Closing, Protocol):
    """What stands at the other end of the link."""

    def advance_to(self, now_ns: int) -> None:
        """Obey, move and answer up to now_ns."""
        ...


def measure_exchange(
    chassis: TimedChassis,
    emulator: Answering,
    exchanges: int,
    tick: Tick,
    carry: Callable[[], None] = lambda: None,
) -> Durations:
    """Exchanges with an armed base that drives a bend at 0.5 m/s; the emulator's own work is not counted.

    carry: waits until what was written at one end of the wire has arrived at the other.

    Raises RuntimeError if the emulated base does not obey: that is a fault of the program.
    """
    spent_ns: list[int] = []
    with emulator, chassis:
        chassis.arm(0)
        for index in range(exchanges + _ARM_STEPS):
            now_ns = index * PERIOD_NS
            carry()
            emulator.advance_to(now_ns)
            carry()
            # A quarter of a m/s2: the output guard lets no jump pass.
            v_mps = min(0.005 * len(spent_ns), 0.5)
            setpoint = Setpoint(now_ns, v_mps, 0.0, 0.4 * v_mps)
            state = chassis.exchange(setpoint, now_ns)
            if state.mode is ChassisMode.ARMED:
                spent_ns.append(chassis.spent_ns)
                tick()
            if len(spent_ns) == exchanges:
                return Durations.of(spent_ns)
    raise RuntimeError(f"the emulated base obeyed in {len(spent_ns)} of {exchanges + _ARM_STEPS} exchanges")
