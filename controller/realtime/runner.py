"""The real-time runner: this process decides and drives on absolute deadlines, another one looks.

The perception process (controller/realtime/perception_process.py) sends scenes; whether it stalls, crashes or
is frozen, this loop goes on at its rate, the scene ages, and the decision ends in a jerk-limited stop.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Protocol

from config.app import RealtimeRunner
from controller.control import ControlStep, Drive
from controller.ending import Outcome
from controller.lockstep import Outside
from controller.realtime.channel import Channel, PeerGone
from controller.realtime.service import ServiceManager, StopRequest
from controller.record.tally import MOST_SAMPLES
from hal.api import Clock
from hal.clocks import NS_PER_S
from hal.types import PlanarPose
from vision.scene import Scene


@dataclass(frozen=True, slots=True, eq=False)
class SceneMessage:
    """Perception to control: what was seen, and how long seeing took."""

    scene: Scene
    timing_ms: dict[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class StepMessage:
    """Control to perception: a step, and where the robot of a simulated world truly was at its time, which a
    simulated camera sees from; None where no world knows it."""

    control: ControlStep
    true_pose: PlanarPose | None


@dataclass(frozen=True, slots=True)
class Farewell:
    """Perception to control: the last message before it ends, and why it ends."""

    reason: str


@dataclass
class Punctuality:
    """How late the control steps began, in nanoseconds, and when each of their commands had gone out: of the
    last MOST_SAMPLES, since a robot may be governed for days. steps began, skipped periods had none."""

    late_ns: deque[int] = field(default_factory=lambda: deque(maxlen=MOST_SAMPLES))
    commanded_ns: deque[int] = field(default_factory=lambda: deque(maxlen=MOST_SAMPLES))
    steps: int = 0
    skipped: int = 0


class SimulatedWorld(Outside, Protocol):
    """What a simulated robot moves in."""

    @property
    def body_pose(self) -> PlanarPose: ...


class PerceptionLink:
    """The newest scene of the perception process. Once it is gone it stays gone: lost_reason says why, and
    refused_reason, too, if it took its leave before it had seen anything."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self.newest: SceneMessage | None = None
        self.lost_reason: str | None = None
        self.refused_reason: str | None = None

    def receive(self) -> list[SceneMessage]:
        """All scenes that have arrived since the last call, oldest first."""
        arrived: list[SceneMessage] = []
        if self.lost_reason is not None:
            return arrived
        try:
            while self.lost_reason is None and (message := self._channel.receive()) is not None:
                if isinstance(message, SceneMessage):
                    arrived.append(message)
                else:
                    assert isinstance(message, Farewell), f"perception sent {type(message).__name__}"
                    self.lost_reason = message.reason
                    if self.newest is None and not arrived:
                        self.refused_reason = message.reason
        except PeerGone as gone:
            self.lost_reason = str(gone)
        if arrived:
            self.newest = arrived[-1]
        return arrived

    def send(self, message: StepMessage) -> None:
        """Tell perception where the robot is and what was decided; a full buffer drops the message."""
        if self.lost_reason is not None:
            return
        try:
            self._channel.send(message)
        except PeerGone as gone:
            self.lost_reason = str(gone)


@dataclass(frozen=True, slots=True)
class RealtimeMoment:
    """One control step and the scenes that arrived before it."""

    arrived: tuple[SceneMessage, ...]
    control: ControlStep


def run_realtime(
    config: RealtimeRunner,
    clock: Clock,
    outside: SimulatedWorld | None,
    perception: PerceptionLink,
    loop: Drive,
    service: ServiceManager,
    stop: StopRequest,
    punctuality: Punctuality,
) -> Iterator[RealtimeMoment]:
    """Step at the control rate until the loop has finished; yields after each step.

    An overrun skips periods and keeps the phase, so that late commands are not sent in a burst: a step that
    would begin more than half a period late is left out.
    """
    period_ns = round(NS_PER_S / config.control_rate_hz)
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
        elif config.max_duration_s is not None and now_ns - started_ns > config.max_duration_s * NS_PER_S:
            loop.request_stop(f"max_duration_s of {config.max_duration_s:g} s is over", Outcome.BROKEN_OFF)
        if outside is not None:
            outside.advance_to(now_ns)
        step = loop.step(None if perception.newest is None else perception.newest.scene, now_ns)
        if step.chassis.sent is not None:
            punctuality.commanded_ns.append(clock.now_ns())
        perception.send(StepMessage(step, None if outside is None else outside.body_pose))
        service.feed_watchdog(now_ns)
        yield RealtimeMoment(tuple(arrived), step)
        deadline_ns += period_ns
        missed = (clock.now_ns() - deadline_ns + period_ns // 2) // period_ns
        if missed > 0:
            punctuality.skipped += missed
            deadline_ns += missed * period_ns
