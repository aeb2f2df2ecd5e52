"""Starting, going faster again, braking hard: what hysteresis holds."""

from __future__ import annotations

from dataclasses import replace

import pytest

from config.decision import DecisionConfig
from config.path import LineSpec, PathSpec, StartSpec
from config.robot import Limits, Robot
from controller.decision.decision import Action
from controller.decision.situation import Situation
from controller.path.path import OnPath, Path
from hal.types import PlanarPose
from tests.support.decision_bench import STEP_NS, Bench, obstacle
from vision.scene import CameraCondition, CameraHealth


def test_keep_is_a_band_around_the_target() -> None:
    assert Bench().settle(v_mps=1.48).action is Action.KEEP
    assert Bench().settle(v_mps=1.45).action is Action.INCREASE


def test_too_late_for_comfort_is_an_emergency() -> None:
    decision = Bench().settle(obstacle(4.0, 0.0), v_mps=1.5)
    assert decision.emergency
    assert not Bench().settle(obstacle(5.0, 0.0), v_mps=1.4).emergency


def test_standing_before_an_obstacle_it_says_since_when() -> None:
    bench = Bench()
    first = bench.step(bench.scene(obstacle(1.2, 0.0)), 0.0)
    for _ in range(20):
        decision = bench.step(bench.scene(obstacle(1.2, 0.0)), 0.0)
    assert decision.action is Action.KEEP
    assert first.stuck_since_ns is not None
    assert decision.stuck_since_ns == first.stuck_since_ns


def test_robot_starts_again_shortly_after_the_way_is_free() -> None:
    bench = Bench()
    for _ in range(150):
        bench.step(bench.scene(obstacle(1.2, 0.0)), 0.0)
    waited = 0
    while bench.step(bench.scene(), 0.0).target_speed_mps == 0.0:
        waited += 1
        assert waited < 100
    assert 0.1 <= waited * 0.02 <= 0.3
    assert bench.step(bench.scene(), 0.0).stuck_since_ns is None


def test_robot_does_not_creep_on_when_a_standing_obstacle_is_briefly_missed() -> None:
    """Half a second of every second; in the first gap it cannot know that it comes back."""
    bench = Bench()
    there = obstacle(1.2, 0.0)
    for frame in range(300):
        decision = bench.step(bench.scene() if frame % 50 >= 25 else bench.scene(there), 0.0)
        if frame >= 51:
            assert decision.target_speed_mps == 0.0, decision.reason.sentence
            assert "stands on the path" in decision.reason.sentence


def test_obstacle_that_comes_and_goes_keeps_a_rolling_robot_from_getting_faster() -> None:
    """Half a second there, half a second gone, there again, gone: meanwhile the robot has come to roll."""
    bench = Bench()
    there = obstacle(1.2, 0.0)
    for frame in range(75):
        bench.step(bench.scene() if 25 <= frame < 50 else bench.scene(there), 0.0)
    targets = [bench.step(bench.scene(), 0.4).target_speed_mps for _ in range(120)]
    # The release gate comes first; slower than creep_mps it does not roll on.
    assert set(targets[25:45]) == {0.4}
    assert targets[-1] > 0.4


def test_way_is_free_once_the_obstacle_has_been_gone_for_a_second() -> None:
    bench = Bench()
    there = obstacle(1.2, 0.0)
    for frame in range(75):
        bench.step(bench.scene() if 25 <= frame < 50 else bench.scene(there), 0.0)
    waited = 0
    while bench.step(bench.scene(), 0.0).target_speed_mps == 0.0:
        waited += 1
        assert waited < 100
    assert 1.0 <= waited * 0.02 <= 1.3


def test_obstacle_that_returns_much_later_does_not_count_as_coming_and_going() -> None:
    bench = Bench()
    there = obstacle(1.2, 0.0)
    for frame in range(25 + 260 + 25):
        bench.step(bench.scene() if 25 <= frame < 285 else bench.scene(there), 0.0)
    waited = 0
    while bench.step(bench.scene(), 0.0).target_speed_mps == 0.0:
        waited += 1
        assert waited < 100
    assert waited * 0.02 <= 0.3


def test_robot_does_not_creep_up_to_an_obstacle() -> None:
    """10 cm more than the margin is no reason to start."""
    bench = Bench()
    for _ in range(200):
        decision = bench.step(bench.scene(obstacle(0.51 + 0.45 + 0.1 + 0.1, 0.0)), 0.0)
    assert decision.target_speed_mps == 0.0


def test_speed_allowed_beside_a_person_is_allowed_for_starting() -> None:
    """Whose lane is kept for the moment at 0.35 m/s: nothing that the robot would creep up to."""
    decision = Bench().settle(obstacle(1.6, 0.9, vx_mps=-1.0, age_s=0.6), v_mps=0.0)
    assert decision.target_speed_mps == pytest.approx(0.35)
    assert decision.stuck_since_ns is None


