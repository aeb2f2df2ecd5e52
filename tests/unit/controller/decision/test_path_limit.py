"""The limits by the sections of the path and by the target at its end."""

from __future__ import annotations

import pytest

from config.path import LineSpec, PathSpec
from config.robot import Robot
from controller.decision.decision import Action
from controller.path.path import Path
from tests.support.decision_bench import Bench


def test_the_target_is_reported_when_it_is_near() -> None:
    bench = Bench()
    decision = bench.step(bench.scene(x_m=28.5), 0.9, x_m=28.5)
    assert decision.reason.rule == "target"
    assert decision.action is Action.KEEP
    assert decision.reason.distance_m == pytest.approx(1.5)
    assert decision.reason.closing_mps == 0.0
    # A comfort stop from 0.9 m/s: v^2 / 0.6 + 0.25 v.
    assert decision.reason.required_m == pytest.approx(1.575)
    assert decision.reason.margin_m == pytest.approx(-0.075)


def test_beyond_the_target_it_is_not_ahead() -> None:
    bench = Bench()
    decision = bench.step(bench.scene(x_m=30.1), 0.1, x_m=30.1)
    assert decision.target_speed_mps == 0.0
    assert decision.reason.sentence.startswith("the target is 0.00 m ahead")
    assert decision.reason.distance_m == pytest.approx(-0.1)


def test_a_slow_section_is_a_reason() -> None:
    slow = Path(
        PathSpec(
            segments=(
                LineSpec(kind="line", length_m=3.0),
                LineSpec(kind="line", length_m=3.0, max_speed_mps=0.4),
                LineSpec(kind="line", length_m=20.0),
            )
        ),
        Robot(),
    )
    bench = Bench()
    decision = bench.step(bench.scene(x_m=3.5), 0.4, x_m=3.5, path=slow)
    assert decision.reason.rule == "section"
    assert decision.target_speed_mps == pytest.approx(0.4)


@pytest.mark.parametrize(
    ("x_m", "a_mps2", "section_mps"),
    [
        (8.7, 0.0, 0.83),  # 0.22 m on by the latency, then 1.08 m: 0.665 m/s for 0.33 / 0.3 + 0.5 s
        (8.7, 0.3, 0.64),  # until it no longer accelerates it comes 0.525 m farther
        (11.7, 0.3, 0.5),  # by then it will have left the section, but it is not left before that
        (12.1, 0.3, 1.5),
    ],
)
def test_a_section_is_entered_slowly_also_by_who_accelerates(
    x_m: float, a_mps2: float, section_mps: float
) -> None:
    """0.5 m/s from 10 m to 12 m."""
    slow = LineSpec(kind="line", length_m=2.0, max_speed_mps=0.5)
    before, after = LineSpec(kind="line", length_m=10.0), LineSpec(kind="line", length_m=18.0)
    path = Path(PathSpec(segments=(before, slow, after)), Robot())
    bench = Bench()
    decision = bench.step(bench.scene(x_m=x_m), 1.0, a_mps2, x_m=x_m, path=path)
    assert decision.target_speed_mps == pytest.approx(section_mps, abs=0.02)
