"""The base as a control loop drives it: what the loop along a path and the governor's do alike in each step.

Each step calls begin_step(), decides what to command, and calls finish_step().
"""

from __future__ import annotations

import math
from dataclasses import replace

from controller.base.drive_lifecycle import DriveLifecycle, Outcome
from controller.base.localise import Localiser
from controller.base.response_monitor import NO_CAP, ResponseMonitor, SpeedCap
from hal.api import Chassis
from hal.types import ChassisMode, ChassisState, Setpoint
from vision.scene import Scene


class DrivenBase:
    """A chassis, with where it is, whether it responds to its commands, and how its drive begins and ends.

    state: what the chassis told last; None before the first exchange.
    """

    def __init__(self, chassis: Chassis, localiser: Localiser, response: ResponseMonitor) -> None:
        self.localiser = localiser
        self.lifecycle = DriveLifecycle(chassis)
        self.state: ChassisState | None = None
        self._chassis = chassis
        self._response = response
        self._scene_ns: int | None = None
        self._commanded_mps = 0.0

    @property
    def obeys(self) -> bool:
        """Whether the chassis follows setpoints now."""
        return self.state is not None and self.state.mode is ChassisMode.ARMED

    @property
    def measured_mps(self) -> float:
        """The measured speed; NaN if it is not known."""
        return math.nan if self.state is None else self.state.v_mps

    def begin_step(self, scene: Scene | None, now_ns: int) -> SpeedCap:
        """Arm the chassis in the first step, correct the pose by a new scene, and judge the base's response.

        The response is the measured speed after the command of the step before. A stop is requested where
        nothing helps, and where the images contradict the odometry for long. Then every command is a hard
        one, because the base may go anywhere.
        """
        self.lifecycle.arm_once(now_ns)
        if scene is not None and scene.captured_ns != self._scene_ns:
            self._scene_ns = scene.captured_ns
            self.localiser.add_ego_motion(scene.captured_ns, scene.ego_motion)
            if self.localiser.contradiction:
                self.lifecycle.request_stop(self.localiser.contradiction, Outcome.BROKEN_OFF)
        cap = self._judge_response(now_ns)
        return replace(cap, hard=True) if self.localiser.contradiction else cap

    def finish_step(
        self, setpoint: Setpoint, now_ns: int, *, zero: bool = False, arrived: bool = False
    ) -> ChassisState:
        """Send the setpoint, take in state and odometry that come back, and end the drive if it is over.

        zero: ask for zero at once instead; as a setpoint it would be a step that the output guard refuses.
        arrived: whether the robot is where this drive leads to.
        """
        self.state = state = self._chassis.exchange(None if zero else setpoint, now_ns)
        self._commanded_mps = setpoint.v_mps
        self.localiser.add_odometry(state.stamp_ns, state.pose)
        self.lifecycle.check_end(state, setpoint, now_ns, arrived=arrived)
        return state

    def _judge_response(self, now_ns: int) -> SpeedCap:
        """While the chassis does not obey, what it does is no response."""
        if self.state is None or not self.obeys:
            self._response.restart()
            return NO_CAP
        state = self.state
        cap = self._response.step(self._commanded_mps, state.v_mps, state.feedback_ns, now_ns)
        if cap.ends:
            self.lifecycle.request_stop(cap.zero_reason, Outcome.BROKEN_OFF)
        return cap


class DriveLoop:
    """What both control loops show of their base and of their drive."""

    def __init__(self, base: DrivenBase) -> None:
        self._base = base

    @property
    def localiser(self) -> Localiser:
        """Where the robot is."""
        return self._base.localiser

    @property
    def lifecycle(self) -> DriveLifecycle:
        """Whether, how and why the drive has ended."""
        return self._base.lifecycle

    @property
    def finished(self) -> bool:
        """Whether the drive has ended; then the chassis has been told to stop."""
        return self.lifecycle.outcome is not None

    def request_stop(self, reason: str, outcome: Outcome = Outcome.STOPPED) -> None:
        """Stop by the comfort profile, then end with this outcome. The first reason is kept."""
        self.lifecycle.request_stop(reason, outcome)