def test_hard_braking_lasts_until_the_speed_is_what_is_allowed() -> None:
    """1.39 m ahead: comfort keeps 0.45 m from 0.62 m/s on, and 0.2 m from 0.72 m/s: only beyond that it is
    too late for comfort."""
    crate = obstacle(2.0, 0.0)
    assert not Bench().settle(crate, v_mps=0.69).emergency
    bench = Bench()
    assert bench.settle(crate, v_mps=0.9).emergency
    braking = bench.step(bench.scene(crate), 0.69)
    assert braking.target_speed_mps == pytest.approx(0.623, abs=0.002)
    assert braking.emergency
    assert not bench.step(bench.scene(crate), 0.66).emergency


def test_standing_robot_does_not_brake_hard() -> None:
    assert Bench().settle(obstacle(0.9, 0.0), v_mps=0.2).emergency
    assert not Bench().settle(obstacle(0.9, 0.0), v_mps=0.0).emergency
    assert not Bench().settle(obstacle(1.2, 0.0, vx_mps=-1.0), v_mps=0.0).emergency


def test_held_back_it_says_by_what() -> None:
    bench = Bench()
    bench.settle(v_mps=1.2)
    bench.settle(obstacle(3.0, 0.0), v_mps=1.2)
    decision = bench.step(bench.scene(), 1.0)
    assert decision.reason.rule == "release"
    assert decision.reason.obstacle_id == 5
    told = (
        f"not faster than {decision.target_speed_mps:.2f} m/s yet; last limit: obstacle 5 stands on the path"
    )
    assert decision.reason.sentence.startswith(told)
    assert decision.target_speed_mps > 0.0
    assert decision.target_speed_mps < 1.5


@pytest.mark.parametrize(("v_mps", "told"), [(0.0, "not starting yet; "), (1.0, "still stopping; ")])
def test_held_at_zero_it_says_whether_it_still_rolls(v_mps: float, told: str) -> None:
    bench = Bench()
    bench.settle(v_mps=v_mps)
    bench.step(bench.scene(), v_mps, d_m=0.8)
    decision = bench.step(bench.scene(), v_mps)
    assert (decision.reason.rule, decision.target_speed_mps) == ("release", 0.0)
    assert decision.reason.sentence.startswith(told)


def test_hold_names_the_obstacle_that_was_there_last() -> None:
    """First obstacle 5, then a nearer 6; a free way in between is no reason."""
    bench = Bench()
    bench.settle(obstacle(4.0, 0.0), v_mps=1.2)
    bench.settle(v_mps=1.2)
    bench.settle(obstacle(3.0, 0.0, number=6), v_mps=1.2)
    decision = bench.step(bench.scene(), 1.0)
    assert (decision.reason.rule, decision.reason.obstacle_id) == ("release", 6)


def test_too_little_to_go_for_is_said() -> None:
    decision = Bench().settle(obstacle(0.51 + 0.45 + 0.1 + 0.1, 0.0), v_mps=0.0)
    assert decision.target_speed_mps == 0.0
    assert decision.reason.sentence.endswith("too slow to drive")
    moving = Bench().settle(obstacle(3.0, 0.0), v_mps=0.5)
    assert not moving.reason.sentence.endswith("too slow to drive")


def test_a_start_needs_more_room_than_going_on() -> None:
    """0.3 m beyond the margin: driven on to, but not started for."""
    near = obstacle(0.51 + 0.45 + 0.1 + 0.3, 0.0)
    assert Bench().settle(near, v_mps=0.1).target_speed_mps > 0.1
    assert Bench().settle(near, v_mps=0.0).target_speed_mps == 0.0


def test_a_crate_is_not_started_for_at_what_would_do_beside_a_person() -> None:
    """Between beside_mps and the speed of go_m: only who keeps clear may be started beside so slowly."""
    config = DecisionConfig.model_validate({"prediction": {"beside_mps": 0.1}})
    near = obstacle(0.51 + 0.45 + 0.1 + 0.3, 0.0)
    assert Bench(config=config).settle(near, v_mps=0.1).target_speed_mps > 0.1
    assert Bench(config=config).settle(near, v_mps=0.0).target_speed_mps == 0.0


def test_robot_does_not_start_at_creep_speed_beside_a_body() -> None:
    """Who could step into the way allows 0.25 m/s: too little to set off with, below beside_mps."""
    near = obstacle(1.0, 0.7, vx_mps=0.5, vy_mps=-0.4, sigma_mps=0.05)
    decision = Bench().settle(near, v_mps=0.0)
    assert decision.reason.rule == "worst case"
    assert "at most 0.25 m/s, too slow to drive" in decision.reason.sentence
    assert decision.target_speed_mps == 0.0


def test_robot_that_sets_off_slowly_is_not_stuck() -> None:
    config = DecisionConfig.model_validate({"release": {"go_m": 0.05}})
    decision = Bench(config=config).settle(obstacle(0.51 + 0.45 + 0.1 + 0.1, 0.0), v_mps=0.0)
    assert decision.reason.rule == "static"
    assert 0.1 < decision.target_speed_mps < 0.2
    assert decision.stuck_since_ns is None


