"""A vehicle that has driven and stands, or creeps, may swing its ends towards the robot."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from controller.decision.bodies import Bodies, no_bodies
from controller.decision.nearer_boxes import extended_nearer
from controller.decision.turning_vehicles import TurningVehicles
from controller.decision.view_edges import view_from
from hal.clocks import NS_PER_S
from hal.types import PlanarPose
from tests.support.decision_bench import MOUNT
from tests.support.floor_bodies import box

ALLOWED_M, FRONT_M = 0.25, 0.6
VIEW = view_from(PlanarPose(0.0, 0.0, 0.0), MOUNT, edge_tan=0.69, near_m=0.5, up_tan=0.4)
HALF_LENGTH_M = 1.2  # a fork lift, as seen from the side
SWING_M = 0.63 * HALF_LENGTH_M - ALLOWED_M


def seen(
    now_s: float,
    mps: float = 0.0,
    half_across_m: float = HALF_LENGTH_M,
    track_id: int = 1,
    left_m: float = 0.0,
) -> Bodies:
    """A vehicle across the way, 4 m ahead, that drives at mps."""
    captured_ns = round(now_s * NS_PER_S)
    return box(
        4.0,
        left_m,
        0.0,
        mps,
        number=track_id,
        half_view_m=0.5,
        half_across_m=half_across_m,
        captured_ns=captured_ns,
    )


def swing_m(vehicles: TurningVehicles, scene: Bodies) -> list[float]:
    swings: list[float] = vehicles.swing_m(scene, VIEW).tolist()
    return swings


def swing_after(*scenes: Bodies) -> float:
    vehicles = TurningVehicles(ALLOWED_M)
    return [swing_m(vehicles, scene)[0] for scene in scenes][-1]


def test_a_vehicle_that_has_just_stopped_may_swing_beyond_the_margin() -> None:
    assert swing_after(seen(0.0, 1.0), seen(1.0, 1.0), seen(1.1)) == pytest.approx(SWING_M)


@pytest.mark.parametrize(("half_length_m", "half_width_m"), [(1.2, 0.575), (2.15, 0.9)])
def test_the_swing_is_that_of_a_rectangle_about_its_middle(half_length_m: float, half_width_m: float) -> None:
    """From its flank to the circle through its corners: a fork lift of 2.4 x 1.15 m, a car of 4.3 x 1.8 m."""
    scenes = seen(0.0, 1.0, half_length_m), seen(1.0, 1.0, half_length_m), seen(1.1, 0.0, half_length_m)
    comes_nearer_m = math.hypot(half_length_m, half_width_m) - half_width_m
    assert swing_after(*scenes) + ALLOWED_M == pytest.approx(comes_nearer_m, abs=0.08)


@pytest.mark.parametrize("mps", [0.0, 0.5, -0.5])
def test_it_may_while_it_creeps(mps: float) -> None:
    assert swing_after(seen(0.0, 1.0), seen(1.0, 1.0), seen(1.1, mps)) == pytest.approx(SWING_M)


def test_one_that_drives_goes_where_it_is_seen_to_go() -> None:
    assert swing_after(seen(0.0, 1.0), seen(1.0, 1.0)) == 0.0


def test_a_crate_that_never_moved_does_not_turn() -> None:
    assert swing_after(seen(0.0), seen(1.0), seen(2.0)) == 0.0


def test_what_seemed_to_move_for_some_frames_does_not_turn() -> None:
    assert swing_after(seen(0.0), seen(0.1, 1.0), seen(0.9, 1.0), seen(1.0)) == 0.0


def test_a_motion_that_was_broken_off_counts_anew() -> None:
    assert (
        swing_after(seen(0.0, 1.0), seen(0.6, 1.0), seen(0.7), seen(0.8, 1.0), seen(1.6, 1.0), seen(1.7))
        == 0.0
    )


@pytest.mark.parametrize("half_m", [0.45, 0.62])
def test_a_person_two_people_and_a_small_robot_turn_within_the_margin(half_m: float) -> None:
    assert swing_after(seen(0.0, 1.0, half_m), seen(1.0, 1.0, half_m), seen(1.1, 0.0, half_m)) == 0.0


def test_one_that_has_stood_for_five_seconds_is_not_turning() -> None:
    stood = [seen(1.0 + t, 0.0) for t in (1.0, 2.0, 3.0, 4.0, 4.9)]
    assert swing_after(seen(0.0, 1.0), seen(1.0, 1.0), *stood) > 0.0
    assert swing_after(seen(0.0, 1.0), seen(1.0, 1.0), *stood, seen(6.1)) == 0.0


def test_its_length_is_remembered_while_it_turns_end_on() -> None:
    """Half way round, the robot sees its end. As it turns on, the other end comes nearer."""
    turning = seen(0.0, 1.0), seen(1.0, 1.0), seen(1.2), seen(2.0, 0.0, 0.8), seen(4.0, 0.0, 0.8)
    assert swing_after(*turning) == pytest.approx(SWING_M)
    assert swing_after(*turning, seen(4.4, 0.0, 0.8)) == pytest.approx(0.63 * 0.8 - ALLOWED_M)


AHEAD_M = 4.0 - MOUNT.forward_m


def at_edge(now_s: float, mps: float = 0.0, half_across_m: float = 0.55, side: int = 1) -> Bodies:
    """What is seen of a vehicle that a side edge of the view cuts."""
    return seen(now_s, mps, half_across_m, left_m=side * (VIEW.edge_tan * AHEAD_M - half_across_m))


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize(
    ("half_across_m", "half_length_m"), [(0.39, 0.0), (0.41, 0.82), (0.55, 1.1), (0.7, 1.2), (1.5, 1.5)]
)
def test_of_one_that_the_edge_of_the_view_cuts_half_may_be_seen(
    half_across_m: float, half_length_m: float, side: int
) -> None:
    """As long as a vehicle in a hall, unless more of it is seen; less than 0.8 m of it is a person."""
    scenes = (at_edge(t, mps, half_across_m, side) for t, mps in ((0.0, 1.0), (1.0, 1.0), (1.1, 0.0)))
    expected_m = max(0.63 * half_length_m - ALLOWED_M, 0.0)
    assert swing_after(*scenes) == pytest.approx(expected_m)


def test_its_length_is_a_guess_until_both_ends_are_seen() -> None:
    driven = at_edge(0.0, 1.0), at_edge(1.0, 1.0)
    assert swing_after(*driven, at_edge(1.1, 0.0, 0.3)) == pytest.approx(0.63 * 1.1 - ALLOWED_M)
    assert swing_after(*driven, at_edge(1.1), seen(1.2, 0.0, 0.6)) == 0.0
    assert swing_after(*driven, at_edge(1.1), seen(1.2, 0.0, 0.7)) == pytest.approx(0.63 * 0.7 - ALLOWED_M)


def test_one_that_leaves_the_view_is_as_long_as_it_was_seen() -> None:
    """Unless more of it shows at the edge of the view than was seen before, behind something."""
    driven = seen(0.0, 1.0, 0.5), seen(1.0, 1.0, 0.5)
    assert swing_after(*driven, at_edge(1.1)) == 0.0
    assert swing_after(*driven, at_edge(1.1, 0.0, 0.62)) == pytest.approx(0.63 * 1.2 - ALLOWED_M)


def test_a_track_that_begins_where_it_was_is_taken_for_it() -> None:
    """Even if nothing was seen of it meanwhile, for as long as it may be turning."""
    driven = seen(0.0, 1.0), seen(1.0, 1.0)
    half = seen(2.5, 0.0, 0.6, track_id=2)
    assert swing_after(*driven, half) == pytest.approx(SWING_M)
    nothing = [no_bodies(round(now_s * NS_PER_S)) for now_s in (1.5, 2.0)]
    vehicles = TurningVehicles(ALLOWED_M)
    for scene in (*driven, *nothing):
        swing_m(vehicles, scene)
    assert swing_m(vehicles, half)[0] == pytest.approx(SWING_M)
    assert swing_m(vehicles, seen(6.1, 0.0, track_id=3))[0] == 0.0


def test_a_track_that_begins_elsewhere_is_another_thing() -> None:
    elsewhere = replace(seen(1.1, track_id=2), xy_m=np.array([[4.0, -1.3]]))
    assert swing_after(seen(0.0, 1.0), seen(1.0, 1.0), elsewhere) == 0.0


def test_its_box_is_extended_towards_the_robot() -> None:
    near = extended_nearer(seen(0.0), np.array([SWING_M]), VIEW, FRONT_M)
    assert float(near.xy_m[0, 0] - near.half_view_m[0]) == pytest.approx(3.5 - SWING_M)
    assert float(near.xy_m[0, 0] + near.half_view_m[0]) == pytest.approx(4.5)


def test_it_is_not_extended_to_what_the_front_has_passed() -> None:
    """The conflict with a body that begins behind the robot's front is dropped: its front is past it."""
    near = extended_nearer(seen(0.0), np.array([SWING_M]), replace(VIEW, x_m=2.5), FRONT_M)
    assert float(near.xy_m[0, 0] - near.half_view_m[0]) == pytest.approx(2.5 + FRONT_M + 0.3)
    beside = extended_nearer(seen(0.0), np.array([SWING_M]), replace(VIEW, x_m=3.0), FRONT_M)
    assert float(beside.xy_m[0, 0] - beside.half_view_m[0]) == 3.5


def test_who_steps_out_before_a_wide_crate_is_not_as_wide() -> None:
    """He begins where the crate is seen, which never moved, walks for a second and stops."""
    walks = [seen(now_s, 1.0, 0.3, track_id=2) for now_s in (1.0, 2.0)]
    assert swing_after(seen(0.0), *walks, seen(2.1, 0.0, 0.3, track_id=2)) == 0.0


def test_only_vehicles_that_may_turn_are_remembered_out_of_sight() -> None:
    vehicles = TurningVehicles(ALLOWED_M)
    person = replace(seen(0.5, 1.0, 0.3, track_id=2), xy_m=np.array([[9.0, 0.0]]))
    for scene in (person, seen(1.0, 1.0), seen(2.0, 1.0)):
        swing_m(vehicles, scene)
    swing_m(vehicles, no_bodies(round(2.1 * NS_PER_S)))
    assert vehicles._tracks.ids.tolist() == [1]
    swing_m(vehicles, no_bodies(round(7.1 * NS_PER_S)))
    assert vehicles._tracks.ids.tolist() == []
