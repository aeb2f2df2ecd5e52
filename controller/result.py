"""What a drive was asked to do and how it went."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path as FilePath

from controller.control import ControlLoop, ControlStep
from controller.ending import Outcome
from controller.realtime.runner import Punctuality
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


@dataclass
class MissionResult:
    """What the summary is made of."""

    loop: ControlLoop
    setpoints: SetpointTally
    timing: TimingTally
    last: ControlStep | None = None
    started_ns: int = 0
    wall_s: float = math.nan
    simulation: Simulation | None = None
    punctuality: Punctuality | None = None
    standstill: Standstill = field(default_factory=Standstill)
    shaper_faults: ShaperFaults = field(default_factory=ShaperFaults)
    complaints: Complaints = field(default_factory=Complaints)
    frames: FrameTally = field(default_factory=FrameTally)

    @property
    def duration_s(self) -> float:
        """From the first control step to the last."""
        return 0.0 if self.last is None else (self.last.now_ns - self.started_ns) / NS_PER_S

    @property
    def contacts(self) -> list[str]:
        """What was touched, in a simulation."""
        return [] if self.simulation is None else self.simulation.referee.contacts

    @property
    def succeeded(self) -> bool:
        """Reached or stopped as asked, nothing touched, limits kept."""
        return (
            self.loop.ending.outcome in (Outcome.REACHED, Outcome.STOPPED)
            and not self.contacts
            and self.setpoints.violations == 0
        )

    def take(self, step: ControlStep) -> None:
        """Account for one control step."""
        if self.last is None:
            self.started_ns = step.now_ns
        self.last = step
        self.setpoints.add(step.chassis.sent, step.chassis.mode)
        self.standstill.add(step.setpoint)
        self.shaper_faults.add(step.fault)
