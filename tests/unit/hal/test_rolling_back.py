"""A base that rolls back, which no command of ours makes it do."""

from __future__ import annotations

import math

import pytest

from hal.chassis.rolling_back import RollingBack
from hal.types import PlanarPose
from tests.support.chassis_rig import PERIOD_NS


def seconds_until_told(
    speeds_mps: list[float], heading_rad: float = 0.0, expected: bool = False
) -> float | None:
    """When a base that goes at these speeds, one a period of 20 ms, is said to roll back."""
    watch, way_m = RollingBack(), 0.0
    for period, v_mps in enumerate(speeds_mps):
        way_m += v_mps * 0.02
        pose = PlanarPose(way_m * math.cos(heading_rad), way_m * math.sin(heading_rad), heading_rad)
        watch.step(pose, period * PERIOD_NS, expected=expected)
        if watch.sentence:
            return period / 50
    return None


@pytest.mark.parametrize("heading_rad", [0.0, 2.0, -3.0])
@pytest.mark.parametrize("v_mps", [-0.06, -0.3])
def test_a_second_of_rolling_back_is_told_whichever_way_it_looks(v_mps: float, heading_rad: float) -> None:
    assert seconds_until_told([v_mps] * 200, heading_rad) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(
    "speeds_mps",
    [
        [0.5] * 200,
        [0.0] * 200,
        [-0.04] * 200,
        [0.3] * 50 + [-0.2] * 10 + [0.0] * 100,
        [0.02, -0.02] * 100,
    ],
    ids=["forward", "stands", "creeps", "springs back", "noise"],
)
def test_nothing_else_is_rolling_back(speeds_mps: list[float]) -> None:
    assert seconds_until_told(speeds_mps) is None


def test_a_base_that_is_not_armed_or_told_so_may_go_back() -> None:
    assert seconds_until_told([-0.3] * 200, expected=True) is None


def test_the_sentence_says_how_fast_and_what_to_look_at() -> None:
    watch = RollingBack()
    for period in range(100):
        watch.step(PlanarPose(-0.004 * period, 0.0, 0.0), period * PERIOD_NS, expected=False)
    assert watch.sentence == (
        "the base rolls back at 0.20 m/s: does it hold itself on this slope, "
        "and do its motors turn the right way?"
    )
    watch.step(PlanarPose(-1.0, 0.0, 0.0), 100 * PERIOD_NS, expected=True)
    assert watch.sentence == "", "latched by then; a new consent begins anew"
