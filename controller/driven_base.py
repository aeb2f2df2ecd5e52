"""The base as a control loop drives it: what the loop along a path and the governor's do alike in each step.

Each step calls begin(), speed_cap(), exchange() and conclude(), in this order.
"""

from __future__ import annotations

import math
from dataclasses import replace

from controller.ending import Ending, Outcome
from controller.localise import Localiser
from controller.response_monitor import NO_CAP, ResponseMonitor, SpeedCap
from hal.api import Chassis
from hal.types import ChassisMode, ChassisState, Setpoint
from vision.scene import Scene


class DrivenBase:
    """A chassis, with where it is, whether it responds to its commands, and how its drive begins and ends.

    state: what the chassis told last; None before the first exchange.
    """

    def __init__(self, chassis: Chassis, localiser: Localiser, response: ResponseMonitor) -> None:
        self.localiser = localiser
        self.ending = Ending(chassis)
        self.state: ChassisState | None = None
        self._chassis = chassis
        self._response = response
        self._scene_ns: int | None = None

    @property
    def finished(self) -> bool:
        """Whether the drive has ended; then the chassis has been told to stop."""
        return self.ending.outcome is not None

    @property
    def obeys(self) -> bool:
        """Whether the chassis follows setpoints now."""
        return self.state is not None and self.state.mode is ChassisMode.ARMED

    @property
    def measured_mps(self) -> float:
        """The measured speed; NaN if it is not known."""
        return math.nan if self.state is None else self.state.v_mps

    def begin(self, scene: Scene | None, now_ns: int) -> None:
        """Arm the chassis in the first step, and correct the pose by the ego-motion of a new scene.

        Where the images contradict the odometry for long, a stop is requested.
        """
        self.ending.begin(now_ns)
        if scene is not None and scene.captured_ns != self._scene_ns:
            self._scene_ns = scene.captured_ns
            self.localiser.add_ego_motion(scene.captured_ns, scene.ego_motion)
            if self.localiser.contradiction:
                self.ending.request_stop(self.localiser.contradiction, Outcome.BROKEN_OFF)

    def speed_cap(self, commanded_mps: float, now_ns: int) -> SpeedCap:
        """Whether the base does what it was told; requests a stop where nothing helps.

        commanded_mps: the last command. While the chassis does not obey, what it does is no response. While
        the images contradict the odometry, every command is a hard one: the base may go anywhere.
        """
        if self.state is None or not self.obeys:
            self._response.restart()
            return NO_CAP
        cap = self._response.step(commanded_mps, self.state.v_mps, self.state.feedback_ns, now_ns)
        if cap.ends:
            self.ending.request_stop(cap.zero_reason, Outcome.BROKEN_OFF)
        return replace(cap, hard=True) if self.localiser.contradiction else cap

    def exchange(self, setpoint: Setpoint, now_ns: int, *, zero: bool) -> ChassisState:
        """Send the setpoint, and take in the state and the odometry that come back.

        zero: ask for zero at once instead; as a setpoint it would be a step that the output guard refuses.
        """
        self.state = self._chassis.exchange(None if zero else setpoint, now_ns)
        self.localiser.add_odometry(self.state.stamp_ns, self.state.pose)
        return self.state

    def conclude(self, setpoint: Setpoint, now_ns: int, *, arrived: bool) -> None:
        """Decide whether the drive is over. arrived: whether the robot is where this drive leads to."""
        assert self.state is not None, "concluded before the first exchange"
        self.ending.conclude(self.state, setpoint, now_ns, arrived=arrived)
