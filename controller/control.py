"""One control step along a path: chassis state and scene in, decision and shaped setpoint out.

All loops step it (controller/lockstep.py, controller/realtime/runner.py). What it shares with the governor's
control step is in controller/base/driven_base.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol

from controller.base.drive_lifecycle import Outcome
from controller.base.driven_base import DriveLoop, DrivenBase
from controller.base.localise import Localiser
from controller.base.response_monitor import ResponseMonitor, SpeedCap
from controller.decision.decision import Decision
from controller.decision.situation import Situation, speed_to_decide_by
from controller.follow import PathFollower
from controller.path.path import OnPath, Path
from controller.shape import SpeedShaper
from hal.api import Chassis
from hal.types import ChassisState, FloatArray, PlanarPose, Setpoint
from vision.scene import Scene

# A robot at rest has arrived if it stands within this distance of the path's end.
ARRIVED_M = 0.05
# A robot farther past the end than this has missed the target.
PASSED_M = 0.10


@dataclass(frozen=True, slots=True)
class ControlStep:
    """What one control step knew, decided and sent.

    now_ns: time of the step.
    pose: of the body, in the path's frame.
    progress_m, lateral_m: its place along the path and to its left.
    scene_ns: when the frame was captured that the decision used; None if there was none yet.
    setpoint: what was asked for.
    chassis: the state that came back.
    ahead_m: (N, 2) the way ahead in the body frame, if it is not the path that the runner knows.
    fault: why the shaper had to brake by the stop profile; "" if it did not.
    unanswered: why the base was told zero at once instead of the profile; "" if it was not.
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
    """What a loop steps: ControlLoop, or the governor's GovernorLoop."""

    @property
    def finished(self) -> bool: ...

    def request_stop(self, reason: str, outcome: Outcome = Outcome.STOPPED) -> None: ...

    def step(self, scene: Scene | None, now_ns: int) -> ControlStep: ...


class Decides(Protocol):
    """What decides in a control step: DecisionMaker, or another policy that a campaign compares with it."""

    def step(self, at: Situation) -> Decision: ...


class ControlLoop(DriveLoop):
    """One control period along a path: steps every part in its order; none of them runs by itself."""

    def __init__(
        self,
        path: Path,
        decide: Decides,
        shape: SpeedShaper,
        follow: PathFollower,
        localiser: Localiser,
        chassis: Chassis,
        response: ResponseMonitor,
    ) -> None:
        super().__init__(DrivenBase(chassis, localiser, response))
        self.path = path
        self._decide = decide
        self._shape = shape
        self._follow = follow
        self._progress_m = 0.0

    def step(self, scene: Scene | None, now_ns: int) -> ControlStep:
        """Decide on what is known, shape, send, and take in what the chassis returns."""
        cap = self._base.begin_step(scene, now_ns)
        pose = self.localiser.pose
        on_path = self.path.project(pose, self._progress_m)
        if math.isfinite(on_path.s_m):
            self._progress_m = on_path.s_m
        speed_mps = speed_to_decide_by(self._shape.v_mps, self._base.measured_mps)
        decision = self._decide.step(
            Situation(scene, self.path, pose, on_path, speed_mps, self._shape.a_mps2, now_ns)
        )
        setpoint, fault, unanswered = self._setpoint(decision, on_path, cap, now_ns)
        to_go_m = self.path.length_m - on_path.s_m
        if to_go_m < -PASSED_M:
            self.request_stop("went past the target", Outcome.BROKEN_OFF)
        arrived = -PASSED_M <= to_go_m <= ARRIVED_M
        state = self._base.finish_step(setpoint, now_ns, zero=unanswered != "", arrived=arrived)
        scene_ns = None if scene is None else scene.captured_ns
        return ControlStep(
            now_ns=now_ns,
            pose=pose,
            progress_m=on_path.s_m,
            lateral_m=on_path.d_m,
            scene_ns=scene_ns,
            decision=decision,
            setpoint=setpoint,
            chassis=state,
            fault=fault,
            unanswered=unanswered,
        )

    def _setpoint(
        self, decision: Decision, on_path: OnPath, cap: SpeedCap, now_ns: int
    ) -> tuple[Setpoint, str, str]:
        """What to send, the shaper's fault, and why zero is asked for instead of the profile."""
        stand = Setpoint(now_ns, 0.0, 0.0, 0.0)
        if not self._base.obeys:
            # The chassis does not follow setpoints now. When it does again, shaping begins from standstill.
            self._shape.reset()
            return stand, "", ""
        if cap.zero_reason:
            self._shape.begin_anew()
            return stand, "", cap.zero_reason
        if cap.dips:
            self._shape.unlearn_lag()
        target_mps = 0.0 if self.lifecycle.stop_reason is not None else decision.target_speed_mps
        shaped = self._shape.step(
            min(target_mps, cap.cap_mps),
            emergency=decision.emergency or cap.hard,
            distance_to_end_m=self.path.length_m - self._progress_m,
        )
        w_radps = self._follow.step(on_path, shaped.v_mps)
        return Setpoint(now_ns, shaped.v_mps, shaped.a_mps2, w_radps), shaped.fault, ""
