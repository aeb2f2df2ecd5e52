"""How far from what blocks the way the robot stands."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from config.decision import DecisionConfig, SightConfig
from controller.decision.decision import Decision
from controller.decision.standing_limits import _stands_within, _stop_distances
from tests.support.closed_loop import Box, Mission, standing_at
from tests.support.decision_bench import Bench, obstacle
from tests.support.floor_bodies import line_path


@pytest.mark.parametrize("near_m", [1.3, 0.4, 0.18])
def test_a_camera_that_looks_down_steeply_is_no_reason_to_stand_nearer(near_m: float) -> None:
    config = DecisionConfig(sight=SightConfig(near_m=near_m))
    crate = Box(standing_at(9.0, 0.0), length_m=0.6, width_m=0.6, height_m=1.2)
    log = Mission(line_path(14.0), [crate], config=config).run(40.0)
    assert min(log.clearance_m) == pytest.approx(config.margins.stop_m, abs=0.02)
    assert not any(decision.emergency for decision in log.decisions)


def test_only_what_hangs_is_stood_off_for_the_sake_of_the_upper_edge() -> None:
    """Seen whole from 5 m on, before a camera 0.6 m high: 3 m at most, and 1.3 m before what stands."""
    off_m = _stop_distances(np.full(2, 5.0), np.array([0.0, 0.8]), 0.6, 0.1, 0.45, 1.3)
    assert off_m.tolist() == [1.3, 3.0]
    assert _stop_distances(np.full(1, 0.3), np.zeros(1), 0.6, 0.1, 0.45, 1.3).tolist() == [0.45]


def test_bodies_count_from_a_clearance_up_to_another_and_only_if_they_stand() -> None:
    clearance_m = np.array([-0.1, 0.0, 0.1, 0.3, 0.31, 0.1])
    moving = np.array([False, False, False, False, False, True])
    assert _stands_within(moving, clearance_m, 0.0, 0.3).nonzero()[0].tolist() == [2, 3]
    assert _stands_within(moving, clearance_m, -math.inf, 0.3).nonzero()[0].tolist() == [0, 1, 2, 3]


def decided_after(seconds: float, v_mps: float, then_clear_m: float, unseen_s: float = 0.0) -> Decision:
    """Something beside the way is measured inside the lateral margin, then at another clearance.

    unseen_s: since it was seen, in the frames of the second clearance.
    """
    bench = Bench()
    for clear_m, time_s in ((0.12, 0.5), (then_clear_m, seconds)):
        beside = obstacle(1.6, 0.39 + clear_m + 0.25)
        if clear_m == then_clear_m:
            beside = replace(beside, unseen_s=unseen_s)
        for _ in range(round(time_s / 0.02)):
            decision = bench.step(bench.scene(beside), v_mps)
    return decision


@pytest.mark.parametrize(
    ("seconds", "v_mps", "then_clear_m", "waits"),
    [
        pytest.param(1.8, 0.0, 0.17, True, id="not for long"),
        pytest.param(2.8, 0.0, 0.17, False, id="for long"),
        pytest.param(1.8, 0.3, 0.17, True, id="not for long, while the robot drives"),
        pytest.param(2.8, 0.3, 0.17, False, id="for long, while the robot drives"),
        pytest.param(2.8, 0.0, 0.14, True, id="not clear of the margin"),
        pytest.param(0.8, 0.0, 0.22, False, id="clear of the wider margin"),
    ],
)
def test_what_stays_clear_of_the_margin_for_two_seconds_is_no_longer_in_the_way(
    seconds: float, v_mps: float, then_clear_m: float, waits: bool
) -> None:
    decision = decided_after(seconds, v_mps, then_clear_m)
    assert (decision.reason.rule == "static") == waits


@pytest.mark.parametrize(
    ("v_mps", "unseen_s", "waits"), [(0.3, 0.2, False), (0.3, 0.4, True), (0.0, 0.4, False)]
)
def test_while_the_robot_drives_only_what_is_seen_counts_as_clear(
    v_mps: float, unseen_s: float, waits: bool
) -> None:
    assert (decided_after(2.8, v_mps, 0.17, unseen_s).reason.rule == "static") == waits
