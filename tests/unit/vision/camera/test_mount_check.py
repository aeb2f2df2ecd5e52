"""A camera that is not where its mounting says."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hal.types import FloatArray
from tests.support.grids import grid_of, nearest, no_depth, plane, plate, wall
from tests.support.scenes import GOOD
from vision.camera.mount_check import MountCheck
from vision.scene import CameraCondition, CameraHealth

HALF_S = 500_000_000
HEIGHT_M = 0.6


def up(pitch_deg: float) -> FloatArray:
    """The world's up in the axes of a camera that looks down by so much."""
    return np.array([0.0, -math.cos(math.radians(pitch_deg)), -math.sin(math.radians(pitch_deg))])


def floor(pitch_deg: float = 4.0, height_m: float = HEIGHT_M) -> FloatArray:
    return plane(up(pitch_deg), height_m)


def judged(*depths_m: FloatArray, check: MountCheck | None = None, first: int = 0) -> CameraHealth:
    """After looks at these, half a second apart, by a camera that should look down by 4 degrees."""
    check = check or MountCheck()
    for number, depth_m in enumerate(depths_m, start=first):
        health = check.judge(grid_of(depth_m, up(4.0), HEIGHT_M), number * HALF_S, GOOD)
    return health


def test_a_camera_in_its_place_is_good() -> None:
    assert judged(*[floor()] * 8) is GOOD


@pytest.mark.parametrize("pitch_deg", [-8.0, 20.0])
def test_a_pitch_that_is_plainly_wrong_is_told_with_the_right_one(pitch_deg: float) -> None:
    health = judged(*[floor(pitch_deg)] * 3)
    assert health.condition is CameraCondition.DEGRADED
    assert f"the camera is 0.60 m high and looks down by {pitch_deg:.1f} degrees" in health.reason


@pytest.mark.parametrize("height_m", [0.9, 0.38])
def test_a_wrong_height_is_noticed(height_m: float) -> None:
    reason = judged(*[floor(height_m=height_m)] * 3).reason
    assert f"the camera is {height_m:.2f} m high" in reason
    assert reason.endswith("is its mounting right?")


@pytest.mark.parametrize("factor", [0.2, 5.0])
def test_depth_in_another_unit_is_noticed(factor: float) -> None:
    reason = judged(*[floor(height_m=factor * HEIGHT_M)] * 3).reason
    assert f"the camera is {factor * HEIGHT_M:.2f} m high" in reason
    assert reason.endswith("is the unit of its depth right?")


@pytest.mark.parametrize(
    ("pitch_deg", "height_m", "told"),
    [
        (2.2, 0.6, True),
        (6.0, 0.6, True),
        (3.0, 0.6, False),
        (5.2, 0.6, False),
        (4.0, 0.66, True),
        (4.0, 0.53, True),
        (4.0, 0.63, False),
    ],
)
def test_a_little_is_told_where_five_looks_say_the_same(
    pitch_deg: float, height_m: float, told: bool
) -> None:
    seen = floor(pitch_deg, height_m)
    assert judged(*[seen] * 4) is GOOD
    health = judged(*[seen] * 5)
    assert (health.condition is CameraCondition.DEGRADED) is told
    if told:
        assert f"is {height_m:.2f} m high and looks down by {pitch_deg:.1f} degrees" in health.reason


def test_slopes_are_never_the_same_for_long() -> None:
    """The robot comes nearer to a ramp, and then is on it."""
    assert judged(*[floor(pitch) for pitch in (7.0, 7.5, 8.0, 8.5, 4.0, 1.0, 1.8, 2.4)]) is GOOD


def test_two_looks_are_no_reason_yet() -> None:
    assert judged(*[floor(20.0)] * 2) is GOOD
    assert judged(floor(), floor(20.0), floor(), floor(20.0), floor()) is GOOD


def test_a_table_over_a_floor_in_its_place_is_a_table() -> None:
    """Its top is the lowest plane on one side; the floor beside it lies where it should."""
    table = np.where(np.arange(80) < 30, plane(up(4.0), 0.25), 0.0)
    assert judged(*[nearest(floor(), table)] * 8) is GOOD


def test_mounting_is_not_judged_without_a_visible_floor() -> None:
    before_a_wall = nearest(wall(1.0), plate(0.9, (-1.0, 1.0), (-1.0, 1.0)))
    assert judged(*[before_a_wall, no_depth()] * 4) is GOOD


def test_confirmed_mounting_is_checked_every_five_seconds() -> None:
    check = MountCheck()
    assert judged(*[floor()] * 5, check=check) is GOOD
    # Knocked askew: three looks, five seconds until the first of them, half a second to the others.
    assert judged(*[floor(20.0)] * 11, check=check, first=5) is GOOD
    assert judged(*[floor(20.0)] * 20, check=check, first=16).condition is CameraCondition.DEGRADED


def test_newest_floor_is_told_with_height_pitch_and_roll_wherever_it_is() -> None:
    check = MountCheck()
    assert check.floor is None
    leaning = up(7.0)
    roll_rad = math.radians(3.0)  # to its right: the world's up leans to the left of the image
    leaning[0], leaning[1] = leaning[1] * math.sin(roll_rad), leaning[1] * math.cos(roll_rad)
    judged(floor(4.0), plane(leaning, 0.52), no_depth(), check=check)
    found = check.floor
    assert found is not None
    assert found.captured_ns == HALF_S, "the last look has found none"
    assert found.camera_height_m == pytest.approx(0.52, abs=0.005)
    assert math.degrees(found.pitch_rad) == pytest.approx(7.0, abs=0.1)
    assert math.degrees(found.roll_rad) == pytest.approx(3.0, abs=0.1)
