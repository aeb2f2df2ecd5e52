"""Who comes, crosses, goes ahead or stands beside the way."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from config.decision import DecisionConfig
from config.path import LineSpec, PathSpec
from config.robot import Robot
from controller.decision.decision import Action
from controller.path.path import Path
from tests.support.decision_bench import Bench, obstacle


def test_an_oncoming_person_counts_with_closing_speed() -> None:
    standing = Bench().settle(obstacle(8.0, 0.0), v_mps=0.8)
    coming = Bench().settle(obstacle(8.0, 0.0, vx_mps=-1.2), v_mps=0.8)
    assert standing.target_speed_mps == 1.5
    assert coming.reason.rule == "oncoming"
    assert coming.reason.closing_mps == pytest.approx(1.2)
    assert coming.target_speed_mps < 1.0


def test_a_leader_is_followed() -> None:
    decision = Bench().settle(obstacle(3.0, 0.0, vx_mps=0.8), v_mps=1.0)
    assert decision.reason.rule == "leader"
    assert 0.6 < decision.target_speed_mps < 1.2


def test_a_leader_is_expected_to_brake_about_as_hard_as_the_robot_does() -> None:
    """At its speed it is followed 1.6 m behind; when it has stopped there, the robot brakes hard."""
    behind = Bench().settle(obstacle(2.2, 0.0, vx_mps=1.0, sigma_mps=0.0), v_mps=1.0)
    assert behind.action is not Action.DECREASE
    stopped = Bench().settle(obstacle(2.2, 0.0), v_mps=1.0)
    assert stopped.action is Action.DECREASE
    assert stopped.emergency


def test_a_crossing_person_is_given_way_by_slowing_a_little() -> None:
    decision = Bench().settle(obstacle(6.0, 2.2, vy_mps=-0.9), v_mps=1.5)
    assert decision.reason.obstacle_id == 5
    assert "crosses" in decision.reason.sentence
    assert 0.5 < decision.target_speed_mps < 1.4


def test_body_that_leaves_slowly_is_approached_like_a_standing_one() -> None:
    """To arrive as it leaves, 0.5 m/s would do; a stop before it is still possible from twice as much."""
    decision = Bench().settle(obstacle(4.0, 0.5, vy_mps=-0.3, sigma_mps=0.05), v_mps=0.8)
    assert decision.reason.sentence.startswith("obstacle 5 is on the path 3.4 m ahead")
    assert decision.target_speed_mps > 1.0


def test_who_is_in_the_way_is_approached_like_a_standing_one() -> None:
    """To arrive as he has certainly left, 0.95 m/s would do; but he mostly leaves sooner."""
    leaves = Bench().settle(obstacle(4.0, 0.3, vy_mps=-0.4, sigma_mps=0.05), v_mps=0.8)
    stands = Bench().settle(obstacle(4.0, 0.3), v_mps=0.8)
    assert leaves.reason.rule == "crossing"
    assert leaves.target_speed_mps == pytest.approx(stands.target_speed_mps, abs=0.02)
    comes = Bench().settle(obstacle(4.0, 1.5, vy_mps=-0.8, sigma_mps=0.05), v_mps=0.8)
    assert "crosses" in comes.reason.sentence
    assert comes.target_speed_mps < stands.target_speed_mps


def test_the_robot_passes_first_when_there_is_time() -> None:
    decision = Bench().settle(obstacle(3.0, 4.5, vy_mps=-0.6), v_mps=1.5)
    assert decision.target_speed_mps == 1.5


def test_where_the_path_is_slow_nobody_is_passed_first_by_a_speed_that_it_does_not_allow() -> None:
    """At 1.5 m/s it would be past in time; the path allows 0.7."""
    slow = Path(PathSpec(segments=(LineSpec(kind="line", length_m=30.0, max_speed_mps=0.7),)), Robot())
    bench = Bench()
    for _ in range(20):
        decision = bench.step(bench.scene(obstacle(2.0, 3.9, vy_mps=-0.9)), 0.7, path=slow)
    assert decision.reason.rule == "crossing"
    assert decision.target_speed_mps < 0.7


def test_the_choice_does_not_flip_with_noise() -> None:
    """A person who arrives when the robot would: whoever goes first, it stays so."""
    random = np.random.default_rng(1)
    bench = Bench()
    x, y, v = 0.0, 3.4, 1.2
    rules = []
    for _ in range(60):
        person = obstacle(5.0, y, vy_mps=-0.8 + 0.08 * float(random.normal()), robot_x_m=x, sigma_mps=0.1)
        decision = bench.step(bench.scene(person, x_m=x), v, x_m=x)
        rules.append(decision.target_speed_mps >= v)
        y -= 0.8 * 0.02
        x += v * 0.02
        v += min(max(decision.target_speed_mps - v, -0.006), 0.006)
    assert sum(before != after for before, after in pairwise(rules[5:])) <= 2


def test_a_first_sight_may_be_confirmed_while_there_is_room() -> None:
    """Unknown velocity, 8 m away: an emergency stop would fit even if it came at 1.5 m/s."""
    bench = Bench()
    bench.settle(v_mps=1.0)
    young = obstacle(8.0, 0.0, age_s=0.0, sigma_mps=1.5)
    assert bench.step(bench.scene(young), 1.0).action is Action.INCREASE


def test_a_first_sight_too_near_brakes_at_once() -> None:
    bench = Bench()
    bench.settle(v_mps=1.0)
    young = obstacle(3.0, 0.0, age_s=0.0, sigma_mps=1.5)
    assert bench.step(bench.scene(young), 1.0).target_speed_mps < 0.8


def test_robot_stops_farther_from_an_obstacle_that_could_leave_unseen() -> None:
    """Half beside the view's edge: stopping at 0.45 m, the robot could not see it any more."""
    central = Bench().settle(obstacle(3.0, 0.0), v_mps=0.8)
    beside = Bench().settle(obstacle(3.0, 0.6), v_mps=0.8)
    assert beside.reason.required_m > central.reason.required_m + 0.3


