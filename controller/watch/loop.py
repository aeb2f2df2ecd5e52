"""One step of watching: listen to the base, and decide as if the robot drove straight ahead.

The real-time runner (controller/realtime/runner.py) steps it in place of a drive, at the control rate.
Nothing here can command the base: it is a hal.api.ChassisListener.
"""

from __future__ import annotations

import math

from controller.base.drive_lifecycle import Outcome
from controller.base.ego_speed import EgoSpeed
from controller.base.localise import Localiser
from controller.control import ControlStep, Decides
from controller.decision.situation import Situation
from controller.path.path import STRAIGHT_AHEAD_M, OnPath, Path
from hal.api import ChassisListener
from hal.clocks import NS_PER_S
from hal.types import PlanarPose, Setpoint
from vision.scene import Scene

# As in a replay, the robot is at the start of a straight path in every step, wherever it is pushed.
_HERE = PlanarPose(0.0, 0.0, 0.0)
_AT_START = OnPath(0.0, 0.0, 0.0)

# The camera's process imports, compiles (at its first start) and opens the camera in this time.
_FIRST_FRAME_S = 180.0


class WatchLoop:
    """controller.control.Drive that only watches.

    straight: the path. localiser: compares the yaw of the odometry with that of the images. duration_s: how
    long to watch from the first frame on; None: until asked to stop. outcome, reason: how and why it has
    ended; None before.
    """

    def __init__(
        self,
        chassis: ChassisListener,
        decide: Decides,
        straight: Path,
        localiser: Localiser,
        ego_speed: EgoSpeed,
        duration_s: float | None = None,
    ) -> None:
        self.localiser = localiser
        self.outcome: Outcome | None = None
        self.reason: str | None = None
        self._chassis = chassis
        self._decide = decide
        self._straight = straight
        self._ego_speed = ego_speed
        self._duration_s = duration_s
        self._end_ns: int | None = None
        self._scene_ns: int | None = None
        self._seen_mps = math.nan

    @property
    def finished(self) -> bool:
        """Whether it has ended."""
        return self.outcome is not None

    def request_stop(self, reason: str, outcome: Outcome = Outcome.STOPPED) -> None:
        """End with the step that follows: nothing has to come to rest. The first reason is kept."""
        if self.outcome is None:
            self.reason, self.outcome = reason, outcome

    def step(self, scene: Scene | None, now_ns: int) -> ControlStep:
        """Take in what base and camera say. The setpoint is unknown (NaN), since nothing is commanded."""
        state = self._chassis.listen(now_ns)
        self.localiser.add_odometry(state.stamp_ns, state.pose)
        if scene is not None and scene.captured_ns != self._scene_ns:
            self._take(scene, now_ns)
        speed_mps = state.v_mps if math.isfinite(state.v_mps) else self._seen_mps
        # A robot that is pushed backwards does not drive; the decision is that of one that stands.
        forward_mps = max(speed_mps, 0.0)
        decision = self._decide.step(
            Situation(scene, self._straight, _HERE, _AT_START, forward_mps, 0.0, now_ns)
        )
        self._end_when_due(now_ns)
        return ControlStep(
            now_ns=now_ns,
            pose=_HERE,
            progress_m=0.0,
            lateral_m=0.0,
            scene_ns=self._scene_ns,
            decision=decision,
            setpoint=Setpoint(now_ns, math.nan, math.nan, math.nan),
            chassis=state,
            ahead_m=STRAIGHT_AHEAD_M,
        )

    def _take(self, scene: Scene, now_ns: int) -> None:
        if self._scene_ns is None and self._duration_s is not None:
            self._end_ns = now_ns + round(self._duration_s * NS_PER_S)
        self._scene_ns = scene.captured_ns
        self._seen_mps = self._ego_speed.step(scene.ego_motion)
        self.localiser.add_ego_motion(scene.captured_ns, scene.ego_motion)

    def _end_when_due(self, now_ns: int) -> None:
        if self._duration_s is None:
            return
        if self._end_ns is None:
            self._end_ns = now_ns + round((_FIRST_FRAME_S + self._duration_s) * NS_PER_S)
        if now_ns >= self._end_ns:
            watched = f"watched for {self._duration_s:g} s" if self._scene_ns is not None else "no frame came"
            self.request_stop(watched)
