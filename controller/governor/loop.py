"""One control step of the governor: takes requests and scene, sends a safe setpoint, answers the planner.

It is a Drive (controller/control.py), so the real-time runner steps it as it does a mission.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from controller.answer import Answer, BaseAnswer
from controller.control import ControlStep
from controller.decision.decision import Decision
from controller.ending import Ending, Outcome
from controller.governor.governor import SpeedGovernor
from controller.governor.inbox import Asked
from controller.localise import Localiser
from controller.record.recorder import path_ahead
from hal.api import Chassis
from hal.types import ChassisMode, ChassisState, FloatArray, Setpoint
from vision.scene import Scene


class Commands(Protocol):
    """Gives requests and takes answers; implemented by controller.governor.inbox.Inbox."""

    def poll(self, now_ns: int) -> Asked: ...

    def tell(self, v_mps: float, w_radps: float, decision: Decision, chassis: str) -> None: ...


class GovernorLoop:
    """The order of work within a control period, as controller.control.ControlLoop for a path.

    A silent planner is no fault: the robot stops, and goes on when commands come again. A chassis that
    latches a fault ends the drive, as in every drive; then only a person can start it again.
    """

    def __init__(
        self,
        governor: SpeedGovernor,
        commands: Commands,
        localiser: Localiser,
        chassis: Chassis,
        answer: BaseAnswer,
    ) -> None:
        self.localiser = localiser
        self._governor = governor
        self._commands = commands
        self._chassis = chassis
        self._answer = answer
        self._commanded_mps = 0.0
        self.ending = Ending(chassis)
        self._state: ChassisState | None = None
        self._scene_ns: int | None = None
        self._travelled_m = 0.0
        self._came_from = localiser.pose

    @property
    def finished(self) -> bool:
        """Whether the drive has ended; then the chassis has been told to stop."""
        return self.ending.outcome is not None

    def request_stop(self, reason: str, outcome: Outcome = Outcome.STOPPED) -> None:
        """Stop by the comfort profile, then end with this outcome. The first reason is kept."""
        self.ending.request_stop(reason, outcome)

    def step(self, scene: Scene | None, now_ns: int) -> ControlStep:
        """Take a request, govern it, send the setpoint, and answer the planner."""
        self.ending.begin(now_ns)
        if scene is not None and scene.captured_ns != self._scene_ns:
            self._scene_ns = scene.captured_ns
            self.localiser.add_ego_motion(scene.captured_ns, scene.ego_motion)
            if self.localiser.contradiction:
                self.request_stop(self.localiser.contradiction, Outcome.BROKEN_OFF)
        asked = self._commands.poll(now_ns)
        if self.ending.stop_reason is not None:
            asked = Asked(None, self.ending.stop_reason)
        pose = self.localiser.pose
        obeys = self._state is not None and self._state.mode is ChassisMode.ARMED
        if not obeys:
            # The chassis does not follow setpoints now. When it does again, shaping begins from standstill.
            self._governor.rest()
            asked = Asked(None, f"the chassis is not armed ({self._mode})")
        answer = self._answered(now_ns)
        if answer.ends:
            self.request_stop(answer.zero, Outcome.BROKEN_OFF)
        if answer.zero:
            self._governor.rest()
        measured_mps = np.nan if self._state is None else self._state.v_mps
        governed = self._governor.step(
            now_ns, scene, None if answer.zero else asked.twist, pose, measured_mps,
            answer.zero or asked.silence, answer,
        )  # fmt: skip
        setpoint = Setpoint(now_ns, governed.v_mps, governed.a_mps2, governed.w_radps)
        # None asks for zero at once; as a setpoint it would be a step that the output guard refuses.
        self._state = self._chassis.exchange(None if answer.zero else setpoint, now_ns)
        self._commanded_mps = governed.v_mps
        self.localiser.add_odometry(self._state.stamp_ns, self._state.pose)
        if pose.finite:
            self._came_from = pose
        moved = self.localiser.pose
        if moved.finite:
            before = self._came_from
            self._travelled_m += float(np.hypot(moved.x_m - before.x_m, moved.y_m - before.y_m))
        self.ending.conclude(self._state, setpoint, now_ns, arrived=False)
        self._commands.tell(governed.v_mps, governed.w_radps, governed.decision, self._mode)
        on_path = self._governor.on_path
        scene_ns = None if scene is None else scene.captured_ns
        return ControlStep(
            now_ns, pose, self._travelled_m, on_path.d_m, scene_ns, governed.decision, setpoint,
            self._state, self._ahead(), governed.fault, answer.zero,
        )  # fmt: skip

    def _answered(self, now_ns: int) -> Answer:
        state = self._state
        if state is None or state.mode is not ChassisMode.ARMED:
            self._answer.restart()
            return Answer()
        return self._answer.step(self._commanded_mps, state.v_mps, state.feedback_ns, now_ns)

    @property
    def _mode(self) -> str:
        return "not yet heard" if self._state is None else self._state.mode.value

    def _ahead(self) -> FloatArray | None:
        """The arc in the body frame, for pictures."""
        path = self._governor.path
        if path is None:
            return None
        return path_ahead(path, self._governor.on_path.s_m, path.pose(self._governor.on_path.s_m))
