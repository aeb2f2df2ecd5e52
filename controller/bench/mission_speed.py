"""Measures the speed of lock-step simulation: rendering, perception, control and emulated base together."""

from __future__ import annotations

from dataclasses import dataclass

from config.app import AppConfig, LockstepRunner
from controller.bench.figures import Stopwatches
from controller.bench.reel import Tick
from controller.build import (
    build_control,
    build_path,
    build_perceiver,
    build_simulation,
    open_simulated_camera,
)
from controller.build_chassis import build_base
from controller.lockstep import run_lockstep
from hal.clocks import NS_PER_S, SimulatedClock


@dataclass(frozen=True, slots=True)
class LockstepFigures:
    """The first part of a mission.

    simulated_s: its duration in the simulation.
    wall_s, processor_s: the time that this took, by wall clock and in processor time.
    frames: number of camera frames.
    """

    simulated_s: float
    wall_s: float
    processor_s: float
    frames: int

    @property
    def speed(self) -> float:
        """Simulated seconds per second."""
        return self.simulated_s / self.wall_s

    @property
    def speed_on_own_core(self) -> float:
        """Simulated seconds per second of processor time: the speed on an otherwise idle machine."""
        return self.simulated_s / self.processor_s

    def as_json(self) -> dict[str, object]:
        """Plain values."""
        return {
            "simulated_s": round(self.simulated_s, 3),
            "wall_s": round(self.wall_s, 3),
            "processor_s": round(self.processor_s, 3),
            "frames": self.frames,
            "speed": round(self.speed, 4),
            "speed_on_own_core": round(self.speed_on_own_core, 4),
        }


def measure_lockstep(
    config: AppConfig, duration_s: float, stopwatches: Stopwatches, tick: Tick
) -> LockstepFigures:
    """Drive the first duration_s of the mission in config, without recording. Start-up is not counted."""
    clock = SimulatedClock()
    runner = config.runner
    assert isinstance(runner, LockstepRunner), "the bench drives a simulated mission"
    runner = runner.model_copy(update={"max_duration_s": duration_s})
    chassis, emulator = build_base(config, build_path(config).start, clock.now_ns())
    assert emulator is not None, "lock-step is refused by AppConfig without an emulated base"
    simulation = build_simulation(config, emulator, clock.now_ns())
    camera = open_simulated_camera(config, clock, lambda _stamp_ns: simulation.body_pose, clock.now_ns())
    with simulation, chassis, camera:
        loop = build_control(config, chassis)
        perceiver = build_perceiver(config, loop.localiser, loop.localiser.body_pose, stopwatches.elapsed_ns)
        frames = 0
        started_ns, started_cpu_ns = stopwatches.elapsed_ns(), stopwatches.processor_ns()
        for moment in run_lockstep(runner, clock, simulation, camera, perceiver, loop):
            frames += len(moment.looks)
            tick()
        wall_s = (stopwatches.elapsed_ns() - started_ns) / NS_PER_S
        processor_s = (stopwatches.processor_ns() - started_cpu_ns) / NS_PER_S
    return LockstepFigures(clock.now_ns() / NS_PER_S, wall_s, processor_s, frames)
