"""One control step of the governor: takes requests and scene, sends a safe setpoint, answers the planner.

It is a Drive (controller/control.py), so the real-time runner steps it as it does a mission.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from controller.base.driven_base import DriveLoop, DrivenBase
from controller.base.localise import Localiser
from controller.base.response_monitor import ResponseMonitor
from controller.control import ControlStep
from controller.decision.decision import Decision
from controller.governor.governor import SpeedGovernor
from controller.governor.inbox import RequestState
from hal.api import Chassis
from hal.types import FloatArray, PlanarPose, Setpoint
from vision.scene import Scene


class Commands(Protocol):
    """Gives requests and takes answers; implemented by controller.governor.inbox.Inbox."""

    def poll(self, now_ns: int) -> RequestState: ...

    def tell(self, v_mps: float, w_radps: float, decision: Decision, chassis: str) -> None: ...


class GovernorLoop(DriveLoop):
    """One control period of the governor, as controller.control.ControlLoop along a path.

    A silent planner is no fault: the robot stops, and goes on when commands come again. A chassis that
    latches a fault ends the drive, as in every drive; then only a person can start it again.
    """

    def __init__(
        self,
        governor: SpeedGovernor,
        commands: Commands,
        localiser: Localiser,
        chassis: Chassis,
        response: ResponseMonitor,
    ) -> None:
        super().__init__(DrivenBase(chassis, localiser, response))
        self._governor = governor
        self._commands = commands
        self._travelled_m = 0.0
        self._came_from = localiser.pose

    def step(self, scene: Scene | None, now_ns: int) -> ControlStep:
        """Take a request, govern it, send the setpoint, and answer the planner."""
        cap = self._base.begin_step(scene, now_ns)
        asked = self._asked(now_ns)
        pose = self.localiser.pose
        if cap.zero_reason or not self._base.obeys:
            # When the chassis follows setpoints again, shaping begins from standstill.
            self._governor.rest()
        governed = self._governor.step(
            now_ns,
            scene,
            None if cap.zero_reason else asked.twist,
            pose,
            self._base.measured_mps,
            silence=cap.zero_reason or asked.silence,
            cap=cap,
        )
        setpoint = Setpoint(now_ns, governed.v_mps, governed.a_mps2, governed.w_radps)
        state = self._base.finish_step(setpoint, now_ns, zero=cap.zero_reason != "")
        self._note_travel(pose)
        self._commands.tell(governed.v_mps, governed.w_radps, governed.decision, self._mode)
        return ControlStep(
            now_ns=now_ns,
            pose=pose,
            progress_m=self._travelled_m,
            lateral_m=self._governor.on_path.d_m,
            scene_ns=None if scene is None else scene.captured_ns,
            decision=governed.decision,
            setpoint=setpoint,
            chassis=state,
            ahead_m=self._ahead(),
            fault=governed.fault,
            unanswered=cap.zero_reason,
        )

    def _asked(self, now_ns: int) -> RequestState:
        """What the planner asks for; nothing while the drive ends or the chassis does not obey."""
        asked = self._commands.poll(now_ns)
        if not self._base.obeys:
            return RequestState(None, f"the chassis is not armed ({self._mode})")
        if self.lifecycle.stop_reason is not None:
            return RequestState(None, self.lifecycle.stop_reason)
        return asked

    def _note_travel(self, pose: PlanarPose) -> None:
        """Add the way from pose, where this step began, to where the robot is now."""
        if pose.finite:
            self._came_from = pose
        moved = self.localiser.pose
        if moved.finite:
            before = self._came_from
            self._travelled_m += float(np.hypot(moved.x_m - before.x_m, moved.y_m - before.y_m))

    @property
    def _mode(self) -> str:
        state = self._base.state
        return "not yet heard" if state is None else state.mode.value

    def _ahead(self) -> FloatArray | None:
        """The arc in the body frame, for pictures."""
        path = self._governor.path
        if path is None:
            return None
        return path.ahead(self._governor.on_path.s_m, path.pose(self._governor.on_path.s_m))
