"""What limits the speed, and the reason with its numbers."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from config.decision import DecisionConfig
from config.path import LineSpec, PathSpec
from config.robot import Limits, Robot
from controller.decision.decide import Action
from controller.path.path import Path
from tests.support.decision_bench import Bench, obstacle
from tests.support.scenes import free_space
from vision.scene import CameraCondition, CameraHealth


def test_a_free_way_is_driven_at_full_speed() -> None:
    decision = Bench().settle(v_mps=1.0)
    assert decision.action is Action.INCREASE
    assert decision.target_speed_mps == 1.5
    assert decision.reason.rule == "free"
    assert not decision.emergency


def test_a_crate_on_the_path_with_all_its_numbers() -> None:
    """Near face at 6 - 0.1 m, front at 0.51 m: 5.39 m free. S(1.5) 4.125 + 0.22 * 1.5 + 0.45 = 4.905."""
    decision = Bench().settle(obstacle(6.0, 0.0), v_mps=1.5)
    reason = decision.reason
    assert (reason.rule, reason.obstacle_id) == ("free", None)
    nearer = Bench().settle(obstacle(5.0, 0.0), v_mps=1.5)
    reason = nearer.reason
    assert (reason.rule, reason.obstacle_id) == ("static", 5)
    assert reason.distance_m == pytest.approx(4.39)
    assert reason.closing_mps == pytest.approx(0.0)
    assert reason.required_m == pytest.approx(4.905)
    assert reason.margin_m == pytest.approx(-0.515)
    assert reason.sentence == "obstacle 5 stands on the path 4.4 m ahead: at most 1.40 m/s"
    assert nearer.action is Action.DECREASE
    # v with v^2 / 0.6 + 0.25 v + 0.22 v + 0.45 = 4.39
    assert nearer.target_speed_mps == pytest.approx(1.402, abs=0.001)


def test_a_crate_beside_the_path_changes_nothing() -> None:
    """0.39 + 0.15 m of corridor, 0.25 m of half a crate: from 0.79 m on it is outside."""
    assert Bench().settle(obstacle(3.0, -0.80), v_mps=1.5).target_speed_mps == 1.5
    assert Bench().settle(obstacle(3.0, -0.78), v_mps=1.5).target_speed_mps < 1.0


def test_a_plain_wall_stops_by_depth_alone() -> None:
    decision = Bench().settle(v_mps=1.2, free=free_space(nearest_m=2.5, known_m=2.5))
    assert decision.reason.rule == "depth"
    assert decision.reason.obstacle_id is None
    assert decision.reason.distance_m == pytest.approx(2.5 + 0.45 - 0.51)


def test_floor_that_was_not_seen_is_not_free() -> None:
    decision = Bench().settle(v_mps=1.4, free=free_space(known_m=3.0))
    assert decision.reason.rule == "unseen"
    assert decision.target_speed_mps < 1.2
    assert not decision.emergency


def test_the_range_of_the_camera_limits_the_speed() -> None:
    fast = Robot(limits=Limits(max_speed_mps=3.0))
    wide = Path(PathSpec(segments=(LineSpec(kind="line", length_m=60.0),)), fast)
    bench = Bench(fast, DecisionConfig.model_validate({"sight": {"range_m": 8.0}}))
    decision = bench.step(bench.scene(), 1.0, path=wide)
    assert decision.reason.rule == "range"
    # v^2/1.4 + (0.175 + tau + 1.5/0.7) v + 1.5 (tau + 0.35) + 0.2 = 7.94, tau = 0.22 + 0.08
    v = decision.target_speed_mps
    assert v**2 / 1.4 + (0.175 + 0.3 + 1.5 / 0.7) * v + 1.5 * 0.65 + 0.2 == pytest.approx(7.94)


def test_a_degraded_camera_caps_the_speed() -> None:
    bench = Bench()
    poor = CameraHealth(CameraCondition.DEGRADED, "few features", 0.4)
    decision = bench.step(bench.scene(health=poor), 0.4)
    assert decision.target_speed_mps == 0.5
    assert "few features" in decision.reason.sentence


def test_past_a_blind_corner_it_is_slower() -> None:
    """A rack whose end is 3 m ahead of the front, 0.6 m beside the swept width, on the right."""
    scan = free_space(known_m=9.0)
    with np.errstate(divide="ignore"):
        face = 0.99 / scan.bearing_tan
    on_rack = (face > 0.0) & (face + 0.45 < 3.5)
    rack = replace(scan, nearest_m=np.where(on_rack, face, math.inf), known_m=np.where(on_rack, face, 9.0))
    decision = Bench().settle(v_mps=1.5, free=rack)
    assert decision.reason.rule == "corner"
    assert "0.6 m beside the way" in decision.reason.sentence
    assert 0.8 <= decision.target_speed_mps < 1.5
    assert not decision.emergency
    off = DecisionConfig.model_validate({"sight": {"blind_corner_m": 0.0}})
    assert Bench(config=off).settle(v_mps=1.5, free=rack).target_speed_mps == 1.5


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
    ("x_m", "v_mps", "a_mps2", "action"),
    [
        (29.6, 0.3, 0.0, Action.INCREASE),
        (29.6, 0.3, -0.1, Action.KEEP),
        (29.985, 0.04, -0.17, Action.KEEP),
        (29.985, 0.0, 0.0, Action.KEEP),
    ],
)
def test_closing_in_on_the_target_is_no_wish_to_go_faster(
    x_m: float, v_mps: float, a_mps2: float, action: Action
) -> None:
    """What the slack allows beyond what the shaper drives."""
    bench = Bench()
    decision = bench.step(bench.scene(x_m=x_m), v_mps, a_mps2, x_m=x_m)
    assert decision.reason.rule == "target"
    assert decision.action is action


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
