"""One control step: chassis state and scene in, decision, shaped setpoint out. Both runners step it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol

from controller.answer import BaseAnswer
from controller.decision.decision import Decision
from controller.decision.limits import speed_to_decide_by
from controller.decision.situation import Situation
from controller.ending import Ending, Outcome
from controller.follow import PathFollower
from controller.localise import Localiser
from controller.path.path import OnPath, Path
from controller.shape import SpeedShaper
from hal.api import Chassis
from hal.types import ChassisMode, ChassisState, FloatArray, PlanarPose, Setpoint
from vision.scene import Scene

# At rest within this of the path's end counts as arrived.
ARRIVED_M = 0.05
# Further past it, the target was missed.
PASSED_M = 0.10


@dataclass(frozen=True, slots=True)
class ControlStep:
    """What one step knew, decided and sent.

    pose: the body in the path's frame; progress_m along the path, lateral_m to its left.
    scene_ns: when the frame was taken that the decision used, None if there was none yet. ahead_m: (N, 2) the
    way ahead in the body frame, where it is not the path that the runner knows. fault: why the shaper had to
    brake by the stop profile, "" if it had not. unanswered: why the base was told zero at once instead of the
    profile, "" if it was not.
    """

    now_ns: int
    pose: PlanarPose
    progress_m: float
    lateral_m: float
    scene_ns: int | None
    decision: Decision
    setpoint: Setpoint
    chassis: ChassisState
    ahead_m: FloatArray | None = field(default=None, compare=False)
    fault: str = ""
    unanswered: str = ""


class Drive(Protocol):
    """What a runner steps; ControlLoop is the real one."""

    @property
    def finished(self) -> bool: ...

    def request_stop(self, reason: str, outcome: Outcome = Outcome.STOPPED) -> None: ...

    def step(self, scene: Scene | None, now_ns: int) -> ControlStep: ...


class Decides(Protocol):
    """What a drive is decided by; DecisionMaker is ours, a campaign compares it with others."""

    def step(self, at: Situation) -> Decision: ...


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
        answer: BaseAnswer,
    ) -> None:
        self.path = path
        self.localiser = localiser
        self._decide = decide
        self._shape = shape
        self._follow = follow
        self._chassis = chassis
        self._answer = answer
        self.ending = Ending(chassis)
        self._state: ChassisState | None = None
        self._progress_m = 0.0
        self._scene_ns: int | None = None

    @property
    def finished(self) -> bool:
        """The drive has ended, one way or the other; the chassis has been told to stop."""
        return self.ending.outcome is not None

    def request_stop(self, reason: str, outcome: Outcome = Outcome.STOPPED) -> None:
        """Come to rest by the comfort profile, then end with this outcome. The first reason stays."""
        self.ending.request_stop(reason, outcome)

    def step(self, scene: Scene | None, now_ns: int) -> ControlStep:
        """Decide on what is known, shape, send, and take in what the chassis answers."""
        self.ending.begin(now_ns)
        self._learn(scene)
        pose = self.localiser.pose
        on_path = self.path.project(pose, self._progress_m)
        if math.isfinite(on_path.s_m):
            self._progress_m = on_path.s_m
        measured_mps = math.nan if self._state is None else self._state.v_mps
        speed_mps = speed_to_decide_by(self._shape.v_mps, measured_mps)
        decision = self._decide.step(
            Situation(scene, self.path, pose, on_path, speed_mps, self._shape.a_mps2, now_ns)
        )
        setpoint, fault, unanswered = self._setpoint(decision, on_path, now_ns)
        # None asks for zero at once; as a setpoint it would be a step that the output guard refuses.
        self._state = self._chassis.exchange(None if unanswered else setpoint, now_ns)
        self.localiser.add_odometry(self._state.stamp_ns, self._state.pose)
        to_go_m = self.path.length_m - on_path.s_m
        if to_go_m < -PASSED_M:
            self.request_stop("went past the target", Outcome.BROKEN_OFF)
        arrived = -PASSED_M <= to_go_m <= ARRIVED_M
        self.ending.conclude(self._state, setpoint, now_ns, arrived=arrived)
        scene_ns = None if scene is None else scene.captured_ns
        return ControlStep(
            now_ns, pose, on_path.s_m, on_path.d_m, scene_ns, decision, setpoint, self._state,
            fault=fault, unanswered=unanswered,
        )  # fmt: skip

    def _learn(self, scene: Scene | None) -> None:
        """Each scene's ego-motion corrects the yaw once, or ends a drive that goes elsewhere than is told."""
        if scene is not None and scene.captured_ns != self._scene_ns:
            self._scene_ns = scene.captured_ns
            self.localiser.add_ego_motion(scene.captured_ns, scene.ego_motion)
            if self.localiser.contradiction:
                self.request_stop(self.localiser.contradiction, Outcome.BROKEN_OFF)

    def _setpoint(self, decision: Decision, on_path: OnPath, now_ns: int) -> tuple[Setpoint, str, str]:
        """What to send, the shaper's fault, and why zero is said instead of the profile."""
        state = self._state
        if state is None or state.mode is not ChassisMode.ARMED:
            # What the chassis does now is not ours to shape; whenever it obeys again, begin at rest.
            self._shape.reset()
            self._answer.restart()
            return Setpoint(now_ns, 0.0, 0.0, 0.0), "", ""
        answer = self._answer.step(self._shape.v_mps, state.v_mps, state.feedback_ns, now_ns)
        if answer.ends:
            self.request_stop(answer.zero, Outcome.BROKEN_OFF)
        if answer.zero:
            self._shape.begin_anew()
            return Setpoint(now_ns, 0.0, 0.0, 0.0), "", answer.zero
        if answer.dips:
            self._shape.unlearn_lag()
        target_mps = 0.0 if self.ending.stop_reason is not None else decision.target_speed_mps
        shaped = self._shape.step(
            min(target_mps, answer.cap_mps),
            emergency=decision.emergency or answer.hard or self.localiser.contradiction != "",
            distance_to_end_m=self.path.length_m - self._progress_m,
        )
        w_radps = self._follow.step(on_path, shaped.v_mps)
        return Setpoint(now_ns, shaped.v_mps, shaped.a_mps2, w_radps), shaped.fault, ""
