"""What limits the speed, and the reason with its numbers."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from config.decision import DecisionConfig
from config.robot import Robot
from controller.decision.decision import Action
from tests.support.decision_bench import Bench, obstacle
from tests.support.scenes import free_space
from vision.scene import FreeSpace


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


def test_a_crate_in_the_margin_tells_how_much_room_it_leaves() -> None:
    """Its side 0.64 - 0.25 - 0.27 = 0.12 m beside the robot of 0.78 m."""
    sentence = Bench().settle(obstacle(2.0, -0.76), v_mps=1.0).reason.sentence
    assert sentence.startswith(
        "obstacle 5 leaves 0.12 m beside the swept width (0.20 m needed), 1.4 m ahead:"
    )


def test_a_surface_in_the_margin_does_too() -> None:
    bearing = np.linspace(-0.52, 0.52, 60)
    walls = FreeSpace(bearing, 0.52 / 60, np.where(np.abs(bearing) > 0.2, 2.4, np.inf), np.full(60, 10.0))
    reason = Bench().settle(v_mps=1.0, free=walls).reason
    assert reason.rule == "depth"
    assert re.match(r"a surface leaves 0\.\d\d m beside the swept width \(0.15 m needed\), ", reason.sentence)


def test_a_crate_beside_the_path_changes_nothing() -> None:
    """0.39 + 0.15 m of corridor, 0.25 m of half a crate: from 0.79 m on it is outside."""
    assert Bench().settle(obstacle(3.0, -0.80), v_mps=1.5).target_speed_mps == 1.5
    assert Bench().settle(obstacle(3.0, -0.78), v_mps=1.5).target_speed_mps < 1.0


def test_a_plain_wall_stops_by_depth_alone() -> None:
    decision = Bench().settle(v_mps=1.2, free=free_space(nearest_m=2.5, known_m=2.5))
    assert decision.reason.rule == "depth"
    assert decision.reason.obstacle_id is None
    assert decision.reason.distance_m == pytest.approx(2.5 + 0.45 - 0.51)


@pytest.mark.parametrize(("y_m", "name"), [(1.2, "obstacle 5"), (3.2, "a surface")])
def test_a_surface_is_named_after_the_large_thing_that_it_belongs_to(y_m: float, name: str) -> None:
    """A wall of 2 m that stands across the way, or 1.8 m beside it at the same distance."""
    wall = obstacle(2.9, y_m, size_m=(2.0, 1.7))
    decision = Bench().settle(wall, v_mps=1.2, free=free_space(nearest_m=2.5, known_m=2.5))
    assert decision.reason.rule == "depth"
    assert decision.reason.sentence.startswith(f"{name} stands on the path")


@pytest.mark.parametrize(
    ("nearest_m", "told"),
    [
        (
            0.56,
            "a surface is inside the robot's outline: stop; is a part of the robot in view? Then give it in "
            "camera.own_parts",
        ),
        (0.64, "a surface stands on the path 0.0 m ahead: stop"),
    ],
)
def test_a_surface_behind_the_robots_front_is_told_as_a_part_of_it(nearest_m: float, told: str) -> None:
    """The camera is 0.45 m ahead of the turning centre, the front 1.09 m."""
    robot = Robot()
    robot = robot.model_copy(update={"body": robot.body.model_copy(update={"length_m": 1.6})})
    decision = Bench(robot).settle(free=free_space(nearest_m=nearest_m, known_m=5.0))
    assert decision.target_speed_mps == 0.0
    assert decision.reason.sentence == told


def test_floor_that_was_not_seen_is_not_free() -> None:
    decision = Bench().settle(v_mps=1.4, free=free_space(known_m=3.0))
    assert decision.reason.rule == "unseen"
    assert decision.target_speed_mps < 1.2
    assert not decision.emergency


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
    ("forward_mps", "rule", "what"),
    [
        (0.0, "static", "stands on the path 0.8 m ahead"),
        (-0.15, "worst case", "could step into the way"),
        (-0.3, "crossing", "crosses 0.3 m ahead and stays"),
    ],
)
def test_reason_says_that_the_awaited_body_is_not_seen(forward_mps: float, rule: str, what: str) -> None:
    """Below the view of a camera that sees the floor from 1.3 m on; somebody may have carried it away."""
    pallet = obstacle(2.2, 0.0, forward_mps, size_m=(0.5, 0.1), sigma_mps=0.05)
    bench = Bench()
    bench.settle(pallet, v_mps=0.3)
    for _ in range(76):
        decision = bench.step(bench.scene(x_m=0.8), 0.05, x_m=0.8)
    assert decision.reason.rule == rule
    assert decision.reason.sentence.startswith("obstacle 5 (not seen for 2 s)")
    assert what in decision.reason.sentence


def test_a_speed_that_would_read_as_zero_is_told_as_a_stop() -> None:
    decision = Bench().settle(obstacle(0.51 + 0.45 + 0.1 + 0.001, 0.0), v_mps=0.0)
    assert decision.target_speed_mps == 0.0
    assert decision.reason.sentence.endswith(" ahead: stop")
