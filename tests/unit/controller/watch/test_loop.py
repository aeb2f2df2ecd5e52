"""Watching with a base and scenes made of known numbers, under a clock that the test holds."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from typing import Self

import numpy as np
import pytest

from config.app import load_app
from config.loader import CONFIG_DIR
from controller.base.drive_lifecycle import Outcome
from controller.control import ControlStep
from controller.watch.command import build_watch_loop
from controller.watch.loop import WatchLoop
from controller.watch.no_base import NoBase
from hal.api import ChassisListener
from hal.geometry import camera_in_body, mount_of, wrap_angle_rad
from hal.types import ChassisMode, ChassisState, PlanarPose, Pose
from tests.support.scenes import chassis_state, obstacle, scene
from vision.scene import EgoMotion, Scene

MS = 1_000_000
CONFIG = load_app(CONFIG_DIR / "sim-realtime.yaml")


class Pushed:
    """hal.api.ChassisListener of a base that somebody pushes at v_mps."""

    def __init__(self, v_mps: float = 0.0) -> None:
        self.v_mps = v_mps

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def listen(self, now_ns: int) -> ChassisState:
        """As far as it has come since time zero."""
        pose = PlanarPose(self.v_mps * now_ns / 1e9, 0.0, 0.0)
        return chassis_state(now_ns, ChassisMode.STANDBY, self.v_mps, pose, "it answers")


def watched(loop: WatchLoop, seconds: float, seen: Scene | None = None) -> list[ControlStep]:
    """Steps at 50 Hz from time zero on, with a scene at 25 Hz if one is seen."""
    steps = []
    for k in range(round(seconds * 50)):
        now_ns = k * 20 * MS
        if loop.finished:
            break
        newest = None if seen is None else replace(seen, captured_ns=(k // 2) * 40 * MS, sequence=k // 2)
        steps.append(loop.step(newest, now_ns))
    return steps


def loop_of(chassis: ChassisListener, duration_s: float | None = None) -> WatchLoop:
    return build_watch_loop(CONFIG, chassis, duration_s)


def test_a_step_commands_nothing_and_passes_on_what_the_base_says() -> None:
    step = watched(loop_of(Pushed(0.3)), 1.0, scene())[-1]
    commanded = [getattr(step.setpoint, field.name) for field in fields(step.setpoint)[1:]]
    assert all(math.isnan(number) for number in commanded)
    assert step.chassis.sent is None
    assert step.chassis.pose.x_m == pytest.approx(0.294)


def test_decision_is_that_of_a_robot_that_drives_straight_ahead() -> None:
    free = watched(loop_of(Pushed(0.5)), 3.0, scene())[-1].decision
    assert free.target_speed_mps == pytest.approx(CONFIG.robot.limits.max_speed_mps)
    crate = scene(obstacles=(obstacle(position_m=(0.0, 0.2, 2.0)),))
    blocked = watched(loop_of(Pushed(0.5)), 3.0, crate)[-1].decision
    assert blocked.reason.rule == "static"
    assert blocked.target_speed_mps < 1.0


@pytest.mark.parametrize("chassis", [Pushed(-0.3), NoBase()])
def test_a_base_that_is_pulled_back_or_is_not_there_leaves_a_decision(chassis: ChassisListener) -> None:
    decision = watched(loop_of(chassis), 3.0, scene())[-1].decision
    assert decision.reason.rule != "fault"
    assert decision.target_speed_mps > 0.0


def test_time_counts_from_the_first_frame_on() -> None:
    loop = loop_of(Pushed(), 2.0)
    for k in range(300):
        loop.step(None, k * 20 * MS)
    assert not loop.finished
    steps = 0
    while not loop.finished:
        now_ns = (300 + steps) * 20 * MS
        loop.step(scene(now_ns, steps), now_ns)
        steps += 1
    assert steps == 101
    assert (loop.outcome, loop.reason) == (Outcome.STOPPED, "watched for 2 s")


def test_a_camera_that_never_shows_anything_does_not_hold_it_up_for_ever() -> None:
    loop = loop_of(Pushed(), 2.0)
    assert len(watched(loop, 200.0)) == 182 * 50 + 1
    assert loop.reason == "no frame came"


def test_it_ends_with_the_step_after_a_signal() -> None:
    loop = loop_of(Pushed(0.5))
    loop.request_stop("SIGINT received")
    loop.request_stop("later", Outcome.BROKEN_OFF)
    assert loop.finished
    assert (loop.outcome, loop.reason) == (Outcome.STOPPED, "SIGINT received")


class Turned:
    """hal.api.ChassisListener of a base that turns on the spot at 0.5 rad/s, by what it reports."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def listen(self, now_ns: int) -> ChassisState:
        """As far as it has turned since time zero."""
        heading_rad = wrap_angle_rad(0.5 * now_ns / 1e9)
        return chassis_state(now_ns, ChassisMode.STANDBY, 0.0, PlanarPose(0.0, 0.0, heading_rad))


def test_yaw_of_the_images_is_compared_with_that_of_the_odometry() -> None:
    """The tracks slip: of every turn that they report, 80 % happen."""
    to_body = camera_in_body(mount_of(CONFIG.robot)).rotation
    c, s = math.cos(0.8 * 0.5 * 0.04), math.sin(0.8 * 0.5 * 0.04)
    in_body = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    turning = Pose(to_body.T @ in_body @ to_body, np.zeros(3))
    ego = EgoMotion(turning, 0.04, "visual", 0.9, 0.01, 0.001)
    loop = loop_of(Turned())
    watched(loop, 10.0, replace(scene(), ego_motion=ego))
    assert loop.localiser.yaw_ratio == pytest.approx(0.8, abs=0.01)
