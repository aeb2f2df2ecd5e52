"""What is added up while watching."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from controller.control import ControlStep
from controller.realtime.messages import SceneMessage
from controller.record.tally import Complaints, ConditionTally, FrameTally, ObstacleTally, TimingTally
from hal.clocks import NS_PER_S
from hal.geometry import camera_in_body, wrap_angle_rad
from hal.types import CameraMount, PlanarPose
from vision.scene import Obstacle, Scene, SeenFloor

# One look at the floor is accurate to 0.3 degrees and 6 mm; the median of these is what is told.
_LOOKS_NOW, _MOST_LOOKS = 5, 1000


@dataclass(frozen=True, slots=True)
class Floor:
    """The median of some looks at the floor. looks: how many. The rest as in SeenFloor."""

    looks: int
    camera_height_m: float
    pitch_rad: float
    roll_rad: float


@dataclass(frozen=True, slots=True)
class Relative:
    """An obstacle from the camera's place on the robot, along the robot's own axes."""

    id: int
    moving: bool
    ahead_m: float
    left_m: float
    ahead_mps: float
    left_mps: float


def relative(obstacle: Obstacle, mount: CameraMount) -> Relative:
    """Where it is ahead of and to the left of the camera, with its velocity over ground."""
    to_body = camera_in_body(mount).rotation
    ahead_m, left_m, _ = (to_body @ obstacle.position_m).tolist()
    ahead_mps, left_mps, _ = (to_body @ obstacle.velocity_mps).tolist()
    return Relative(obstacle.id, obstacle.moving, ahead_m, left_m, ahead_mps, left_mps)


@dataclass(kw_only=True)
class WatchResult:
    """The result of watching.

    first_ns, last: the first and last step. last_scene: the newest. odometry_turn_rad: turned in all by the
    odometry, so two turns are 720 degrees; turned_rad: the same without regard to the direction. cut_off: why
    outputs are not whole.
    """

    mount: CameraMount
    timing: TimingTally = field(default_factory=TimingTally)
    frames: FrameTally = field(default_factory=FrameTally)
    camera: ConditionTally = field(default_factory=ConditionTally)
    complaints: Complaints = field(default_factory=Complaints)
    cut_off: list[str] = field(default_factory=list)
    first_ns: int | None = None
    last: ControlStep | None = None
    last_scene: Scene | None = None
    seen: ObstacleTally = field(default_factory=ObstacleTally)
    odometry_turn_rad: float = 0.0
    turned_rad: float = 0.0
    _looks: deque[SeenFloor] = field(default_factory=lambda: deque(maxlen=_MOST_LOOKS))
    _pose: PlanarPose | None = None

    @property
    def duration_s(self) -> float:
        """Time from the first step to the last."""
        return 0.0 if self.last is None else self.seconds(self.last.now_ns)

    def seconds(self, now_ns: int) -> float:
        """Time since the first step."""
        return 0.0 if self.first_ns is None else (now_ns - self.first_ns) / NS_PER_S

    def take(self, step: ControlStep) -> None:
        """Account for one step."""
        self.first_ns = step.now_ns if self.first_ns is None else self.first_ns
        self.last = step
        self.complaints.add(step.chassis.faults)
        pose = step.chassis.pose
        if not pose.finite:
            return
        if self._pose is not None:
            turn_rad = wrap_angle_rad(pose.heading_rad - self._pose.heading_rad)
            self.odometry_turn_rad += turn_rad
            self.turned_rad += abs(turn_rad)
        self._pose = pose

    def take_message(self, message: SceneMessage) -> None:
        """Account for one frame."""
        scene = self.last_scene = message.scene
        self.timing.add(message.timing_ms)
        self.frames.add(scene.sequence)
        self.camera.add(scene.health)
        for obstacle in self.obstacles():
            self.seen.add(obstacle.id, obstacle.moving, obstacle.ahead_m)
        look = scene.floor
        if look is not None and not (self._looks and self._looks[-1].captured_ns == look.captured_ns):
            self._looks.append(look)

    def obstacles(self) -> list[Relative]:
        """Those of the newest scene."""
        scene = self.last_scene
        return [] if scene is None else [relative(obstacle, self.mount) for obstacle in scene.obstacles]

    def floor_now(self) -> Floor | None:
        """By the last looks."""
        return _median(list(self._looks)[-_LOOKS_NOW:])

    def floor_in_all(self) -> Floor | None:
        """By all looks."""
        return _median(self._looks)


def _median(looks: Iterable[SeenFloor]) -> Floor | None:
    numbers = np.array([(look.camera_height_m, look.pitch_rad, look.roll_rad) for look in looks])
    return Floor(len(numbers), *np.median(numbers, axis=0).tolist()) if len(numbers) else None
