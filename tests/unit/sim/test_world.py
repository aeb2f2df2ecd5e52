from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from config.path import LineSpec, PathSpec
from config.scenario import (
    Beam,
    BodySpec,
    Column,
    Crate,
    Go,
    MotionPlan,
    Pallet,
    Person,
    Pole,
    RobotBody,
    Scenario,
    Shelf,
    Wall,
    load_scenario,
    scenario_names,
)
from sim.world import BUILDING_ID, World

PATH = PathSpec(segments=(LineSpec(kind="line", length_m=5.0),))
WALK = MotionPlan(start_s=1.0, steps=(Go(kind="go", x_m=5.0, y_m=2.0, speed_mps=1.2),))
AT: dict[str, Any] = {"x_m": 3.0, "y_m": 1.0, "heading_deg": 30.0}


def world(*bodies: BodySpec, seed: int = 0) -> World:
    return World(Scenario(name="test", path=PATH, bodies=bodies), seed)


EVERY_KIND: tuple[BodySpec, ...] = (
    Crate(kind="crate", name="crate", **AT),
    Shelf(kind="shelf", name="shelf", **AT),
    Column(kind="column", name="column", **AT),
    Pole(kind="pole", name="pole", **AT),
    Pallet(kind="pallet", name="pallet", load_height_m=0.7, **AT),
    Wall(kind="wall", name="wall", **AT),
    Beam(kind="beam", name="beam", **AT),
    Person(kind="person", name="person", **AT),
    RobotBody(kind="robot", name="robot", load_height_m=0.4, **AT),
)


@pytest.mark.parametrize("spec", EVERY_KIND, ids=lambda spec: spec.kind)
@pytest.mark.parametrize("texture", ["fine", "coarse", "plain"])
def test_drawn_body_stays_within_its_footprint_and_height(spec: BodySpec, texture: str) -> None:
    assert_within(world(spec.model_copy(update={"texture": texture})), 0.0)


def test_a_walking_person_stays_within_it_too() -> None:
    walker = world(Person(kind="person", name="p", motion=WALK, **AT))
    for t_s in np.arange(1.0, 4.0, 0.04):
        assert_within(walker, float(t_s))


def assert_within(built: World, t_s: float) -> None:
    drawn, state = built.geometry(t_s), built.bodies(t_s)[0]
    points = drawn.corners_m[drawn.body == state.id].reshape(-1, 3)
    assert points[:, 2].min() == pytest.approx(state.z_m[0], abs=0.005)  # a wheel's sides are flat
    assert points[:, 2].max() <= state.z_m[1] + 0.03  # on tiptoe
    edges = np.roll(state.footprint_m, -1, axis=0) - state.footprint_m
    inward = np.stack([-edges[:, 1], edges[:, 0]], axis=1)
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    margins = (points[:, None, :2] - state.footprint_m[None]) @ inward.T
    assert np.diagonal(margins, axis1=1, axis2=2).min() > -0.003


@pytest.mark.parametrize("spec", EVERY_KIND, ids=lambda spec: spec.kind)
def test_faces_are_flat_convex_and_look_outwards(spec: BodySpec) -> None:
    built = world(spec.model_copy(update={"motion": WALK}))
    drawn = built.geometry(2.7)
    corners, outward = drawn.corners_m, drawn.normals
    assert np.abs(np.einsum("nkd,nd->nk", corners - corners[:, :1], outward)).max() < 1e-6
    sides = np.roll(corners, -1, axis=1) - corners
    turns = np.einsum("nkd,nd->nk", np.cross(sides, np.roll(sides, -1, axis=1)), outward)
    assert (turns < 1e-12).all()
    assert np.linalg.norm(outward, axis=1) == pytest.approx(np.ones(len(outward)))


def test_the_building_is_seen_from_the_inside() -> None:
    drawn = world().geometry(0.0)
    room = drawn.body == BUILDING_ID
    middle = np.array([10.0, 0.0, 2.0])
    assert (((middle - drawn.corners_m[room, 0]) * drawn.normals[room]).sum(axis=1) > 0).all()


