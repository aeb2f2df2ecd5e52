"""An own part that is not where its box is, is told; looks at grids of known depth, a second apart."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.grids import grid_of, no_depth, wall
from tests.support.scenes import GOOD
from vision.camera.own_parts_check import OwnPartsCheck
from vision.scene import CameraCondition, CameraHealth

# Own parts have lost their depth: what has depth in their cells is farther.
IN_PLACE, FARTHER = grid_of(no_depth()), grid_of(wall(3.0))
CORES = (np.arange(100), np.arange(2000, 2100))
SECOND_NS = 1_000_000_000


def judged(looks: str, check: OwnPartsCheck | None = None, from_s: int = 0) -> CameraHealth:
    """After these looks: "." finds the parts in their places, "x" sees through both."""
    check = check or OwnPartsCheck()
    for number, look in enumerate(looks, start=from_s):
        grid = FARTHER if look == "x" else IN_PLACE
        health = check.judge(grid, ("bumper", "mast"), CORES, number * SECOND_NS, GOOD)
    return health


def test_parts_in_their_places_are_good() -> None:
    assert judged("." * 20) is GOOD


@pytest.mark.parametrize("looks", ["xxxxx", "xxxx.xxxx", "xxxxx."])
def test_what_is_seen_through_for_less_than_five_seconds_is_not_told(looks: str) -> None:
    assert judged(looks) is GOOD


def test_each_box_that_is_seen_through_for_five_seconds_is_told_with_its_name_and_share() -> None:
    health = judged("xxxxxx")
    assert health.condition is CameraCondition.DEGRADED
    assert "100% of where camera.own_parts has 'bumper' shows something farther" in health.reason
    assert "'mast'" in health.reason
    assert judged("xxxxxxx.") is GOOD


@pytest.mark.parametrize(("share", "told"), [(0.30, False), (0.31, True)])
def test_a_part_need_not_fill_its_box(share: float, told: bool) -> None:
    depth_m = no_depth()
    depth_m.ravel()[: round(100 * share)] = 3.0
    check = OwnPartsCheck()
    for second in range(7):
        health = check.judge(grid_of(depth_m), ("bumper",), CORES[:1], second * SECOND_NS, GOOD)
    assert (health is not GOOD) == told


def test_a_part_too_near_to_be_measured_is_not_judged() -> None:
    check = OwnPartsCheck()
    for second in range(7):
        health = check.judge(FARTHER, ("lens hood",), (np.arange(0),), second * SECOND_NS, GOOD)
    assert health is GOOD


def test_after_time_has_stepped_back_it_counts_anew() -> None:
    check = OwnPartsCheck()
    assert judged("xxx", check, from_s=100) is GOOD
    assert judged("xxxxx", check) is GOOD
    assert judged("x", check, from_s=5) is not GOOD
