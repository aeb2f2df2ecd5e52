"""Single decisions: faults lead to a stop that says why, reasons carry their numbers, hysteresis holds."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from config.decision import DecisionConfig
from config.path import LineSpec, PathSpec
from config.robot import Limits, Robot
from controller.decide import Action, Decision, DecisionMaker
from controller.path import OnPath, Path
from hal.geometry import camera_in_floor
from hal.types import CameraMount, PlanarPose
from tests.support.scenes import GOOD, STILL, free_space
from vision.scene import CameraCondition, CameraHealth, FreeSpace, Obstacle, Scene

MOUNT = CameraMount(0.45, 0.0, 0.60, math.radians(4.0))
PATH = Path(PathSpec(segments=(LineSpec(kind="line", length_m=30.0),)), Robot())
STEP_NS = 20_000_000
AGE_NS = 60_000_000


def obstacle(
    x_m: float,
    y_m: float,
    vx_mps: float = 0.0,
    vy_mps: float = 0.0,
    *,
    robot_x_m: float = 0.0,
    age_s: float = 2.0,
    sigma_mps: float = 0.1,
    number: int = 5,
    size_m: tuple[float, float] = (0.5, 1.7),
) -> Obstacle:
    camera = camera_in_floor(PlanarPose(robot_x_m, 0.0, 0.0), MOUNT).inverse()
    return Obstacle(
        id=number,
        bbox_px=(0.0, 0.0, 1.0, 1.0),
        position_m=camera.apply(np.array([[x_m, y_m, size_m[1] / 2]]))[0],
        extent_m=np.array([size_m[0], size_m[1], 0.2]),
        velocity_mps=camera.rotation @ np.array([vx_mps, vy_mps, 0.0]),
        velocity_cov=np.eye(3) * sigma_mps**2,
        moving=vx_mps != 0.0 or vy_mps != 0.0,
        score=0.9,
        fragments=5,
        age_s=age_s,
        unseen_s=0.0,
    )


class Bench:
    """A decision maker that is shown what the test wants, one step after another."""

    def __init__(self, robot: Robot | None = None, config: DecisionConfig | None = None) -> None:
        self.maker = DecisionMaker(config or DecisionConfig(), robot or Robot(), MOUNT, 0.02)
        self.now_ns = 1_000_000_000
        self.frame = 0

    def scene(
        self,
        *obstacles: Obstacle,
        x_m: float = 0.0,
        free: FreeSpace | None = None,
        health: CameraHealth = GOOD,
        age_ns: int = AGE_NS,
    ) -> Scene:
        self.frame += 1
        return Scene(
            self.now_ns - age_ns,
            self.frame,
            obstacles,
            free or free_space(),
            STILL,
            health,
            PlanarPose(x_m, 0.0, 0.0),
        )

    def step(
        self,
        scene: Scene | None,
        v_mps: float = 1.0,
        a_mps2: float = 0.0,
        x_m: float = 0.0,
        d_m: float = 0.0,
        path: Path = PATH,
    ) -> Decision:
        self.now_ns += STEP_NS
        return self.maker.step(
            scene, path, PlanarPose(x_m, d_m, 0.0), OnPath(x_m, d_m, 0.0), v_mps, a_mps2, self.now_ns
        )

    def settle(
        self, *obstacles: Obstacle, v_mps: float = 1.0, x_m: float = 0.0, free: FreeSpace | None = None
    ) -> Decision:
        """The same scene for twenty frames."""
        for _ in range(20):
            decision = self.step(self.scene(*obstacles, x_m=x_m, free=free), v_mps, x_m=x_m)
        return decision


def test_a_free_way() -> None:
    decision = Bench().settle(v_mps=1.0)
    assert decision.action is Action.INCREASE
    assert decision.target_speed_mps == 1.5
    assert decision.reason.rule == "free"
    assert not decision.emergency


def test_keep_is_a_band_around_the_target() -> None:
    assert Bench().settle(v_mps=1.48).action is Action.KEEP
    assert Bench().settle(v_mps=1.45).action is Action.INCREASE


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


def test_too_late_for_comfort_is_an_emergency() -> None:
    decision = Bench().settle(obstacle(4.0, 0.0), v_mps=1.5)
    assert decision.emergency
    assert not Bench().settle(obstacle(5.0, 0.0), v_mps=1.4).emergency


def test_an_oncoming_person_counts_with_closing_speed() -> None:
    standing = Bench().settle(obstacle(8.0, 0.0), v_mps=0.8)
    coming = Bench().settle(obstacle(8.0, 0.0, vx_mps=-1.2), v_mps=0.8)
    assert standing.target_speed_mps == 1.5
    assert coming.reason.rule == "oncoming"
    assert coming.reason.closing_mps == pytest.approx(1.2)
    assert coming.target_speed_mps < 1.0


def test_a_leader_is_followed() -> None:
    decision = Bench().settle(obstacle(3.5, 0.0, vx_mps=0.8), v_mps=1.0)
    assert decision.reason.rule == "leader"
    assert 0.6 < decision.target_speed_mps < 1.2


def test_a_crossing_person_is_given_way_by_slowing_a_little() -> None:
    decision = Bench().settle(obstacle(6.0, 2.2, vy_mps=-0.9), v_mps=1.5)
    assert decision.reason.obstacle_id == 5
    assert "crosses" in decision.reason.sentence
    assert 0.5 < decision.target_speed_mps < 1.4


def test_the_robot_passes_first_when_there_is_time() -> None:
    decision = Bench().settle(obstacle(3.0, 4.5, vy_mps=-0.6), v_mps=1.5)
    assert decision.target_speed_mps == 1.5


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


def stops(decision: Decision, rule: str, word: str) -> bool:
    return (
        decision.target_speed_mps == 0.0
        and decision.action is Action.DECREASE
        and decision.reason.rule == rule
        and word in decision.reason.sentence
    )


def test_no_scene_no_motion() -> None:
    assert stops(Bench().step(None), "camera", "no scene yet")


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
        (math.nan, 0.0, 1.0, 0.0, "where the robot is"),
        (1.0, 0.8, 1.0, 0.0, "0.80 m beside its path"),
        (1.0, 0.0, -0.2, 0.0, "moves backwards at 0.20 m/s"),
        (1.0, 0.0, 1.0, math.inf, "how fast"),
        (1.0, 0.0, math.nan, 0.0, "how fast"),
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


def test_standing_before_an_obstacle_it_says_since_when() -> None:
    bench = Bench()
    first = bench.step(bench.scene(obstacle(1.2, 0.0)), 0.0)
    for _ in range(20):
        decision = bench.step(bench.scene(obstacle(1.2, 0.0)), 0.0)
    assert decision.action is Action.KEEP
    assert first.stuck_since_ns is not None
    assert decision.stuck_since_ns == first.stuck_since_ns


def test_it_goes_again_by_itself_a_little_after_the_way_is_free() -> None:
    bench = Bench()
    for _ in range(150):
        bench.step(bench.scene(obstacle(1.2, 0.0)), 0.0)
    waited = 0
    while bench.step(bench.scene(), 0.0).target_speed_mps == 0.0:
        waited += 1
        assert waited < 100
    assert 0.1 <= waited * 0.02 <= 0.3
    assert bench.step(bench.scene(), 0.0).stuck_since_ns is None


def test_it_does_not_creep_up_to_what_blocks_the_way() -> None:
    """10 cm more than the margin is no reason to start."""
    bench = Bench()
    for _ in range(200):
        decision = bench.step(bench.scene(obstacle(0.51 + 0.45 + 0.1 + 0.1, 0.0)), 0.0)
    assert decision.target_speed_mps == 0.0


def test_where_an_obstacle_could_leave_unseen_it_stands_further_away() -> None:
    """Half beside the view's edge: stopping at 0.45 m, the robot could not see it any more."""
    central = Bench().settle(obstacle(3.0, 0.0), v_mps=0.8)
    beside = Bench().settle(obstacle(3.0, 0.6), v_mps=0.8)
    assert beside.reason.required_m > central.reason.required_m + 0.3