def test_geometry_is_a_function_of_time_alone() -> None:
    first, second = (world(*EVERY_KIND[:2], Person(kind="person", name="p", motion=WALK, **AT)) for _ in "ab")
    later = first.geometry(3.3)
    first.geometry(0.2)
    assert np.array_equal(first.geometry(3.3).corners_m, later.corners_m)
    assert np.array_equal(second.geometry(3.3).corners_m, later.corners_m)


def test_pose_of_a_standing_body_does_not_depend_on_earlier_queries() -> None:
    scenario = load_scenario("warehouse")
    one = World(scenario, seed=1)
    # Before they start, on their way, in between, again, and long after they have arrived.
    for t_s in (0.0, 0.1, 4.0, 14.0, 14.1, 4.0, 0.0, 88.0, 89.0, 14.0):
        assert (
            one.geometry(t_s).corners_m.tobytes() == World(scenario, seed=1).geometry(t_s).corners_m.tobytes()
        )


def test_footprint_and_velocity_go_with_the_body() -> None:
    walker = world(Person(kind="person", name="p", motion=WALK, **AT))
    before, after = walker.bodies(2.5)[0], walker.bodies(2.501)[0]
    assert (after.footprint_m - before.footprint_m) / 0.001 == pytest.approx(
        np.tile(before.velocity_mps, (8, 1)), abs=1e-6
    )
    assert np.linalg.norm(before.velocity_mps) == pytest.approx(1.2)
    assert before.moves


def test_limbs_swing_with_the_distance_walked_and_rest_when_standing() -> None:
    walker = world(Person(kind="person", name="p", motion=WALK, **AT))
    assert np.array_equal(walker.geometry(0.0).corners_m, walker.geometry(0.9).corners_m)
    mine = walker.geometry(0.0).body == 1
    shapes = []
    for t_s in (2.3, 2.5):
        state = walker.bodies(t_s)[0]
        offset = np.array([state.pose.x_m, state.pose.y_m, 0.0])
        shapes.append(walker.geometry(t_s).corners_m[mine] - offset)
    assert np.abs(shapes[0] - shapes[1]).max() > 0.05


def test_wheels_roll_without_slipping() -> None:
    drive = MotionPlan(accel_mps2=10.0, steps=(Go(kind="go", x_m=9.0, y_m=0.0, speed_mps=1.0),))
    robot = world(RobotBody(kind="robot", name="r", x_m=0.0, y_m=0.0, motion=drive))
    drawn = [robot.geometry(t_s) for t_s in (2.0, 2.0 + 1e-4)]
    mine = drawn[0].body == 1
    rate = (drawn[1].corners_m[mine] - drawn[0].corners_m[mine]) / 1e-4
    # The hull moves at 1 m/s, the top of a wheel at 2, the point that touches the floor not at all
    # (a wheel of twelve sides has corners that far up and down within 4 percent).
    assert np.median(rate[..., 0]) == pytest.approx(1.0, abs=1e-6)
    assert rate[..., 0].min() == pytest.approx(0.0, abs=0.05)
    assert rate[..., 0].max() == pytest.approx(2.0, abs=0.05)


def test_jitter_shifts_the_start_by_the_seed() -> None:
    plan = WALK.model_copy(update={"start_jitter_s": 0.9})
    places = {
        world(Person(kind="person", name="p", motion=plan, **AT), seed=seed).bodies(2.0)[0].pose.x_m
        for seed in range(5)
    }
    assert len(places) == 5


@pytest.mark.parametrize("name", scenario_names())
def test_shipped_scenarios_start_without_contact(name: str) -> None:
    scenario = load_scenario(name)
    room = scenario.room
    for t_s in np.arange(0.0, 60.0, 2.5):
        for state in World(scenario).bodies(float(t_s)):
            low, high = state.footprint_m.min(axis=0), state.footprint_m.max(axis=0)
            assert low[0] > room.x_min_m, state.name
            assert low[1] > room.y_min_m, state.name
            assert high[0] < room.x_max_m, state.name
            assert high[1] < room.y_max_m, state.name
