from __future__ import annotations

import math

import pytest

from config.path import LineSpec, PathSpec
from config.robot import Body
from config.scenario import Beam, BodySpec, Column, Crate, Go, MotionPlan, Pallet, Room, Scenario
from hal.types import PlanarPose
from sim.contact import nearest_body, robot_footprint
from sim.world import World

ROBOT = Body()  # 0.78 wide, 1.02 long, 0.51 behind the centre, 0.80 high, 0.05 clear
HERE = PlanarPose(0.0, 0.0, 0.0)
PATH = PathSpec(segments=(LineSpec(kind="line", length_m=5.0),))


def world(*bodies: BodySpec) -> World:
    return World(Scenario(name="test", path=PATH, bodies=bodies))


def test_robot_rectangle_turns_about_its_turning_centre() -> None:
    body = Body(width_m=0.8, length_m=1.0, rear_m=0.3)
    corners = robot_footprint(body, PlanarPose(2.0, 1.0, math.pi / 2))
    # Heading along y: 0.7 ahead, 0.3 behind, 0.4 to both sides.
    assert corners.min(axis=0) == pytest.approx([1.6, 0.7])
    assert corners.max(axis=0) == pytest.approx([2.4, 1.7])


def test_clearance_to_a_crate_ahead_by_hand() -> None:
    crate = Crate(kind="crate", name="crate", x_m=2.0, y_m=0.0, length_m=0.6, width_m=0.6)
    found = nearest_body(world(crate), ROBOT, HERE, 0.0)
    assert found.name == "crate"
    assert found.distance_m == pytest.approx(2.0 - 0.3 - 0.51)
    assert not found.touches


def test_clearance_to_a_turned_crate_by_hand() -> None:
    crate = Crate(kind="crate", name="c", x_m=2.0, y_m=0.0, heading_deg=45.0, length_m=0.6, width_m=0.6)
    expected = 2.0 - 0.3 * math.sqrt(2.0) - 0.51
    assert nearest_body(world(crate), ROBOT, HERE, 0.0).distance_m == pytest.approx(expected)


def test_the_nearest_of_several_is_named() -> None:
    near = Column(kind="column", name="near", x_m=0.0, y_m=1.0, diameter_m=0.4, sides=4)
    far = Crate(kind="crate", name="far", x_m=3.0, y_m=0.0)
    found = nearest_body(world(far, near), ROBOT, HERE, 0.0)
    # Four sides on a circle of 0.2: their flat face is 0.2 cos 45 degrees from the middle.
    assert found.name == "near"
    assert found.distance_m == pytest.approx(1.0 - 0.39 - 0.2 * math.cos(math.pi / 4))


def test_bodies_that_overlap_touch() -> None:
    crate = Crate(kind="crate", name="crate", x_m=0.7, y_m=0.0, length_m=0.6, width_m=0.6)
    found = nearest_body(world(crate), ROBOT, HERE, 0.0)
    assert found.touches
    assert found.distance_m == pytest.approx(-0.11)


@pytest.mark.parametrize(("z_m", "touches"), [(0.85, False), (0.79, True), (0.0, True)])
def test_a_beam_counts_only_below_the_robots_top(z_m: float, touches: bool) -> None:
    beam = Beam(kind="beam", name="beam", x_m=0.0, y_m=0.0, z_m=z_m)
    assert nearest_body(world(beam), ROBOT, HERE, 0.0).touches is touches


@pytest.mark.parametrize(("height_m", "touches"), [(0.04, False), (0.144, True)])
def test_body_lower_than_the_clearance_can_be_driven_over(height_m: float, touches: bool) -> None:
    pallet = Pallet(kind="pallet", name="pallet", x_m=0.0, y_m=0.0, height_m=height_m)
    assert nearest_body(world(pallet), ROBOT, HERE, 0.0).touches is touches


def test_the_buildings_walls_count() -> None:
    scenario = Scenario(name="test", path=PATH, room=Room(x_min_m=-1.0, x_max_m=9.0, y_min_m=-5, y_max_m=5))
    found = nearest_body(World(scenario), ROBOT, HERE, 0.0)
    assert found.name == "building"
    assert found.distance_m == pytest.approx(1.0 - 0.51)


def test_movers_are_taken_where_they_are_at_that_time() -> None:
    plan = MotionPlan(accel_mps2=1.0, steps=(Go(kind="go", x_m=1.5, y_m=0.0, speed_mps=1.0),))
    cart = Crate(kind="crate", name="cart", x_m=4.0, y_m=0.0, heading_deg=180.0, motion=plan)
    moving = world(cart)
    # 2.5 m: 1 s up, 1.5 s even, 1 s down.
    assert nearest_body(moving, ROBOT, HERE, 2.0).distance_m == pytest.approx(4.0 - 1.5 - 0.3 - 0.51)
    assert nearest_body(moving, ROBOT, HERE, 9.0).distance_m == pytest.approx(1.5 - 0.3 - 0.51)