def test_a_person_beside_the_path_who_walks_along_is_passed_slower_not_waited_for() -> None:
    decision = Bench().settle(obstacle(4.0, 1.4, vx_mps=0.8), v_mps=1.2)
    assert decision.target_speed_mps > 0.7


def test_who_comes_along_the_side_is_passed_slowly_not_waited_for() -> None:
    """0.1 m stay between a person of 0.5 m, who comes at 1 m/s, and the swept width."""
    for x_m in (4.0, 2.5, 1.6):
        decision = Bench().settle(obstacle(x_m, 0.74, vx_mps=-1.0, sigma_mps=0.05), v_mps=0.3)
        assert 0.3 <= decision.target_speed_mps < 0.85


def test_what_may_be_driven_beside_somebody_may_be_started_beside_them() -> None:
    """Whose lane is kept for the moment at 0.35 m/s: nothing that the robot would creep up to."""
    comes = obstacle(1.6, 0.9, vx_mps=-1.0, age_s=0.6)
    assert Bench().settle(comes, v_mps=0.0).target_speed_mps == pytest.approx(0.35)


def test_who_has_left_the_view_is_not_waited_for_in_it() -> None:
    """Measured as creeping into the middle, so near that only a part was in view; then the view is free."""
    bench = Bench()
    assert bench.settle(obstacle(1.2, -0.3, vx_mps=-0.12, vy_mps=0.08), v_mps=0.0).target_speed_mps == 0.0
    gone_ns = bench.now_ns
    while bench.step(bench.scene(), v_mps=0.0).action is not Action.INCREASE:
        assert bench.now_ns < gone_ns + 400_000_000
    assert bench.now_ns > gone_ns + 100_000_000


