"""A drive along a straight path on a chassis of the test, step by step, without a thread or a clock."""

from __future__ import annotations

from config.decision import DecisionConfig
from config.path import LineSpec, PathSpec
from config.robot import Robot
from controller.base.localise import Localiser
from controller.base.response_monitor import ResponseMonitor
from controller.control import ControlLoop, ControlStep
from controller.decision.decide import DecisionMaker
from controller.follow import PathFollower
from controller.path.path import Path
from controller.shape import SpeedShaper
from hal.api import Chassis
from hal.types import CameraMount
from tests.support.obedient_chassis import PERIOD_S
from tests.support.scenes import scene

PERIOD_NS = round(PERIOD_S * 1e9)
ROBOT = Robot()
MOUNT = CameraMount(0.45, 0.0, 0.6, 0.07)


def loop_on(chassis: Chassis, length_m: float = 3.0) -> ControlLoop:
    """The loop of a drive straight ahead."""
    path = Path(PathSpec(segments=(LineSpec(kind="line", length_m=length_m),)), ROBOT)
    return ControlLoop(
        path=path,
        decide=DecisionMaker(DecisionConfig(), ROBOT, MOUNT, PERIOD_S),
        shape=SpeedShaper(ROBOT.limits, PERIOD_S),
        follow=PathFollower(path, ROBOT.limits),
        localiser=Localiser(path.start, MOUNT),
        chassis=chassis,
        response=ResponseMonitor(0.2, ROBOT.limits.max_speed_mps),
    )


def drive(loop: ControlLoop, steps: int, first: int = 0) -> list[ControlStep]:
    """Steps with a fresh scene of a free way each, until the loop has finished."""
    taken = []
    for index in range(first, first + steps):
        if loop.finished:
            break
        now_ns = index * PERIOD_NS
        taken.append(loop.step(scene(now_ns, index, pose=loop.localiser.pose), now_ns))
    return taken
