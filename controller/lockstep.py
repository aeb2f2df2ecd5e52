"""The lock-step runner: one thread, simulated time, the same bytes in every run.

At each time the order is the same: the outside advances, then the camera exposes, then the control steps. The
control gets a scene perception_latency_s after its exposure, or later, as on a robot.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

from config.app import LockstepRunner
from controller.control import ControlStep, Drive
from controller.perceive import Look
from hal.api import Clock
from hal.clocks import NS_PER_S
from hal.types import RgbdFrame
from vision.scene import Scene


class Outside(Protocol):
    """What advances by itself while the program runs: the simulated world and base."""

    def advance_to(self, now_ns: int) -> None: ...


class ScheduledCamera(Protocol):
    """A frame source that tells when it exposes next."""

    @property
    def next_capture_ns(self) -> int: ...

    def read(self, timeout_s: float) -> RgbdFrame: ...


class Looking(Protocol):
    """What turns a frame into a scene; controller.perceive.Perceiver is the real one."""

    def look(self, frame: RgbdFrame) -> Look: ...


@dataclass(frozen=True, slots=True)
class Moment:
    """One control step, with the frames that were looked at since the step before."""

    looks: tuple[Look, ...]
    control: ControlStep


def run_lockstep(
    runner: LockstepRunner,
    clock: Clock,
    outside: Outside,
    camera: ScheduledCamera,
    perceiver: Looking,
    loop: Drive,
    late_by: Callable[[float], float] = lambda _: 0.0,
) -> Iterator[Moment]:
    """Step until the loop has finished or max_duration_s is over; yields after each control step.

    late_by: for the exposure time of a scene, in seconds, by how many seconds it is late in addition to
    perception_latency_s. Scenes do not overtake each other.
    """
    period_ns = round(NS_PER_S / runner.control_rate_hz)
    latency_ns = round(runner.perception_latency_s * NS_PER_S)
    control_ns = clock.now_ns()
    give_up_ns = control_ns + round(runner.max_duration_s * NS_PER_S)
    on_its_way: deque[tuple[int, Scene]] = deque()
    known: Scene | None = None
    looks: list[Look] = []
    while not loop.finished and control_ns < give_up_ns:
        if camera.next_capture_ns <= control_ns:
            clock.sleep_until_ns(camera.next_capture_ns)
            outside.advance_to(camera.next_capture_ns)
            looks.append(perceiver.look(camera.read(timeout_s=0.0)))
            scene = looks[-1].scene
            late_ns = round(late_by(scene.captured_ns / NS_PER_S) * NS_PER_S)
            on_its_way.append((scene.captured_ns + latency_ns + late_ns, scene))
            continue
        clock.sleep_until_ns(control_ns)
        outside.advance_to(control_ns)
        while on_its_way and on_its_way[0][0] <= control_ns:
            known = on_its_way.popleft()[1]
        yield Moment(tuple(looks), loop.step(known, control_ns))
        looks.clear()
        control_ns += period_ns
