"""What cannot be relied on leads to a stop that says why."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from controller.decision.decision import Action, Decision
from controller.decision.situation import Situation
from controller.path.path import OnPath
from hal.types import PlanarPose
from tests.support.decision_bench import AGE_NS, PATH, STEP_NS, Bench, obstacle
from tests.support.scenes import free_space
from vision.scene import CameraCondition, CameraHealth, Obstacle


def stops(decision: Decision, rule: str, word: str) -> bool:
    return (
        decision.target_speed_mps == 0.0
        and decision.action is Action.DECREASE
        and decision.reason.rule == rule
        and word in decision.reason.sentence
    )


def test_no_scene_no_motion() -> None:
    assert stops(Bench().step(None), "camera", "no scene yet")
    assert stops(Bench().step(None, 0.2), "camera", "no scene yet")
    assert Bench().step(None, 0.0).action is Action.KEEP


def test_a_stale_scene_stops() -> None:
    bench = Bench()
    scene = bench.scene()
    assert bench.step(scene).target_speed_mps > 0.0
    for _ in range(13):
        decision = bench.step(scene)
    assert stops(decision, "camera", "0.34 s old")
    assert bench.step(bench.scene()).reason.rule != "camera"


def test_an_untrustworthy_camera_stops() -> None:
    bench = Bench()
    bench.settle()
    blind = CameraHealth(CameraCondition.UNTRUSTWORTHY, "lens covered", 0.0)
    assert stops(bench.step(bench.scene(health=blind)), "camera", "lens covered")


@pytest.mark.parametrize(
    "broken",
    [
        replace(obstacle(5.0, 0.0), position_m=np.array([math.nan, 0.0, 3.0])),
        replace(obstacle(5.0, 0.0), velocity_mps=np.array([0.0, math.inf, 3.0])),
        replace(obstacle(5.0, 0.0), extent_m=np.array([1e9, 1.0, 1.0])),
    ],
)
def test_an_impossible_obstacle_stops(broken: Obstacle) -> None:
    bench = Bench()
    bench.settle()
    assert stops(bench.step(bench.scene(broken)), "camera", "obstacle 5 is impossible")


def test_a_scene_from_where_nobody_knows_stops() -> None:
    bench = Bench()
    bench.settle()
    nowhere = replace(bench.scene(), robot_pose=PlanarPose(0.0, math.nan, 0.0))
    assert stops(bench.step(nowhere), "camera", "the robot's pose at the time of the scene is not known")
    assert bench.step(bench.scene()).reason.rule != "camera"


def test_scenes_out_of_order_stop() -> None:
    bench = Bench()
    old = bench.scene(age_ns=AGE_NS + 40_000_000)
    bench.step(bench.scene())
    assert stops(bench.step(old), "camera", "went back by 0.040 s")


def test_a_scene_from_the_future_stops() -> None:
    bench = Bench()
    assert stops(bench.step(bench.scene(age_ns=-100_000_000)), "camera", "from the future")


def test_time_going_backwards_stops() -> None:
    bench = Bench()
    bench.settle()
    bench.now_ns -= 500_000_000
    assert stops(bench.step(bench.scene()), "fault", "time went back by 0.480 s")


@pytest.mark.parametrize(
    ("x_m", "d_m", "v_mps", "a_mps2", "word"),
    [
        (math.nan, 0.0, 1.0, 0.0, "the robot's pose"),
        (1.0, 0.8, 1.0, 0.0, "0.80 m beside its path"),
        (1.0, -0.8, 1.0, 0.0, "is 0.80 m beside its path"),
        (1.0, 0.0, -0.2, 0.0, "moves backwards at 0.20 m/s"),
        (1.0, 0.0, 1.0, math.inf, "speed is not known"),
        (1.0, 0.0, math.nan, 0.0, "speed is not known"),
    ],
)
def test_an_unknown_state_stops(x_m: float, d_m: float, v_mps: float, a_mps2: float, word: str) -> None:
    bench = Bench()
    bench.settle()
    decision = bench.step(bench.scene(), v_mps, a_mps2, x_m=x_m, d_m=d_m)
    assert decision.target_speed_mps == 0.0
    assert decision.reason.rule == "fault"
    assert word in decision.reason.sentence


def test_without_a_pose_in_the_scene_the_own_history_serves() -> None:
    bench = Bench()
    for _ in range(10):
        bench.step(replace(bench.scene(obstacle(5.0, 0.0)), robot_pose=None), 1.5)
    assert bench.step(replace(bench.scene(obstacle(5.0, 0.0)), robot_pose=None), 1.5).reason.distance_m == (
        pytest.approx(4.39)
    )


def test_a_blind_camera_teaches_nothing() -> None:
    """A frozen picture shows the person where he was: he is reckoned with where he would be by now."""
    bench = Bench()
    person = obstacle(7.0, 0.0, vx_mps=-1.0)
    for _ in range(20):
        bench.step(bench.scene(person), 0.5)
    blind = CameraHealth(CameraCondition.UNTRUSTWORTHY, "frozen", 0.9)
    for _ in range(100):
        decision = bench.step(bench.scene(person, health=blind), 0.5)
    assert decision.target_speed_mps == 0.0
    assert decision.emergency
    seen = bench.step(bench.scene(obstacle(5.0, 0.0, vx_mps=-1.0)), 0.5)
    assert seen.target_speed_mps < 0.5


def test_robot_does_not_drive_into_a_person_too_near_for_depth() -> None:
    """The floor before the robot was free a second ago; then nothing is seen there any more, and nobody
    says that the camera cannot be trusted."""
    bench = Bench()
    assert bench.settle(v_mps=0.0).target_speed_mps == 1.5
    for _ in range(60):
        decision = bench.step(bench.scene(free=free_space(known_m=0.0)), 0.0)
    assert decision.target_speed_mps == 0.0
    assert decision.reason.rule == "unseen"
    assert "right before the camera nothing is seen" in decision.reason.sentence
    assert decision.stuck_since_ns is not None
    assert bench.settle(v_mps=0.0).target_speed_mps == 1.5


def test_the_pose_and_the_place_on_the_path_are_each_needed() -> None:
    nowhere = PlanarPose(math.nan, 0.0, 0.0)
    for pose, on_path, word in (
        (nowhere, OnPath(1.0, 0.0, 0.0), "the robot's pose is not known"),
        (PlanarPose(1.0, 0.0, 0.0), OnPath(1.0, math.nan, 0.0), "the robot's position on its path"),
    ):
        bench = Bench()
        bench.settle()
        bench.now_ns += STEP_NS
        at = Situation(bench.scene(), PATH, pose, on_path, 1.0, 0.0, bench.now_ns)
        decision = bench.maker.step(at)
        assert stops(decision, "fault", word)


def test_rolling_back_a_little_is_standing() -> None:
    """Less than 0.05 m/s backwards: noise of encoders, or the ground gives."""
    decision = Bench().settle(v_mps=-0.04)
    assert decision.reason.rule == "free"
    assert decision.target_speed_mps == 1.5


def test_the_first_scene_lets_the_robot_go_at_once() -> None:
    bench = Bench()
    for _ in range(50):
        assert bench.step(None, 0.0).target_speed_mps == 0.0
    assert bench.step(bench.scene(), 0.0).target_speed_mps == 1.5


@pytest.mark.parametrize(("v_mps", "d_m"), [(math.nan, 0.0), (1.0, 0.8), (1.0, -0.8)])
def test_after_a_fault_the_speed_comes_back_as_after_an_obstacle(v_mps: float, d_m: float) -> None:
    bench = Bench()
    bench.settle(v_mps=1.0)
    fault = bench.step(bench.scene(), v_mps, d_m=d_m).reason
    assert fault.rule == "fault"
    decision = bench.step(bench.scene(), 1.0)
    assert decision.target_speed_mps == 0.0
    assert decision.reason.rule == "release"
    assert decision.reason.sentence == f"still stopping; last limit: {fault.sentence}"


def test_fault_at_rest_does_not_count_as_a_decrease() -> None:
    """It goes again after delay_s, not after hold_s."""
    bench = Bench()
    bench.settle(v_mps=0.0)
    fault = bench.step(bench.scene(), math.nan)
    assert fault.action is Action.KEEP
    for _ in range(16):
        decision = bench.step(bench.scene(), 0.0)
    assert decision.target_speed_mps == 1.5


def test_rolling_back_is_slowed_down() -> None:
    bench = Bench()
    bench.settle()
    assert bench.step(bench.scene(), -0.2).action is Action.DECREASE


def test_the_same_moment_twice_is_no_fault() -> None:
    bench = Bench()
    bench.settle()
    bench.now_ns -= STEP_NS
    assert bench.step(bench.scene()).reason.rule == "free"


def test_robot_that_waits_for_the_camera_is_not_stuck() -> None:
    bench = Bench()
    scene = bench.scene()
    for _ in range(20):
        decision = bench.step(scene, 0.0)
    assert decision.reason.rule == "camera"
    assert decision.stuck_since_ns is None


def test_a_fault_ends_being_stuck() -> None:
    bench = Bench()
    for _ in range(10):
        before = bench.step(bench.scene(obstacle(1.2, 0.0)), 0.0)
    assert bench.step(bench.scene(obstacle(1.2, 0.0)), 0.0, d_m=0.8).stuck_since_ns is None
    after = bench.step(bench.scene(obstacle(1.2, 0.0)), 0.0)
    assert before.stuck_since_ns is not None
    assert after.stuck_since_ns == bench.now_ns


def test_a_scene_from_a_moment_ahead_is_reckoned_with_like_one_of_now() -> None:
    """Two clocks may differ by a few milliseconds; more is a fault, less no reason to drive on."""
    bench = Bench()
    for age_ns in (0, -3_000_000):
        decision = bench.step(bench.scene(obstacle(1.6, 0.0), age_ns=age_ns - STEP_NS))
        assert decision.action is Action.DECREASE
        assert decision.reason.obstacle_id == 5
    assert stops(bench.step(bench.scene(age_ns=-6_000_000 - STEP_NS)), "camera", "from the future")
