"""The compared methods: each answers simulated frames and is timed while it does so."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from config.perception import PerceptionConfig
from config.robot import Body
from controller.evaluation.methods.baselines.background_model import BackgroundModel
from controller.evaluation.methods.baselines.box_tracking import BoxTracking
from controller.evaluation.methods.baselines.dense_flow import DenseFlow
from controller.evaluation.methods.baselines.low_rank import LowRank
from controller.evaluation.methods.baselines.trajectories import Trajectories
from controller.evaluation.methods.lidar_baseline import LidarTracker
from controller.evaluation.methods.lidar_scan import Lidar, LidarModel
from controller.evaluation.methods.ours import Treadwatch
from controller.evaluation.simulated_set.eligibility import Eligibility, judge_eligibility
from controller.evaluation.simulated_set.scripted_drive import MOUNT, ScriptedDrive
from controller.evaluation.simulated_set.sequences import Sequence
from controller.evaluation.simulated_set.simulate import SimulatedFrame
from controller.evaluation.types import Method, MethodOutput
from hal.clocks import NS_PER_MS
from hal.types import Intrinsics

Stopwatch = Callable[[], int]

# Names of the methods.
OURS = "treadwatch"
OURS_ALONE = "treadwatch, no odometry"
LIDAR = "lidar"
BACKGROUND = "background modelling"
TRAJECTORIES = "trajectory classification"
TRACKING = "object tracking"
LOW_RANK = "low rank and sparse"
DENSE_FLOW = "dense flow minus rigid flow"

# ALWAYS runs on every sequence, BASELINES on some unless asked for (controller/evaluation/run_set.py).
ALWAYS = (OURS, OURS_ALONE, LIDAR)
BASELINES = (BACKGROUND, TRAJECTORIES, TRACKING, LOW_RANK, DENSE_FLOW)


class TimedMethod(Protocol):
    """Answers the frames of one sequence in order."""

    def answer(self, simulated: SimulatedFrame) -> tuple[MethodOutput, float]:
        """The answer, and its processing time in milliseconds; NaN if there was nothing to process."""
        ...


@dataclass(frozen=True, slots=True)
class CameraMethod:
    """A method that processes the camera's frames."""

    method: Method
    with_odometry: bool
    stopwatch_ns: Stopwatch

    def answer(self, simulated: SimulatedFrame) -> tuple[MethodOutput, float]:
        start_ns = self.stopwatch_ns()
        answer = self.method.observe(simulated.frame, simulated.odometry if self.with_odometry else None)
        return answer, (self.stopwatch_ns() - start_ns) / NS_PER_MS


class TrackingMethod:
    """Object tracking. It is given the true box of each object once, when the object becomes eligible."""

    def __init__(self, stopwatch_ns: Stopwatch) -> None:
        self._tracking = BoxTracking()
        self._stopwatch_ns = stopwatch_ns
        self._initialised: set[int] = set()

    def answer(self, simulated: SimulatedFrame) -> tuple[MethodOutput, float]:
        for identity, verdict in judge_eligibility([simulated.truth])[0].items():
            if verdict.eligibility is Eligibility.ELIGIBLE and identity not in self._initialised:
                self._initialised.add(identity)
                self._tracking.add_object(
                    identity, next(o.box for o in simulated.truth.objects if o.id == identity)
                )
        start_ns = self._stopwatch_ns()
        answer = self._tracking.observe(simulated.frame, None)
        duration_ms = (self._stopwatch_ns() - start_ns) / NS_PER_MS
        return answer, duration_ms if answer.detections else math.nan


class LidarMethod:
    """Scans the same world at the lidar's own rate; only clustering and tracking are timed."""

    def __init__(
        self, sequence: Sequence, drive: ScriptedDrive, intrinsics: Intrinsics, stopwatch_ns: Stopwatch
    ) -> None:
        self._model = LidarModel()
        self._lidar = Lidar(self._model, sequence.scenario().room, sequence.seed)
        self._tracker = LidarTracker(self._model, MOUNT, intrinsics)
        self._drive = drive
        self._stopwatch_ns = stopwatch_ns
        self._next_scan = 0

    def answer(self, simulated: SimulatedFrame) -> tuple[MethodOutput, float]:
        now_s = simulated.truth.stamp_s
        odometry = self._drive.odometry(now_s)
        scan = None
        if now_s >= self._next_scan / self._model.rate_hz - 1e-6:
            self._next_scan += 1
            scan = self._lidar.scan(now_s, self._drive.pose(now_s), simulated.bodies)
        start_ns = self._stopwatch_ns()
        if scan is not None:
            self._tracker.update(scan, odometry)
        answer = self._tracker.answer(now_s, odometry)
        duration_ms = (self._stopwatch_ns() - start_ns) / NS_PER_MS
        return answer, duration_ms if scan is not None else math.nan


def build_methods(
    names: tuple[str, ...], sequence: Sequence, intrinsics: Intrinsics, stopwatch_ns: Stopwatch
) -> dict[str, TimedMethod]:
    """The named methods, newly made for one sequence."""
    makers: dict[str, Callable[[], TimedMethod]] = {
        OURS: lambda: CameraMethod(ours(), True, stopwatch_ns),
        OURS_ALONE: lambda: CameraMethod(ours(), False, stopwatch_ns),
        LIDAR: lambda: LidarMethod(sequence, sequence.drive(), intrinsics, stopwatch_ns),
        BACKGROUND: lambda: CameraMethod(BackgroundModel(), False, stopwatch_ns),
        TRAJECTORIES: lambda: CameraMethod(Trajectories(), False, stopwatch_ns),
        TRACKING: lambda: TrackingMethod(stopwatch_ns),
        LOW_RANK: lambda: CameraMethod(LowRank(), False, stopwatch_ns),
        DENSE_FLOW: lambda: CameraMethod(DenseFlow(), False, stopwatch_ns),
    }
    return {name: makers[name]() for name in names}


def ours() -> Treadwatch:
    """Our detector with its default settings, on the simulated robot."""
    return Treadwatch(PerceptionConfig(), MOUNT, Body())