def test_a_person_beside_the_path_who_walks_along_is_passed_slower_not_waited_for() -> None:
    decision = Bench().settle(obstacle(4.0, 1.4, vx_mps=0.8), v_mps=1.2)
    assert decision.target_speed_mps > 0.7


def test_oncoming_body_beside_the_path_is_passed_slowly() -> None:
    """0.1 m stay between a person of 0.5 m, who comes at 1 m/s, and the swept width."""
    for x_m in (4.0, 2.5, 1.6):
        decision = Bench().settle(obstacle(x_m, 0.74, vx_mps=-1.0, sigma_mps=0.05), v_mps=0.3)
        assert 0.3 <= decision.target_speed_mps < 0.85


def test_robot_does_not_wait_for_a_body_whose_place_is_seen_free() -> None:
    """Measured as creeping into the middle, so near that only a part was in view; then the view is free."""
    bench = Bench()
    assert bench.settle(obstacle(1.2, -0.3, vx_mps=-0.12, vy_mps=0.08), v_mps=0.0).target_speed_mps == 0.0
    gone_ns = bench.now_ns
    while bench.step(bench.scene(), v_mps=0.0).action is not Action.INCREASE:
        assert bench.now_ns < gone_ns + 400_000_000
    assert bench.now_ns > gone_ns + 100_000_000


def test_robot_waits_for_a_body_that_heads_into_the_path() -> None:
    decision = Bench().settle(obstacle(1.6, 0.74, vx_mps=-1.0, vy_mps=-0.6, sigma_mps=0.05), v_mps=0.3)
    assert decision.target_speed_mps < 0.1


def test_body_that_goes_beside_the_robot_may_cut_in() -> None:
    """It does not see the robot coming; who comes towards it does."""
    along = obstacle(2.5, 1.2, vx_mps=0.6, sigma_mps=0.05)
    careful = Bench().settle(along, v_mps=1.2)
    assert careful.reason.rule == "worst case"
    trusting = DecisionConfig.model_validate({"prediction": {"cut_in_mps2": 0.25}})
    assert Bench(config=trusting).settle(along, v_mps=1.2).target_speed_mps > careful.target_speed_mps


