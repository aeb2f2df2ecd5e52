"""A camera high above the robot's nose, below whose view low things sink far ahead of the robot, and one that
is lower than the robot, above whose view rises what hangs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from config.decision import DecisionConfig
from config.robot import Body, Mount, Robot
from controller.campaign.drive_log import DriveLog
from controller.campaign.judge import Row, judge
from controller.campaign.noise_mission import drive_noise
from controller.campaign.policies import build_policy
from controller.campaign.stage import Stage
from controller.campaign.task import judge_reference
from controller.decision.view_edges import CurrentView, below_or_above_view, view_from, visible_from_m
from controller.decision.world_model import WorldModel
from controller.path.path import OnPath
from hal.types import CameraMount, PlanarPose
from sim.families import generate
from tests.support.campaign import CONFIG
from tests.support.decision_bench import MOUNT, PATH, obstacle
from tests.support.floor_bodies import box
from tests.support.scenes import free_space, scene

FRAME_NS = 100_000_000
HERE, START = PlanarPose(0.0, 0.0, 0.0), OnPath(0.0, 0.0, 0.0)
LONG = Robot(
    body=Body(width_m=1.0, length_m=1.8, rear_m=0.7, height_m=1.2),
    limits=CONFIG.robot.limits,
    camera_mount=Mount(forward_m=1.0, height_m=1.1, pitch_deg=15.0),
)


def seen_from(height_m: float, near_m: float, up_tan: float) -> CurrentView:
    """The view of a camera at this height over the robot's turning centre."""
    return view_from(HERE, CameraMount(0.0, 0.0, height_m, 0.0), 0.5, near_m, up_tan)


def driven(robot: Robot, family: str, seed: int) -> tuple[Row, DriveLog]:
    """A mission with the noise model, and what became of it."""
    config = CONFIG.model_copy(update={"robot": robot})
    stage = Stage(generate(family, seed), robot)
    log = drive_noise(stage, config, build_policy("ours", config, stage))
    return judge(stage, log, "ours", "noise", judge_reference(stage, config)), log


def stops_before_it(robot: Robot, family: str, seed: int) -> bool:
    row, log = driven(robot, family, seed)
    return row.contacts == 0 and not row.reached and log.s_m[-1] > 3.0


def after_a_pallet(floor_from_m: float) -> WorldModel:
    """What is known when a pallet 1.55 m ahead of the camera is seen no longer, by a robot that drives."""
    known = WorldModel(PATH, Robot(), MOUNT, DecisionConfig(), 0.0)
    space = replace(free_space(), floor_from_m=floor_from_m)
    pallet = obstacle(2.0, 0.1, size_m=(0.5, 0.1))
    for number, seen in enumerate([(pallet,), ()]):
        known.update(scene(number * FRAME_NS, number, seen, space), HERE, START, 1.0, number * FRAME_NS)
    return known


@pytest.mark.parametrize(("floor_from_m", "near_m"), [(0.0, 1.3), (1.2, 1.3), (1.9, 1.9)])
def test_body_that_sinks_below_the_view_is_kept(floor_from_m: float, near_m: float) -> None:
    known = after_a_pallet(floor_from_m)
    assert known.view.near_m == near_m
    assert known.remembered.tolist() == ([True] if floor_from_m > 1.6 else [])


def test_where_the_view_begins_is_known_on_the_next_path_too() -> None:
    on = WorldModel(PATH, Robot(), MOUNT, DecisionConfig(), 0.0)
    on.take_over(after_a_pallet(1.9))
    assert on.view.near_m == 1.9


@pytest.mark.parametrize("seed", [6100000, 6100001, 6100003])
def test_a_long_robot_with_a_high_camera_does_not_drive_over_a_pallet(seed: int) -> None:
    """It crept up to the pallet until that was below its view, forgot it, and drove over it."""
    assert stops_before_it(LONG, "low_pallet", seed)


LOW = Robot(limits=CONFIG.robot.limits, camera_mount=Mount(height_m=0.25, pitch_deg=0.0))


