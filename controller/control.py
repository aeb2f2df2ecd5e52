"""One control step: chassis state and scene in, decision, shaped setpoint out. Both runners step it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol

from controller.decision import Decision
from controller.follow import PathFollower
from controller.localise import Localiser
from controller.path import OnPath, Path
from controller.shape import SpeedShaper
from hal.api import Chassis
from hal.clocks import NS_PER_S
from hal.types import ChassisMode, ChassisState, FloatArray, PlanarPose, Setpoint
from vision.scene import Scene

# At rest within this of the path's end counts as arrived, after the chassis has come to rest too.
ARRIVED_M = 0.05
SETTLE_S = 0.5
# A base that does not arm within this will not: say so instead of waiting for ever.
ARM_TIMEOUT_S = 5.0

_LATCHED = (ChassisMode.ESTOP, ChassisMode.LOST)


class Outcome(Enum):
    """How a drive ended."""

    REACHED = "target reached"
    STOPPED = "stopped on request"
    BROKEN_OFF = "broken off"
    CHASSIS_FAULT = "the chassis stopped the drive"
    NOT_ARMED = "the chassis did not arm"


@dataclass(frozen=True, slots=True)
class ControlStep:
    """What one step knew, decided and sent.

    pose: the body in the path's frame; progress_m along the path, lateral_m to its left.
    scene_sequence: which frame the decision used, None if there was none yet. ahead_m: (N, 2) the way ahead
    in the body frame, where it is not the path that the runner knows.
    """

    now_ns: int
    pose: PlanarPose
    progress_m: float
    lateral_m: float
    scene_sequence: int | None
    decision: Decision
    setpoint: Setpoint
    chassis: ChassisState
    ahead_m: FloatArray | None = field(default=None, compare=False)


class Drive(Protocol):
    """What a runner steps; ControlLoop is the real one."""

    @property
    def finished(self) -> bool: ...

    def request_stop(self, reason: str, ending: Outcome = Outcome.STOPPED) -> None: ...

    def step(self, scene: Scene | None, now_ns: int) -> ControlStep: ...


class Decides(Protocol):
    """What a drive is decided by; DecisionMaker is ours, a campaign compares it with others."""

    def step(
        self,
        scene: Scene | None,
        path: Path,
        pose: PlanarPose,
        on_path: OnPath,
        v_mps: float,
        a_mps2: float,
        now_ns: int,
    ) -> Decision: ...


class ControlLoop:
    """Owns the order of things within a control period; every part in it is stepped, none runs by itself."""

    def __init__(
        self,
        path: Path,
        decide: Decides,
        shape: SpeedShaper,
        follow: PathFollower,
        localiser: Localiser,
        chassis: Chassis,
    ) -> None:
        self.path = path
        self.localiser = localiser
        self._decide = decide
        self._shape = shape
        self._follow = follow
        self._chassis = chassis
        self._state: ChassisState | None = None
        self._progress_m = 0.0
        self._scene_ns: int | None = None
        self._started_ns: int | None = None
        self._resting_since_ns: int | None = None
        self._was_armed = False
        self.stop_reason: str | None = None
        self._ending = Outcome.STOPPED
        self.outcome: Outcome | None = None

    @property
    def finished(self) -> bool:
        """The drive has ended, one way or the other; the chassis has been told to stop."""
        return self.outcome is not None

    def request_stop(self, reason: str, ending: Outcome = Outcome.STOPPED) -> None:
        """Come to rest by the comfort profile, then end with this outcome. The first reason stays."""
        if self.stop_reason is None:
            self.stop_reason = reason
            self._ending = ending

    def step(self, scene: Scene | None, now_ns: int) -> ControlStep:
        """Decide on what is known, shape, send, and take in what the chassis answers."""
        if self._started_ns is None:
            self._started_ns = now_ns
            self._chassis.arm(now_ns)
        self._learn(scene)
        pose = self.localiser.pose
        on_path = self.path.project(pose, self._progress_m)
        self._progress_m = on_path.s_m
        decision = self._decide.step(
            scene, self.path, pose, on_path, self._speed_mps(), self._shape.a_mps2, now_ns
        )
        setpoint = self._setpoint(decision, on_path, now_ns)
        self._state = self._chassis.exchange(setpoint, now_ns)
        self.localiser.add_odometry(now_ns, self._state.pose)
        self._conclude(self._state, setpoint, now_ns)
        sequence = None if scene is None else scene.sequence
        return ControlStep(now_ns, pose, on_path.s_m, on_path.d_m, sequence, decision, setpoint, self._state)

    def _learn(self, scene: Scene | None) -> None:
        """Each scene's ego-motion corrects the yaw once."""
        if scene is not None and scene.captured_ns != self._scene_ns:
            self._scene_ns = scene.captured_ns
            self.localiser.add_ego_motion(scene.captured_ns, scene.ego_motion)

    def _speed_mps(self) -> float:
        """The greater of commanded and measured: rather brake for speed that is not there than miss some."""
        measured = self._state.v_mps if self._state is not None else math.nan
        return max(self._shape.v_mps, measured) if math.isfinite(measured) else self._shape.v_mps

    def _setpoint(self, decision: Decision, on_path: OnPath, now_ns: int) -> Setpoint:
        if self._state is None or self._state.mode is not ChassisMode.ARMED:
            # What the chassis does now is not ours to shape; whenever it obeys again, begin at rest.
            self._shape.reset()
            return Setpoint(now_ns, 0.0, 0.0, 0.0)
        target_mps = 0.0 if self.stop_reason is not None else decision.target_speed_mps
        shaped = self._shape.step(
            target_mps,
            emergency=decision.emergency,
            distance_to_end_m=self.path.length_m - self._progress_m,
        )
        w_radps = self._follow.step(on_path, shaped.v_mps)
        return Setpoint(now_ns, shaped.v_mps, shaped.a_mps2, w_radps)

    def _conclude(self, state: ChassisState, setpoint: Setpoint, now_ns: int) -> None:
        assert self._started_ns is not None
        if state.mode is ChassisMode.ARMED:
            self._was_armed = True
        elif self._was_armed or state.mode in _LATCHED:
            self._end(Outcome.CHASSIS_FAULT, now_ns, state.reason)
            return
        elif now_ns - self._started_ns > ARM_TIMEOUT_S * NS_PER_S:
            self._end(Outcome.NOT_ARMED, now_ns, state.reason)
            return
        at_rest = setpoint.v_mps == 0.0 and setpoint.a_mps2 == 0.0
        arrived = self.path.length_m - self._progress_m <= ARRIVED_M
        if not at_rest or not (arrived or self.stop_reason is not None):
            self._resting_since_ns = None
            return
        if self._resting_since_ns is None:
            self._resting_since_ns = now_ns
        if now_ns - self._resting_since_ns >= SETTLE_S * NS_PER_S:
            self._end(Outcome.REACHED if arrived else self._ending, now_ns, self.stop_reason)

    def _end(self, outcome: Outcome, now_ns: int, reason: str | None) -> None:
        self.outcome = outcome
        self.stop_reason = self.stop_reason or reason
        self._chassis.stop(now_ns)
