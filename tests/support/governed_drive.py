"""A governed drive without a renderer: boxes, a camera that knows them, a base with lag, a planner."""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from config.decision import DecisionConfig
from config.governor import GovernorConfig
from config.robot import Robot
from controller.governor.governor import Governed, SpeedGovernor
from controller.governor.request import Twist
from hal.clocks import NS_PER_S
from hal.geometry import advance_pose
from hal.types import PlanarPose
from tests.support.closed_loop import FRAME_S, LATENCY_S, MOUNT, PERIOD_S, Box, Mission, Noise
from tests.support.floor_bodies import line_path
from vision.scene import Scene

Planner = Callable[[float], Twist | None]


def always(v_mps: float, w_radps: float = 0.0) -> Planner:
    return lambda _: Twist(v_mps, w_radps)


@dataclass(frozen=True)
class Step:
    """What happened in one control period."""

    t_s: float
    requested: Twist | None
    governed: Governed
    pose: PlanarPose
    clearance_m: float


class GovernedDrive:
    """Steps a SpeedGovernor among things; alter(scene, t) may spoil what the camera says (None: no scene)."""

    def __init__(
        self,
        planner: Planner,
        boxes: list[Box] | None = None,
        alter: Callable[[Scene, float], Scene | None] | None = None,
        noise: Noise | None = None,
        lag_s: float = 0.1,
        yaw_ratio: float = 1.0,
        config: GovernorConfig | None = None,
        decision: DecisionConfig | None = None,
    ) -> None:
        self.robot = Robot()
        self.planner, self.alter = planner, alter
        self.governor = SpeedGovernor(
            config or GovernorConfig(), decision or DecisionConfig(), self.robot, MOUNT, PERIOD_S
        )
        self._camera_model = Mission(line_path(1.0), boxes or [], noise)
        self._lag_s, self._yaw_ratio = lag_s, yaw_ratio
        self.pose = PlanarPose(0.0, 0.0, 0.0)
        self.t_s, self.v_mps, self.w_radps = 0.0, 0.0, 0.0
        self.steps: list[Step] = []
        self._frames = 0
        self._in_transit: deque[tuple[float, Scene]] = deque()
        self.scene: Scene | None = None

    def run(self, until_s: float) -> list[Step]:
        while self.t_s < until_s:
            self.step()
        return self.steps

    def step(self) -> None:
        camera = self._camera_model
        camera.pose, camera.t = self.pose, self.t_s
        if self.t_s >= self._frames * FRAME_S - 1e-9:
            self._frames += 1
            camera._frames = self._frames
            scene: Scene | None = camera.look()
            if self.alter is not None and scene is not None:
                scene = self.alter(scene, self.t_s)
            if scene is not None:
                self._in_transit.append((self.t_s + LATENCY_S, scene))
        while self._in_transit and self._in_transit[0][0] <= self.t_s:
            self.scene = self._in_transit.popleft()[1]
        requested = self.planner(self.t_s)
        governed = self.governor.step(
            round(self.t_s * NS_PER_S), self.scene, requested, self.pose, self.v_mps
        )
        gain = 1.0 - math.exp(-PERIOD_S / self._lag_s)
        self.v_mps += gain * (governed.v_mps - self.v_mps)
        self.w_radps += gain * (governed.w_radps - self.w_radps)
        self.pose = advance_pose(self.pose, self.v_mps, self._yaw_ratio * self.w_radps, PERIOD_S)
        camera.pose = self.pose
        self.steps.append(Step(self.t_s, requested, governed, self.pose, camera.clearance()))
        self.t_s += PERIOD_S


def rules(steps: list[Step]) -> list[str]:
    """Each rule once, in the order in which it held."""
    return [rule for rule, _ in itertools.groupby(step.governed.decision.reason.rule for step in steps)]


def last_sentence(steps: list[Step]) -> str:
    """Why it does what it does then."""
    return steps[-1].governed.decision.reason.sentence


def after(steps: list[Step], t_s: float) -> list[Step]:
    """From t_s on."""
    return [step for step in steps if step.t_s >= t_s - 1e-9]
