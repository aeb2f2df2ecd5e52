"""The simulated set: what it must hold, and that movers and robot go where they are said to go."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.scenario import Person
from controller.evaluation.simulated_set.scenes import Mover, build, side_by_side
from controller.evaluation.simulated_set.scripted_drive import SLIPPING, Knot, OdometryError, ScriptedDrive
from controller.evaluation.simulated_set.sequences import Sequence, arc, sequences, straight
from controller.evaluation.simulated_set.simulate import build_world
from hal.geometry import body_in_floor

EXACT = OdometryError(1.0, 1.0, 0.0)
ALL = sequences()


def test_at_least_24_sequences_with_names_and_seeds_of_their_own() -> None:
    assert len(ALL) >= 24
    assert len({one.name for one in ALL}) == len({one.seed for one in ALL}) == len(ALL)


def test_both_splits_hold_movers_and_still_scenes_and_both_noises() -> None:
    for split in ("tuning", "reporting"):
        own = [one for one in ALL if one.split == split]
        assert {one.noise for one in own} == {"realsense", "paper"}
        assert {one.static for one in own} == {True, False}
    assert sum(one.split == "reporting" for one in ALL) > len(ALL) / 2


def test_every_kind_of_drive_is_there() -> None:
    steady = {one.course[0].v_mps for one in ALL if len(one.course) == 1 and one.course[0].w_radps == 0.0}
    assert steady >= {0.0, 0.5, 1.0, 1.5}
    assert max(abs(knot.w_radps) for one in ALL for knot in one.course) == 0.5
    assert any(one.vibration_deg > 0.0 for one in ALL)
    assert any(one.error.yaw_ratio == pytest.approx(1.1) for one in ALL)
    assert any(one.course[-1].v_mps > one.course[0].v_mps for one in ALL)
    courses = {mover.course_deg for one in ALL for mover in one.movers}
    assert courses >= {90.0, -90.0, 180.0, 0.0}
    assert {mover.kind for one in ALL for mover in one.movers} == {"person", "robot", "cart"}


def test_a_straight_and_a_round_course() -> None:
    assert ScriptedDrive(straight(1.5), 4.0, EXACT).pose(2.0).x_m == pytest.approx(3.0)
    round_ = ScriptedDrive(arc(0.8, 0.5), 4.0, EXACT).pose(math.pi)
    assert (round_.x_m, round_.y_m) == pytest.approx((1.6, 1.6), abs=1e-6)
    assert round_.heading_rad == pytest.approx(math.pi / 2)


def test_speed_between_knots_is_linear() -> None:
    drive = ScriptedDrive((Knot(0.0, 0.0), Knot(4.0, 1.2)), 4.0, EXACT)
    assert drive.twist(1.0)[0] == pytest.approx(0.3)
    assert drive.pose(4.0).x_m == pytest.approx(2.4, abs=1e-6)


def test_slipping_odometry_tells_a_tenth_more_of_the_turn() -> None:
    drive = ScriptedDrive(arc(0.8, 0.5), 4.0, SLIPPING)
    told = drive.odometry(2.0).heading_rad
    assert told == pytest.approx(1.1 * 1.0 + 0.02 * 2.0)
    assert drive.pose(2.0).heading_rad == pytest.approx(1.0)


def test_a_mover_goes_through_its_point_at_its_time() -> None:
    drive = ScriptedDrive(arc(0.8, 0.4), 4.0, EXACT)
    mover = Mover("person", ahead_m=4.0, left_m=0.5, course_deg=90.0, speed_mps=1.2, at_s=2.0)
    scenario = build("case", "hall", drive, [mover], 4.0, seed=9)
    sequence = Sequence("case", "tuning", arc(0.8, 0.4), (mover,), "hall", "paper", 9, EXACT)
    body = build_world(sequence).bodies(2.0)[0]
    robot = drive.pose(2.0)
    x_m, y_m, _ = body_in_floor(robot).apply(np.array([4.0, 0.5, 0.0])).tolist()
    # It takes some hundredths of a second to come up to speed.
    assert (body.pose.x_m, body.pose.y_m) == pytest.approx((x_m, y_m), abs=0.05)
    assert np.hypot(*body.velocity_mps) == pytest.approx(1.2)
    assert scenario.bodies[0].name == "person 1"


def test_starting_and_stopping_movers() -> None:
    drive = ScriptedDrive(straight(0.0), 4.0, EXACT)
    mover = Mover("person", 4.0, 0.0, 90.0, 1.0, at_s=2.0, starts_s=1.0, stops_s=3.0)
    sequence = Sequence("case", "tuning", straight(0.0), (mover,), "hall", "paper", 9, EXACT)
    world = build_world(sequence)
    speeds = [float(np.hypot(*world.bodies(t_s)[0].velocity_mps)) for t_s in (0.9, 2.0, 4.0)]
    assert speeds == pytest.approx([0.0, 1.0, 0.0])
    assert drive.pose(4.0).x_m == 0.0


def test_a_group_walks_abreast() -> None:
    ahead = side_by_side(Mover("person", 5.0, 0.0, 180.0, 1.0), 3)
    assert [one.left_m for one in ahead] == pytest.approx([0.0, 0.75, 1.5])
    across = side_by_side(Mover("person", 5.0, 0.0, 90.0, 1.0), 2)
    assert [one.ahead_m for one in across] == pytest.approx([5.0, 5.75])
    staggered = side_by_side(Mover("person", 5.0, 0.0, -90.0, 1.0), 2, stagger_m=0.4)
    assert [one.left_m for one in staggered] == pytest.approx([0.0, 0.4])


@pytest.mark.parametrize("one", ALL, ids=lambda one: one.name)
def test_movers_stay_in_the_room_and_clear_of_robot_and_clutter(one: Sequence) -> None:
    scenario, drive = one.scenario(), one.drive()
    assert scenario == one.scenario()
    world = build_world(one)
    still = [
        body for body, spec in zip(world.bodies(0.0), scenario.bodies, strict=True) if not body.moves
        and spec.kind != "beam"
    ]  # fmt: skip
    room = scenario.room
    for t_s in np.linspace(0.0, one.duration_s, 9):
        robot = drive.pose(float(t_s))
        for body in world.bodies(float(t_s)):
            if not body.moves:
                continue
            assert room.x_min_m < body.pose.x_m < room.x_max_m
            assert room.y_min_m < body.pose.y_m < room.y_max_m
            assert math.dist((robot.x_m, robot.y_m), (body.pose.x_m, body.pose.y_m)) > 0.9
            for other in still:
                gaps = np.hypot(*(other.footprint_m - (body.pose.x_m, body.pose.y_m)).T)
                assert gaps.min() > 0.3


def test_people_differ_in_clothes_and_height() -> None:
    people = [body for one in ALL for body in one.scenario().bodies if isinstance(body, Person)]
    assert {person.texture for person in people} == {"fine", "coarse", "plain"}
    assert len({person.height_m for person in people}) > 1
