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
from controller.realtime.channel import Channel, PeerGone
from controller.realtime.service import ServiceManager, StopRequest
from controller.record.tally import MAX_SAMPLES
from hal.api import Clock
from hal.clocks import NS_PER_S
from hal.types import PlanarPose
from vision.scene import Scene

# Reason of the farewell at the end of a recording that stands in for the camera.
STREAM_ENDED = "the camera's stream has ended"


@dataclass(frozen=True, slots=True, eq=False)
class SceneMessage:
    """Perception to control: a scene, and the processing time of its stages."""

    scene: Scene
    timing_ms: dict[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class StepMessage:
    """Control to perception: a control step.

    true_pose: the robot's true pose in a simulated world, for a simulated camera; None without a world.
    """

    control: ControlStep
    true_pose: PlanarPose | None


@dataclass(frozen=True, slots=True)
class Farewell:
    """Perception to control: the last message before the process ends, with the reason."""

    reason: str


@dataclass(frozen=True, slots=True)
class CutOff:
    """Perception to control: an output of the drive has ended, with the reason. Perception goes on."""

    reason: str


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


class PerceptionLink:
    """The control process's link to the perception process. Once lost, it stays lost.

    newest: the newest scene.
    lost_reason: why the link is lost; None if it is not.
    refused_reason: the same, if perception said farewell before its first scene.
    cut_off: why outputs of the drive (observations, video, recording) are not whole.
    """

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self.cut_off: list[str] = []
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
                elif isinstance(message, CutOff):
                    self.cut_off.append(message.reason)
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
        """Send the control step to perception; the message is dropped if the buffer is full."""
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

    After an overrun, periods are skipped and the phase is kept, so that late commands are not sent in a
    burst. A step that would begin half a period late or more is left out.
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
