"""The loop of the real-time runner: decides and drives on absolute deadlines.

The perception process (controller/realtime/perception_process.py) sends scenes. If it stalls, crashes or is
frozen, this loop goes on at its rate, the newest scene ages, and the decision makes a jerk-limited stop.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Protocol

from config.app import RealtimeRunner
from controller.base.drive_lifecycle import Outcome
from controller.control import ControlStep, Drive
from controller.lockstep import Outside
from controller.realtime.messages import SceneMessage, StepMessage
from controller.realtime.perception_link import PerceptionLink
from controller.realtime.service import StopRequest
from controller.record.tally import MAX_SAMPLES
from hal.api import Clock
from hal.clocks import NS_PER_S
from hal.types import PlanarPose


@dataclass
class Punctuality:
    """How punctual the control steps are.

    late_ns: how late each step began.
    commanded_ns: when each command had been sent.
    Both keep the last MAX_SAMPLES only, because a robot may be governed for days.
    steps: number of steps.
    skipped: number of periods without a step.
    """

    late_ns: deque[int] = field(default_factory=lambda: deque(maxlen=MAX_SAMPLES))
    commanded_ns: deque[int] = field(default_factory=lambda: deque(maxlen=MAX_SAMPLES))
    steps: int = 0
    skipped: int = 0


class SimulatedWorld(Outside, Protocol):
    """The world of a simulated robot. body_pose: the robot's true pose."""

    @property
    def body_pose(self) -> PlanarPose: ...


@dataclass(frozen=True, slots=True)
class RealtimeMoment:
    """One control step and the scenes that arrived before it."""

    arrived: tuple[SceneMessage, ...]
    control: ControlStep


def run_realtime(
    runner: RealtimeRunner,
    clock: Clock,
    outside: SimulatedWorld | None,
    perception: PerceptionLink,
    loop: Drive,
    stop: StopRequest,
    punctuality: Punctuality,
) -> Iterator[RealtimeMoment]:
    """Step at the control rate until the loop has finished; yields after each step.

    After an overrun, periods are skipped and the phase is kept, so that late commands are not sent in a
    burst. A step that would begin half a period late or more is left out.
    """
    period_ns = round(NS_PER_S / runner.control_rate_hz)
    started_ns = deadline_ns = clock.now_ns()
    while not loop.finished:
        clock.sleep_until_ns(deadline_ns)
        now_ns = clock.now_ns()
        punctuality.steps += 1
        punctuality.late_ns.append(now_ns - deadline_ns)
        arrived = perception.receive()
        if stop:
            loop.request_stop(f"{stop.reason} received")
        elif perception.lost_reason is not None:
            loop.request_stop(f"perception is lost: {perception.lost_reason}", Outcome.BROKEN_OFF)
        elif runner.max_duration_s is not None and now_ns - started_ns > runner.max_duration_s * NS_PER_S:
            loop.request_stop(f"max_duration_s of {runner.max_duration_s:g} s is over", Outcome.BROKEN_OFF)
        if outside is not None:
            outside.advance_to(now_ns)
        step = loop.step(None if perception.newest is None else perception.newest.scene, now_ns)
        if step.chassis.sent is not None:
            punctuality.commanded_ns.append(clock.now_ns())
        perception.send(StepMessage(step, None if outside is None else outside.body_pose))
        yield RealtimeMoment(tuple(arrived), step)
        deadline_ns += period_ns
        missed = (clock.now_ns() - deadline_ns + period_ns // 2) // period_ns
        if missed > 0:
            punctuality.skipped += missed
            deadline_ns += missed * period_ns
