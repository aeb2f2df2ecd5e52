"""Who moved a moment ago only pauses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from controller.decision.lately_moved import LatelyMoved
from hal.clocks import NS_PER_S
from tests.support.decision_bench import Bench, obstacle
from tests.support.floor_bodies import box

WALKS, STANDS = box(3.0, 0.9, 0.0, 1.0), box(3.0, 0.9)


def pauses(walked_s: float, stood_s: float) -> bool:
    """After so long, in scenes ten times a second."""
    memory = LatelyMoved()
    for tenth in range(round(10 * (walked_s + stood_s)) + 1):
        body = WALKS if tenth <= 10 * walked_s else STANDS
        seen = replace(body, captured_ns=tenth * NS_PER_S // 10)
        memory.look(seen)
    return bool(memory.pausing(seen)[0])


def test_whoever_walked_pauses_for_four_seconds() -> None:
    assert not pauses(walked_s=1.0, stood_s=0.0)
    assert pauses(walked_s=1.0, stood_s=0.2)
    assert pauses(walked_s=1.0, stood_s=3.9)
    assert not pauses(walked_s=1.0, stood_s=4.2)


def test_a_verdict_that_flickers_is_no_walk() -> None:
    assert not pauses(walked_s=0.3, stood_s=0.2)


def test_whoever_is_out_of_view_meanwhile_still_only_pauses() -> None:
    memory = LatelyMoved()
    for tenth in range(11):
        memory.look(replace(WALKS, captured_ns=tenth * NS_PER_S // 10))
    memory.look(replace(STANDS, captured_ns=3 * NS_PER_S, ids=np.array([2])))
    assert memory.pausing(STANDS).tolist() == [True]


@pytest.mark.parametrize(("walked_mps", "rule"), [(-0.8, "worst case"), (0.0, "free")])
def test_whoever_has_just_stopped_beside_the_way_is_passed_slowly(walked_mps: float, rule: str) -> None:
    """0.26 m beside the swept width, 1 m ahead; what never walked there is passed at full speed."""
    bench = Bench()
    for _ in range(2):  # 0.8 s
        bench.settle(obstacle(1.8, -0.9, 0.0, walked_mps), v_mps=1.0)
    decision = bench.settle(obstacle(1.8, -0.9), v_mps=1.0)
    assert decision.reason.rule == rule
    assert (decision.target_speed_mps < 0.8) == (rule == "worst case")
