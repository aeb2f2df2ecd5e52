"""The result of a drive: what is added up from step to step."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from controller.base.drive_lifecycle import Outcome
from controller.control import ControlLoop, ControlStep
from controller.realtime.messages import SceneMessage
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


@dataclass(kw_only=True)
class DriveResult:
    """The result of any drive, along a path or behind another planner.

    punctuality: None in lock-step. first, last: the first and last control step so far. cut_off: why outputs
    are not whole.
    """

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
    cut_off: list[str] = field(default_factory=list)

    @property
    def duration_s(self) -> float:
        """Time from the first control step to the last."""
        return 0.0 if self.last is None else self.seconds(self.last)

    @property
    def contacts(self) -> list[str]:
        """What was touched; empty without a simulation."""
        return [] if self.simulation is None else self.simulation.referee.contacts

    @property
    def clean(self) -> bool:
        """Whether nothing was touched, all limits were kept, and all is written that was to be."""
        return not self.contacts and self.setpoints.violations == 0 and not self.cut_off

    def seconds(self, step: ControlStep) -> float:
        """Time from the first control step to this one."""
        return 0.0 if self.first is None else (step.now_ns - self.first.now_ns) / NS_PER_S

    def take(self, step: ControlStep) -> None:
        """Account for one control step."""
        self.first = self.first or step
        self.last = step
        self.setpoints.add(step.chassis.sent, step.chassis.mode, standing=step.unanswered != "")
        self.standstill.add(step.setpoint)
        self.shaper_faults.add(step.fault)
        if step.unanswered:
            self.complaints.add((step.unanswered,))

    def take_message(self, message: SceneMessage) -> None:
        """Account for one frame, as the perception process reports it."""
        self.timing.add(message.timing_ms)
        self.frames.add(message.scene.sequence)


@dataclass(kw_only=True)
class MissionResult(DriveResult):
    """The result of a drive along a path. wall_s: how long a lock-step run took on this machine."""

    loop: ControlLoop
    wall_s: float = math.nan

    @property
    def succeeded(self) -> bool:
        """Whether the robot reached the target or stopped as asked, and the drive was clean."""
        return self.loop.lifecycle.outcome in (Outcome.REACHED, Outcome.STOPPED) and self.clean
