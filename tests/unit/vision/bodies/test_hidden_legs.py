"""Who is seen above the robot only, the rest hidden or beside the view: reported once it moves."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from hal.types import FloatArray, PlanarPose
from tests.support.grids import block, grid_of, labelled, wall
from tests.support.painted import QVGA, Quad, box, drive, record, vector
from tests.support.painted_room import SIDEWAYS, TOWARDS, look, room
from vision.depth.occlusion import hidden_below
from vision.depth.regions import measure
from vision.scene import Obstacle

SCREEN = box(vector(2.0, 0.0, 0.0), vector(0.3, 2.6, 0.9), 20)  # as high as the robot
BODY_M = vector(0.4, 0.6, 1.9)
AT_M = vector(4.2, 0.3, 0.0)


def behind_the_screen(velocity_mps: FloatArray | None, frames: int = 14) -> list[Obstacle]:
    """What is listed between the screen and the wall in the last frame."""
    body = box(AT_M, BODY_M, 10, velocity_mps)
    scene = look(record(room() + SCREEN + body, drive(), frames, QVGA), True)[-1].scene
    return [one for one in scene.obstacles if 3.0 < one.position_m[2] < 6.0]


@pytest.mark.parametrize("velocity_mps", [TOWARDS, SIDEWAYS])
def test_walker_behind_a_screen_is_listed_by_the_upper_part(velocity_mps: FloatArray) -> None:
    (walker,) = behind_the_screen(velocity_mps)
    assert walker.moving
    level = vector(-velocity_mps[1], 0.0, velocity_mps[0])
    np.testing.assert_allclose(walker.velocity_mps, level, atol=0.25)


def test_person_who_stands_behind_a_screen_is_not_listed() -> None:
    """Nor need it be: the screen is in the way before it."""
    assert behind_the_screen(None) == []


def test_standing_person_is_listed_once_the_screen_is_gone() -> None:
    """The screen goes aside: then what was above the robot only reaches down to the floor."""
    screen = box(vector(2.0, 0.0, 0.0), vector(0.3, 1.2, 0.9), 20, vector(0.0, 1.5, 0.0))
    scene = look(record(room() + screen + box(AT_M, BODY_M, 10), drive(), 36, QVGA), True)[-1].scene
    (one,) = (one for one in scene.obstacles if 3.0 < one.position_m[2] < 6.0)
    assert not one.moving


def test_the_lower_end_is_hidden_by_what_is_nearer_only() -> None:
    labels = labelled(block((2, 12), (10, 20)))
    for beneath_m, hides in ((2.0, True), (6.0, False), (3.9, False)):
        depth = wall(4.0)
        depth[12:] = beneath_m
        grid = grid_of(depth)
        assert hidden_below(grid, labels, measure(grid, labels, 1)).tolist() == [hides]


def test_half_of_its_width_has_to_be_hidden() -> None:
    labels = labelled(block((2, 12), (10, 20)))
    for columns, hides in ((slice(10, 17), True), (slice(10, 13), False)):
        depth = wall(4.0)
        depth[12:] = 6.0
        depth[12:, columns] = 2.0
        grid = grid_of(depth)
        assert hidden_below(grid, labels, measure(grid, labels, 1)).tolist() == [hides]


def test_across_the_gap_beside_a_jump_the_nearer_one_is_found() -> None:
    """A stereo camera measures nothing for some cells before what is nearer."""
    labels = labelled(block((2, 12), (10, 20)))
    for gap, hides in ((2, True), (3, False)):
        depth = wall(4.0)
        depth[12 : 12 + gap] = 0.0
        depth[12 + gap :] = 2.0
        grid = grid_of(depth)
        assert hidden_below(grid, labels, measure(grid, labels, 1)).tolist() == [hides]


def test_a_strip_is_nobody() -> None:
    """Three rows at 4 m are 16 cm."""
    labels = labelled(block((9, 12), (10, 20)))
    depth = wall(4.0)
    depth[12:] = 2.0
    grid = grid_of(depth)
    assert hidden_below(grid, labels, measure(grid, labels, 1)).tolist() == [False]


ARM_M = vector(0.2, 0.4, 0.22)


def above_the_robot(
    arm: list[Quad], frames: int, way: Callable[[float], PlanarPose] | None = None
) -> list[list[Obstacle]]:
    """What is listed nearer than 2.5 m, in each frame."""
    looks = look(record(room() + arm, way or drive(), frames, QVGA), True)
    return [[one for one in seen.scene.obstacles if one.position_m[2] < 2.5] for seen in looks]


def test_an_arm_that_comes_into_the_view_is_somebody() -> None:
    """0.9 m above the floor, whereas the robot is 0.8 m high; the rest of them is still beside the view."""
    listed = above_the_robot(box(vector(1.6, 1.2, 0.9), ARM_M, 10, vector(0.0, -0.9, 0.0)), 20)
    assert not any(listed[:6])
    entered = next(k for k, seen in enumerate(listed) if seen)
    assert entered <= 14
    assert all(one.moving for seen in listed for one in seen)
    assert all(len(seen) == 1 for seen in listed[entered:])


def test_object_above_the_robot_is_not_listed_however_it_comes_into_view() -> None:
    """Nor where the robot turns towards it, or drives up to it."""
    hanging = box(vector(1.6, 1.1, 0.9), ARM_M, 10)
    assert not any(above_the_robot(hanging, 20))
    assert not any(above_the_robot(hanging, 20, drive(0.0, 0.5)))
    assert not any(above_the_robot(box(vector(2.2, 0.2, 0.9), ARM_M, 10), 20, drive(1.0)))


@pytest.mark.parametrize(
    ("front_m", "velocity_mps"),
    [
        (vector(1.6, 0.3, 0.9), 0.5 * SIDEWAYS),  # in the middle of the view: a load on its way
        (vector(3.0, 0.3, 1.3), TOWARDS),
        (vector(4.5, 2.75, 2.02), SIDEWAYS),  # from the side, higher than people
    ],
)
def test_load_that_moves_above_the_robot_is_not_listed(front_m: FloatArray, velocity_mps: FloatArray) -> None:
    load = box(front_m, vector(0.3, 0.6, 0.25), 10, velocity_mps)
    looks = look(record(room() + load, drive(), 40, QVGA), True)
    assert [one for seen in looks for one in seen.scene.obstacles if one.position_m[2] < 5.5] == []