def test_limit_that_blocks_nothing_may_be_below_the_creep_speed() -> None:
    """A degraded camera's limit is no place to creep up to."""
    config = DecisionConfig.model_validate({"sight": {"degraded_mps": 0.05}})
    bench = Bench(config=config)
    poor = CameraHealth(CameraCondition.DEGRADED, "few features", 0.4)
    assert bench.step(bench.scene(health=poor), 0.0).target_speed_mps == 0.05


def test_another_path_is_looked_along_anew() -> None:
    """A crate on the old path is beside the new one."""
    aside = Path(
        PathSpec(segments=(LineSpec(kind="line", length_m=30.0),), start=StartSpec(y_m=3.0)), Robot()
    )
    bench = Bench()
    assert bench.settle(obstacle(3.0, 0.0), v_mps=0.6).reason.rule == "static"
    pose, on_path = PlanarPose(0.0, 3.0, 0.0), OnPath(0.0, 0.0, 0.0)
    for _ in range(60):
        bench.now_ns += STEP_NS
        scene = replace(bench.scene(obstacle(3.0, -3.0)), robot_pose=pose)
        decision = bench.maker.step(Situation(scene, aside, pose, on_path, 0.6, 0.0, bench.now_ns))
    assert decision.reason.rule == "free"


def test_a_section_holds_from_where_the_robot_is_when_it_can_obey() -> None:
    """At 1 m/s and a reaction of 0.22 s, 20 cm before the section is in it; 30 cm is not yet."""
    slow = Path(
        PathSpec(
            segments=(
                LineSpec(kind="line", length_m=10.0, max_speed_mps=0.4),
                LineSpec(kind="line", length_m=20.0),
            )
        ),
        Robot(),
    )
    bench = Bench()
    in_section = bench.step(bench.scene(x_m=9.7), 1.0, x_m=9.7, path=slow)
    assert in_section.target_speed_mps == pytest.approx(0.4)
    bench = Bench()
    beyond = bench.step(bench.scene(x_m=9.85), 1.0, x_m=9.85, path=slow)
    assert beyond.target_speed_mps > 0.4


@pytest.mark.parametrize("caps", [True, False])
def test_the_range_is_for_the_emergency_stop_or_for_comfort(caps: bool) -> None:
    robot = Robot(limits=Limits(max_speed_mps=3.0))
    path = Path(PathSpec(segments=(LineSpec(kind="line", length_m=60.0),)), robot)
    config = DecisionConfig.model_validate({"sight": {"range_m": 8.0}, "emergency_caps_range": caps})
    bench = Bench(robot, config)
    decision = bench.step(bench.scene(), 0.5, path=path)
    assert decision.reason.rule == "range"
    # The law of test_decide's range with A, J of comfort (0.3, 0.6) or emergency (0.7, 2.0).
    a, j = (0.7, 2.0) if caps else (0.3, 0.6)
    v, tau = decision.target_speed_mps, 0.22 + 0.08
    distance_m = v * v / (2 * a) + (a / (2 * j) + tau + 1.5 / a) * v + 1.5 * (tau + a / j) + 0.2
    assert distance_m == pytest.approx(7.94)


def test_hard_braking_lasts_on_a_slow_section_too() -> None:
    """What it braked for has gone, but 0.9 m/s are still more than the section allows."""
    slow = Path(PathSpec(segments=(LineSpec(kind="line", length_m=30.0, max_speed_mps=0.4),)), Robot())
    bench = Bench()
    for _ in range(20):
        assert bench.step(bench.scene(obstacle(1.6, 0.0)), 0.9, path=slow).target_speed_mps < 0.9
    assert bench.step(bench.scene(), 0.9, path=slow).emergency
    assert not bench.step(bench.scene(), 0.42, path=slow).emergency


def test_speed_that_falls_anyway_needs_no_release() -> None:
    """Within hold_s nothing turns round; but at -0.3 m/s2 letting go, at 0.6 m/s3, leaves 0.9 - 0.075 m/s."""
    bench = Bench()
    bench.settle(v_mps=1.2)
    bench.settle(obstacle(2.5, 0.0), v_mps=1.2)
    for _ in range(20):
        decision = bench.step(bench.scene(), 0.9, -0.3)
    assert decision.target_speed_mps == pytest.approx(0.825)


def test_whether_it_can_pass_first_is_reckoned_at_the_speed_that_the_section_allows() -> None:
    crosses = obstacle(1.4, 2.6, vy_mps=-0.55)
    slow = Path(PathSpec(segments=(LineSpec(kind="line", length_m=30.0, max_speed_mps=0.35),)), Robot())
    assert Bench().settle(crosses, v_mps=1.5).target_speed_mps == 1.5
    bench = Bench()
    for _ in range(20):
        decision = bench.step(bench.scene(crosses), 0.35, path=slow)
    assert decision.reason.obstacle_id == 5
    assert decision.target_speed_mps < 0.35


def test_the_last_of_a_stop_is_still_slowing_down() -> None:
    """Within the band of keep, but not yet at rest."""
    assert Bench().settle(obstacle(0.9, 0.0), v_mps=0.025).action is Action.DECREASE
    assert Bench().settle(obstacle(0.9, 0.0), v_mps=0.0).action is Action.KEEP
