"""The governor's control loop with a fake clock, a planner by the time, and a base that obeys at once."""

from __future__ import annotations

from collections.abc import Callable

from config.decision import DecisionConfig
from config.governor import GovernorConfig
from config.robot import Robot
from controller.base.localise import Localiser
from controller.base.response_monitor import ResponseMonitor
from controller.control import ControlStep
from controller.decision.decision import Decision
from controller.governor.governor import SpeedGovernor
from controller.governor.inbox import RequestState
from controller.governor.loop import GovernorLoop
from controller.governor.request import Twist
from hal.types import CameraMount
from tests.support.obedient_chassis import PERIOD_S, ObedientChassis
from tests.support.scenes import ORIGIN, free_space, scene

PERIOD_NS = round(PERIOD_S * 1e9)
ROBOT = Robot()
MOUNT = CameraMount(0.45, 0.0, 0.6, 0.07)
GO = RequestState(Twist(0.6, 0.1))


class Planner:
    """controller.governor.loop.Commands: asks by the time, notes what it is told."""

    def __init__(self, asks: Callable[[float], RequestState]) -> None:
        self._asks = asks
        self.told: list[tuple[float, float, str, str]] = []

    def poll(self, now_ns: int) -> RequestState:
        return self._asks(now_ns / 1e9)

    def tell(self, v_mps: float, w_radps: float, decision: Decision, chassis: str) -> None:
        self.told.append((v_mps, w_radps, decision.reason.rule, chassis))


class Rig:
    """A governor's loop, its base, what the planner was told, and the steps so far."""

    def __init__(
        self,
        asks: Callable[[float], RequestState] = lambda _: GO,
        arms_after: int = 3,
        chassis: ObedientChassis | None = None,
    ) -> None:
        self.chassis, self.planner = chassis or ObedientChassis(arms_after), Planner(asks)
        governor = SpeedGovernor(GovernorConfig(), DecisionConfig(), ROBOT, MOUNT, PERIOD_S)
        self.loop = GovernorLoop(
            governor,
            self.planner,
            Localiser(ORIGIN, MOUNT),
            self.chassis,
            ResponseMonitor(0.2, ROBOT.limits.max_speed_mps),
        )
        self.steps: list[ControlStep] = []

    def run(self, seconds: float) -> list[ControlStep]:
        """With a fresh scene of a free way at every step."""
        for _ in range(round(50 * seconds)):
            if self.loop.finished:
                break
            k = len(self.steps)
            seen = scene(k * PERIOD_NS, k, space=free_space(), pose=self.loop.localiser.pose)
            self.steps.append(self.loop.step(seen, k * PERIOD_NS))
        return self.steps