def after_a_beam(up_tan: float, bottom_m: float = 0.65, ahead_m: float = 0.9) -> WorldModel:
    """What is known when a beam as wide as somebody is seen no longer, by a robot that drives."""
    known = WorldModel(PATH, Robot(), CameraMount(0.45, 0.0, 0.25, 0.0), DecisionConfig(), 0.0)
    space = replace(free_space(), up_tan=up_tan)
    beam = obstacle(0.45 + ahead_m, 0.0, size_m=(0.5, 0.2))
    beam = replace(beam, position_m=np.array([0.0, 0.25 - bottom_m - 0.1, ahead_m]))
    for number, seen in enumerate([(beam,), ()]):
        known.update(scene(number * FRAME_NS, number, seen, space), HERE, START, 1.0, number * FRAME_NS)
    return known


@pytest.mark.parametrize(
    ("up_tan", "bottom_m", "ahead_m", "kept"),
    [
        (0.39, 0.65, 0.9, True),  # the view ends at 0.56 m, where its front is
        (0.39, 0.65, 1.5, False),  # at 0.8 m
        (0.39, 0.40, 0.9, False),
        (math.inf, 0.65, 0.9, False),  # nobody knows of an upper edge
    ],
)
def test_body_that_rises_above_the_view_is_kept(
    up_tan: float, bottom_m: float, ahead_m: float, kept: bool
) -> None:
    known = after_a_beam(up_tan, bottom_m, ahead_m)
    assert known.view.up_tan == up_tan
    assert known.remembered.tolist() == ([True] if kept else [])


@pytest.mark.parametrize("seed", [6100000, 6100002])
def test_a_low_camera_does_not_forget_a_beam_that_the_robot_does_not_pass_under(seed: int) -> None:
    assert stops_before_it(LOW, "hanging_beam", seed)


def test_a_camera_at_the_height_of_what_hangs_above_the_robot_sees_the_floor_under_it() -> None:
    high = Robot(limits=CONFIG.robot.limits, camera_mount=Mount(forward_m=0.1, height_m=1.4, pitch_deg=22.0))
    assert driven(high, "hanging_beam", 6100001)[1].reached_s is not None


@pytest.mark.parametrize(("up_tan", "off_m"), [(math.inf, 0.0), (0.39, 1.28), (0.2, 2.5), (0.05, 3.0)])
def test_robot_stops_far_enough_to_see_a_hanging_body(up_tan: float, off_m: float) -> None:
    """Its underside at 0.65 m has to be 0.1 m below the upper edge of a camera at 0.25 m; 3 m at most."""
    beam = box(8.0, 0.0, top_m=0.85, bottom_m=0.65)
    found = visible_from_m(beam, np.zeros(1), seen_from(0.25, 1.3, up_tan))[0]
    assert min(found, 3.0) == pytest.approx(off_m, abs=0.01)


def test_no_view_ends_where_the_robot_is() -> None:
    """A near_m of 0: what begins behind the camera is below its view, and nothing divides by zero."""
    pallets = box(0.0, 0.0, top_m=0.15).joined(box(1.0, 0.0, top_m=0.15))
    found = below_or_above_view(pallets, np.array([-0.01, 1.0]), seen_from(0.6, 0.0, math.inf))
    assert found.tolist() == [True, False]


def test_where_a_body_can_be_seen_from() -> None:
    bodies = box(5.0, 0.6, top_m=1.7).joined(box(5.0, 0.0, top_m=0.15)).joined(box(5.0, 0.0, top_m=0.7))
    bodies = bodies.joined(box(5.0, 0.0, top_m=1.2, bottom_m=0.8))
    found = visible_from_m(bodies, np.array([0.6, 0.0, 0.0, 0.0]), seen_from(0.6, 1.3, 0.3))
    assert found.tolist() == pytest.approx([1.2, 1.3 * (1 - 0.05 / 0.6), 0.0, (0.8 + 0.1 - 0.6) / 0.3])
    assert visible_from_m(bodies, np.zeros(4), seen_from(0.6, 1.3, math.inf))[3] == 0.0