def test_oncoming_body_seen_for_a_while_keeps_its_lane() -> None:
    """The same distance and speed, but one was not there a moment ago."""
    known = Bench().settle(obstacle(2.0, 0.9, vx_mps=-0.8, sigma_mps=0.05, age_s=2.0), v_mps=0.9)
    fresh = Bench().settle(obstacle(2.0, 0.9, vx_mps=-0.8, sigma_mps=0.05, age_s=0.5), v_mps=0.9)
    assert fresh.target_speed_mps < known.target_speed_mps - 0.1


def test_body_that_leaves_the_path_aslant_does_not_cut_in() -> None:
    """Out of the way and going further from it, ahead and away, at 35 degrees; and almost along the path."""
    leaving = Bench().settle(obstacle(2.5, 1.2, vx_mps=0.5, vy_mps=0.35, sigma_mps=0.05), v_mps=1.2)
    beside = Bench().settle(obstacle(2.5, 1.2, vx_mps=0.6, vy_mps=0.05, sigma_mps=0.05), v_mps=1.2)
    assert beside.target_speed_mps < leaving.target_speed_mps - 0.1


@pytest.mark.parametrize(
    ("x_m", "y_m", "vy_mps", "differs_mps"), [(1.5, 0.9, 0.2, 0.0), (2.5, 1.2, -0.05, 0.3)]
)
def test_unseen_body_that_left_the_path_is_not_assumed_to_turn_back(
    x_m: float, y_m: float, vy_mps: float, differs_mps: float
) -> None:
    """Not seen for 0.6 s: whoever leaves the way goes on; whoever does not may be nearer by now."""
    seen = obstacle(x_m, y_m, vx_mps=0.2, vy_mps=vy_mps, sigma_mps=0.05)
    before = Bench().settle(seen, v_mps=1.2).target_speed_mps
    after = Bench().settle(replace(seen, unseen_s=0.6), v_mps=1.2).target_speed_mps
    assert before < 1.5
    assert before - after == pytest.approx(differs_mps)


def test_robot_at_rest_does_not_start_while_a_person_walks_towards_its_side() -> None:
    """A person beside the nose of a robot at rest walks into where its side would be."""
    walks_in = obstacle(0.9, 1.6, vy_mps=-0.7, sigma_mps=0.05)
    assert Bench().settle(walks_in, v_mps=0.0).target_speed_mps == 0.0


def test_robot_at_rest_waits_for_a_body_5_cm_beside_it() -> None:
    """Somebody leaves along the side of a robot at rest: 5 cm clear of it he is waited for, 50 cm clear not.

    Driving, the robot would be past him.
    """
    close, wide = (obstacle(0.8, y_m, -0.3, 0.3, sigma_mps=0.05) for y_m in (0.70, 1.15))
    assert Bench().settle(close, v_mps=0.0).target_speed_mps == 0.0
    assert Bench().settle(wide, v_mps=0.0).target_speed_mps > 0.0
    assert Bench().settle(close, v_mps=0.3).target_speed_mps > 0.0


def test_walker_who_waited_and_goes_on_slows_the_robot_at_once() -> None:
    """When he would have left the way, had he not stopped, is long past: the robot slows for him at once."""
    bench, robot_mps, left_m = Bench(), 1.4, 3.0

    def walks(age_s: float) -> float:
        nonlocal left_m
        decision = bench.step(bench.scene(obstacle(5.0, left_m, vy_mps=-0.6, age_s=age_s)), robot_mps)
        left_m -= 0.6 * 0.02
        return decision.target_speed_mps

    while left_m > 1.2:
        walks(age_s=3.0)
    for _ in range(400):
        bench.step(bench.scene(obstacle(5.0, left_m, age_s=6.0)), robot_mps)
    assert max(walks(age_s=14.0) for _ in range(3)) < 0.8


def test_one_frame_after_a_time_in_which_nobody_was_watched_is_no_sign_of_going_elsewhere() -> None:
    """It comes in, turns away in the last frames before it stops, and in the first one when it goes on."""
    bench = Bench()
    coming, turning = (obstacle(5.0, 1.5, vy_mps=left_mps, sigma_mps=0.01) for left_mps in (-0.5, 0.5))
    bench.settle(coming)
    for _ in range(10):
        bench.step(bench.scene(turning))
    bench.settle(obstacle(5.0, 1.5))
    bench.step(bench.scene(turning))
    assert bench.maker._speed_limits._watch._enters._flags == {5: True}