def test_who_heads_into_the_way_is_waited_for() -> None:
    decision = Bench().settle(obstacle(1.6, 0.74, vx_mps=-1.0, vy_mps=-0.6, sigma_mps=0.05), v_mps=0.3)
    assert decision.target_speed_mps < 0.1


def test_who_goes_the_robots_way_beside_it_may_cut_in() -> None:
    """It does not see the robot coming; who comes towards it does."""
    along = obstacle(2.5, 1.2, vx_mps=0.6, sigma_mps=0.05)
    careful = Bench().settle(along, v_mps=1.2)
    assert careful.reason.rule == "worst case"
    trusting = DecisionConfig.model_validate({"prediction": {"cut_in_mps2": 0.25}})
    assert Bench(config=trusting).settle(along, v_mps=1.2).target_speed_mps > careful.target_speed_mps


def test_who_has_come_towards_it_for_a_while_keeps_its_lane() -> None:
    """The same distance and speed, but one was not there a moment ago."""
    known = Bench().settle(obstacle(2.0, 0.9, vx_mps=-0.8, sigma_mps=0.05, age_s=2.0), v_mps=0.9)
    fresh = Bench().settle(obstacle(2.0, 0.9, vx_mps=-0.8, sigma_mps=0.05, age_s=0.5), v_mps=0.9)
    assert fresh.target_speed_mps < known.target_speed_mps - 0.1


def test_who_leaves_the_way_aslant_does_not_cut_in() -> None:
    """Out of the way and going further from it, ahead and away, at 35 degrees; and almost along the path."""
    leaving = Bench().settle(obstacle(2.5, 1.2, vx_mps=0.5, vy_mps=0.35, sigma_mps=0.05), v_mps=1.2)
    beside = Bench().settle(obstacle(2.5, 1.2, vx_mps=0.6, vy_mps=0.05, sigma_mps=0.05), v_mps=1.2)
    assert beside.target_speed_mps < leaving.target_speed_mps - 0.1


@pytest.mark.parametrize(
    ("x_m", "y_m", "vy_mps", "differs_mps"), [(1.5, 0.9, 0.2, 0.0), (2.5, 1.2, -0.05, 0.3)]
)
def test_who_leaves_the_way_is_not_thought_to_have_turned_back_unseen(
    x_m: float, y_m: float, vy_mps: float, differs_mps: float
) -> None:
    """Not seen for 0.6 s: whoever leaves the way goes on; whoever does not may be nearer by now."""
    seen = obstacle(x_m, y_m, vx_mps=0.2, vy_mps=vy_mps, sigma_mps=0.05)
    before = Bench().settle(seen, v_mps=1.2).target_speed_mps
    after = Bench().settle(replace(seen, unseen_s=0.6), v_mps=1.2).target_speed_mps
    assert before < 1.5
    assert before - after == pytest.approx(differs_mps)


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


def test_nobody_is_started_into() -> None:
    """A person beside the nose of a robot at rest walks into where its side would be."""
    walks_in = obstacle(0.9, 1.6, vy_mps=-0.7, sigma_mps=0.05)
    assert Bench().settle(walks_in, v_mps=0.0).target_speed_mps == 0.0


def test_the_target_is_reported_when_it_is_near() -> None:
    bench = Bench()
    decision = bench.step(bench.scene(x_m=28.5), 0.9, x_m=28.5)
    assert decision.reason.rule == "target"
    assert decision.action is Action.KEEP
    assert decision.reason.distance_m == pytest.approx(1.5)


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
    [(29.6, 0.3, 0.0, Action.INCREASE), (29.985, 0.04, -0.17, Action.KEEP), (29.985, 0.0, 0.0, Action.KEEP)],
)
def test_closing_in_on_the_target_is_no_wish_to_go_faster(
    x_m: float, v_mps: float, a_mps2: float, action: Action
) -> None:
    """What the slack allows beyond what the shaper drives."""
    bench = Bench()
    decision = bench.step(bench.scene(x_m=x_m), v_mps, a_mps2, x_m=x_m)
    assert decision.reason.rule == "target"
    assert decision.action is action
