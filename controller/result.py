"""What a drive was asked to do and how it went."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path as FilePath

from controller.control import ControlLoop, ControlStep
from controller.ending import Outcome
from controller.realtime.runner import Punctuality, SceneMessage
from controller.record.tally import (
    Complaints,
    FrameTally,
    SetpointTally,
    ShaperFaults,
    Standstill,
    TimingTally,
)
from hal.clocks import NS_PER_S
from sim.simulation import Simulation


@dataclass(frozen=True, slots=True)
class MissionOptions:
    """The command line of `treadwatch run`."""

    config_path: FilePath
    scenario: str | None = None
    seed: int | None = None
    observations: FilePath | None = None
    video: FilePath | None = None
    record: FilePath | None = None
    quiet: bool = False


@dataclass(kw_only=True)
class DriveResult:
    """What every drive adds up to, along a path or with another planner ahead. punctuality: in real time."""

    setpoints: SetpointTally
    timing: TimingTally = field(default_factory=TimingTally)
    simulation: Simulation | None = None
    punctuality: Punctuality | None = None
    first: ControlStep | None = None
    last: ControlStep | None = None
    standstill: Standstill = field(default_factory=Standstill)
    shaper_faults: ShaperFaults = field(default_factory=ShaperFaults)
    complaints: Complaints = field(default_factory=Complaints)
    frames: FrameTally = field(default_factory=FrameTally)

    @property
    def duration_s(self) -> float:
        """From the first control step to the last."""
        return 0.0 if self.last is None else self.seconds(self.last)

    @property
    def contacts(self) -> list[str]:
        """What was touched, in a simulation."""
        return [] if self.simulation is None else self.simulation.referee.contacts

    @property
    def clean(self) -> bool:
        """Nothing touched, limits kept."""
        return not self.contacts and self.setpoints.violations == 0

    def seconds(self, step: ControlStep) -> float:
        """From the first control step to this one."""
        return 0.0 if self.first is None else (step.now_ns - self.first.now_ns) / NS_PER_S

    def take(self, step: ControlStep) -> None:
        """Account for one control step."""
        self.first = self.first or step
        self.last = step
        self.setpoints.add(step.chassis.sent, step.chassis.mode)
        self.standstill.add(step.setpoint)
        self.shaper_faults.add(step.fault)

    def take_message(self, message: SceneMessage) -> None:
        """Account for what the perception process has said of one frame."""
        self.timing.add(message.timing_ms)
        self.frames.add(message.scene.sequence)


@dataclass(kw_only=True)
class MissionResult(DriveResult):
    """Of a drive along a path. wall_s: how long it took on this machine, in lock-step."""

    loop: ControlLoop
    wall_s: float = math.nan

    @property
    def succeeded(self) -> bool:
        """Reached or stopped as asked, nothing touched, limits kept."""
        return self.loop.ending.outcome in (Outcome.REACHED, Outcome.STOPPED) and self.clean
