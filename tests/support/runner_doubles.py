"""Test doubles of what the runners step; they record what they are given."""

from __future__ import annotations

import numpy as np

from controller.base.drive_lifecycle import Outcome
from controller.control import ControlStep
from controller.decision.decision import Action, Decision, Reason
from controller.perceive import Look
from hal.types import RgbdFrame, Setpoint
from tests.support.scenes import ORIGIN, chassis_state, scene
from tests.support.video_moments import fragments, frame
from vision.scene import Scene

NO_FRAGMENTS = fragments(np.zeros((0, 2, 2)), [], [])
KEEP = Decision(Action.KEEP, 0.5, Reason("free", "the way is free"))


def control_step(now_ns: int, scene_ns: int | None, decision: Decision = KEEP) -> ControlStep:
    """A step of a robot that stands at the start."""
    setpoint = Setpoint(now_ns, 0.0, 0.0, 0.0)
    return ControlStep(now_ns, ORIGIN, 0.0, 0.0, scene_ns, decision, setpoint, chassis_state(now_ns))


class RecordingDrive:
    """Finishes after a number of steps, or one step after it was asked to stop."""

    def __init__(self, steps: int) -> None:
        self._steps_left = steps
        self.seen: list[tuple[int, int | None]] = []
        self.stop_reasons: list[str] = []
        self.endings: list[Outcome] = []

    @property
    def finished(self) -> bool:
        """No steps left."""
        return self._steps_left <= 0

    def request_stop(self, reason: str, outcome: Outcome = Outcome.STOPPED) -> None:
        """Note the reason; one more step."""
        self.endings.append(outcome)
        self.stop_reasons.append(reason)
        self._steps_left = min(self._steps_left, 1)

    def step(self, seen: Scene | None, now_ns: int) -> ControlStep:
        """Note which scene was known when."""
        self._steps_left -= 1
        sequence = None if seen is None else seen.sequence
        self.seen.append((now_ns, sequence))
        return control_step(now_ns, None if seen is None else seen.captured_ns)


class PeriodicCamera:
    """Exposes every period_ns from 0 on."""

    def __init__(self, period_ns: int) -> None:
        self._period_ns = period_ns
        self._count = 0

    @property
    def next_capture_ns(self) -> int:
        """When the next frame is due."""
        return self._count * self._period_ns

    def read(self, timeout_s: float) -> RgbdFrame:
        """The frame that is due now."""
        taken = frame(self._count, self.next_capture_ns)
        self._count += 1
        return taken


class EmptyScenePerceiver:
    """Sees an empty scene in every frame."""

    def look(self, taken: RgbdFrame) -> Look:
        """An empty scene at the frame's time."""
        return Look(
            taken, scene(taken.captured_ns, taken.sequence), NO_FRAGMENTS, {"detect": 1.0, "track": 0.5}
        )


class RecordingOutside:
    """Notes how far it was moved on."""

    def __init__(self) -> None:
        self.times_ns: list[int] = []

    def advance_to(self, now_ns: int) -> None:
        """Note the time."""
        self.times_ns.append(now_ns)
