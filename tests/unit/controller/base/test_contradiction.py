"""A base that goes elsewhere than it tells, as the images show: by itself, and as the end of a drive."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from config.robot import Robot
from controller.base.contradiction import Contradiction, FrameMotion
from controller.base.drive_lifecycle import Outcome
from controller.base.driven_base import DrivenBase
from controller.base.localise import Localiser
from controller.base.response_monitor import ResponseMonitor
from controller.control import ControlStep
from hal.geometry import camera_in_body
from hal.types import Pose, Setpoint
from tests.support.governor_rig import Rig
from tests.support.obedient_chassis import PERIOD_S, ObedientChassis
from tests.support.path_drive import MOUNT, PERIOD_NS, loop_on
from tests.support.scenes import ORIGIN, scene
from vision.scene import EgoMotion, Scene

FRAME_S = 1.0 / 30.0


def told_after(
    told_mps: float, seen_mps: float, told_radps: float = 0.0, seen_radps: float = 0.0, disputed_of: int = 1
) -> tuple[float, str] | None:
    """When that is noticed, at most after a minute, and what is said. Each disputed_of-th frame is."""
    contradiction = Contradiction()
    for k in range(60 * 30):
        disputed = k % disputed_of == 0
        told = FrameMotion(told_mps * FRAME_S, told_radps * FRAME_S)
        seen = FrameMotion(seen_mps * FRAME_S, seen_radps * FRAME_S) if disputed else told
        contradiction.add(told, seen, disputed=disputed)
        if contradiction.sentence:
            return k * FRAME_S, contradiction.sentence
    return None


@pytest.mark.parametrize(
    ("told_mps", "seen_mps", "seen_radps", "within_s"),
    [
        (0.5, -0.5, 0.0, 0.5),  # both motors mirrored, and their encoders
        (0.2, 0.0, 0.5, 1.0),  # one of them
        (0.5, 1.0, 0.0, 1.5),  # counters with half the scale
        (0.5, 0.0, 0.0, 1.5),  # tracks that spin on the spot
    ],
)
def test_going_elsewhere_is_noticed(
    told_mps: float, seen_mps: float, seen_radps: float, within_s: float
) -> None:
    noticed = told_after(told_mps, seen_mps, 0.0, seen_radps)
    assert noticed is not None
    assert noticed[0] < within_s


@pytest.mark.parametrize(
    ("told", "seen"),
    [
        ((0.5, 0.0), (0.4, 0.0)),  # tracks that slip somewhat
        ((0.3, 0.8), (0.3, 0.5)),  # more so in a turn
        ((0.0, 0.0), (-1.5, 0.0)),  # a lorry that sets off before a robot that stands
    ],
)
def test_slip_and_what_passes_a_standing_robot_are_not(
    told: tuple[float, float], seen: tuple[float, float]
) -> None:
    assert told_after(told[0], seen[0], told[1], seen[1]) is None


def test_a_vehicle_that_fills_the_view_now_and_then_is_not() -> None:
    assert told_after(0.5, 0.0, disputed_of=5) is None


def test_the_sentence_names_both_motions_and_what_to_look_at() -> None:
    noticed = told_after(0.6, -0.6)
    assert noticed is not None
    assert noticed[1] == (
        "the camera sees -0.22 m ahead and +0.00 rad where the base reports +0.22 m and +0.00 rad; do its "
        "motors turn the right way, are its scales right in chassis:, do its tracks slip?"
    )


def sees_it_go_back(now_ns: int, index: int, v_mps: float) -> Scene:
    """As far back as the base tells of going ahead."""
    back_m = camera_in_body(MOUNT).rotation.T @ np.array([-v_mps * PERIOD_S, 0.0, 0.0])
    ego = EgoMotion(Pose(np.eye(3), back_m), PERIOD_S, "disputed", 0.95, 0.001, 0.001)
    return replace(scene(now_ns, index), ego_motion=ego)


def test_contradiction_ends_the_drive_early_and_says_why() -> None:
    loop, steps = loop_on(ObedientChassis(), 10.0), list[ControlStep]()
    while not loop.finished and len(steps) < 1000:
        k, v_mps = len(steps), steps[-1].setpoint.v_mps if steps else 0.0
        steps.append(loop.step(sees_it_go_back(k * PERIOD_NS, k, v_mps), k * PERIOD_NS))
    assert loop.lifecycle.outcome is Outcome.BROKEN_OFF
    assert "do its motors turn the right way" in (loop.lifecycle.stop_reason or "")
    assert steps[-1].progress_m < 1.0
    assert brakes_harder_than_comfort(steps)


def test_contradiction_ends_a_governed_drive_too() -> None:
    rig = Rig()
    rig.run(2.0)
    for k in range(len(rig.steps), len(rig.steps) + 500):
        rig.steps.append(
            rig.loop.step(sees_it_go_back(k * PERIOD_NS, k, rig.steps[-1].setpoint.v_mps), k * PERIOD_NS)
        )
        if rig.loop.finished:
            break
    assert rig.loop.lifecycle.outcome is Outcome.BROKEN_OFF
    assert "do its motors turn the right way" in (rig.loop.lifecycle.stop_reason or "")
    assert brakes_harder_than_comfort(rig.steps)


@pytest.mark.parametrize("contradicted", [False, True])
def test_every_command_is_a_hard_one_only_while_the_images_contradict_the_odometry(
    contradicted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    localiser = Localiser(ORIGIN, MOUNT)
    base = DrivenBase(ObedientChassis(arms_after=0), localiser, ResponseMonitor(0.2, 1.0))
    base.begin_step(None, 0)
    base.finish_step(Setpoint(0, 0.0, 0.0, 0.0), 0)
    monkeypatch.setattr(Localiser, "contradiction", "goes elsewhere" if contradicted else "")
    assert base.begin_step(None, PERIOD_NS).hard == contradicted


def brakes_harder_than_comfort(steps: list[ControlStep]) -> bool:
    return min(one.setpoint.a_mps2 for one in steps) < -Robot().limits.max_accel_mps2 - 0.02
