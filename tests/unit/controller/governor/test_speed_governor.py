"""controller.governor.governor.SpeedGovernor in closed loop, among boxes, without a renderer."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from config.decision import DecisionConfig, SightConfig
from config.robot import Robot
from controller.decision.decision import Action
from controller.governor.arcs import corner_m
from controller.governor.request import Twist
from hal.clocks import NS_PER_S
from hal.types import PlanarPose
from tests.support.closed_loop import PERIOD_S, Box, Noise, standing_at, walking
from tests.support.governed_drive import GovernedDrive, Step, after, always, last_sentence, rules
from vision.scene import CameraCondition, CameraHealth, Scene

LIMITS = Robot().limits


def hardest(steps: list[Step]) -> tuple[float, float, float]:
    """Greatest acceleration, deceleration and jerk of the commanded speed."""
    accelerations = [one.governed.a_mps2 for one in steps]
    jerks = [abs(b - a) / PERIOD_S for a, b in itertools.pairwise(accelerations)]
    return max(accelerations), -min(accelerations), max(jerks)


def test_on_free_floor_the_robot_does_exactly_what_is_asked() -> None:
    steps = GovernedDrive(always(0.8, 0.2)).run(8.0)
    last = steps[-1].governed
    assert (last.v_mps, last.w_radps) == pytest.approx((0.8, 0.2))
    assert last.decision.action is Action.KEEP
    assert last.decision.reason.sentence == "as asked: 0.80 m/s, 0.20 rad/s"
    assert rules(steps) == ["camera", "requested"]


def test_before_a_crate_on_the_arc_it_stops_where_a_mission_would_and_stays_on_the_arc() -> None:
    crate = Box(standing_at(4.0 * math.sin(1.2), 4.0 * (1.0 - math.cos(1.2))))
    drive = GovernedDrive(always(0.8, 0.2), [crate])
    steps = drive.run(14.0)
    assert steps[-1].governed.v_mps == 0.0
    assert 0.4 < steps[-1].clearance_m < 0.6
    assert steps[-1].governed.decision.reason.obstacle_id is not None
    off_m = [abs(math.hypot(one.pose.x_m, one.pose.y_m - 4.0) - 4.0) for one in steps]
    assert max(off_m) < 0.03
    for one in steps:
        assert one.governed.w_radps == pytest.approx(0.25 * one.governed.v_mps)


def test_a_crate_beside_the_arc_does_not_slow_it() -> None:
    steps = GovernedDrive(always(0.8, 0.2), [Box(standing_at(6.0, 0.0))]).run(9.0)
    assert {one.governed.decision.reason.rule for one in after(steps, 0.5)} == {"requested"}
    assert steps[-1].governed.v_mps == pytest.approx(0.8)


def test_a_person_who_crosses_is_let_pass_and_then_it_goes_on_by_itself() -> None:
    steps = GovernedDrive(always(1.0), [Box(walking(6.0, -4.5, 0.0, 0.9))]).run(16.0)
    assert min(one.clearance_m for one in steps) > 0.3
    assert steps[-1].governed.v_mps == pytest.approx(1.0)


def test_a_lost_planner_means_a_comfortable_stop_on_the_same_arc_and_going_on_when_it_is_back() -> None:
    drive = GovernedDrive(lambda t: None if 4.0 <= t < 8.0 else Twist(0.8, 0.1))
    steps = drive.run(12.0)
    lost = [one for one in steps if 4.0 <= one.t_s < 8.0]
    assert lost[0].governed.v_mps > 0.75
    assert lost[-1].governed.v_mps == 0.0
    assert {one.governed.decision.reason.rule for one in lost} == {"no command"}
    assert lost[0].governed.decision.reason.sentence == "no command: stop"
    for one in lost:
        assert one.governed.w_radps == pytest.approx(0.125 * one.governed.v_mps)
    accel, decel, jerk = hardest(steps)
    assert accel <= LIMITS.max_accel_mps2 + 1e-6
    assert decel <= LIMITS.max_accel_mps2 + 1e-6
    assert jerk <= LIMITS.max_jerk_mps3 + 1e-6
    assert steps[-1].governed.v_mps > 0.7


def test_reverse_is_refused_with_its_reason() -> None:
    steps = GovernedDrive(lambda t: Twist(0.6, 0.0) if t < 4.0 else Twist(-0.2, 0.0)).run(9.0)
    assert rules(steps)[-1] == "refused"
    assert "the camera does not see behind" in last_sentence(steps)
    assert min(one.governed.v_mps for one in steps) == 0.0
    assert steps[-1].governed.v_mps == 0.0


@pytest.mark.parametrize("twist", [Twist(math.nan, 0.0), Twist(0.5, math.inf), Twist(0.1, 0.6)])
def test_twist_that_cannot_be_driven_stops_the_robot(twist: Twist) -> None:
    steps = GovernedDrive(lambda t: Twist(0.6, 0.0) if t < 4.0 else twist).run(9.0)
    assert steps[-1].governed.v_mps == 0.0
    assert rules(steps)[-1] == "refused"
    assert all(math.isfinite(one.governed.v_mps + one.governed.w_radps) for one in steps)


def test_faster_than_the_robot_is_scaled_along_the_same_arc() -> None:
    steps = GovernedDrive(always(3.0, 0.6)).run(12.0)
    last = steps[-1].governed
    assert last.v_mps == pytest.approx(LIMITS.max_speed_mps)
    assert last.w_radps == pytest.approx(0.2 * LIMITS.max_speed_mps)
    assert "asked 3.00 m/s; on this arc the robot drives 1.50 m/s" in last.decision.reason.sentence


def test_floor_beside_the_view_was_seen_on_the_way() -> None:
    turning = GovernedDrive(
        lambda t: Twist(0.6, 0.0) if t < 10.0 else Twist(0.4, 0.4) if t < 14.0 else Twist(0.0, 0.0)
    )
    steps = turning.run(16.0)
    assert {one.governed.decision.reason.rule for one in after(steps, 0.1)} == {"requested"}
    assert steps[-1].pose.heading_rad == pytest.approx(2.0, abs=0.2)


def test_floor_that_was_never_seen_stops_it() -> None:
    # Round and round: the camera never sees the inside of so tight a circle.
    steps = GovernedDrive(always(0.4, 0.4)).run(12.0)
    assert steps[-1].governed.v_mps == 0.0
    assert rules(steps)[-1] == "unseen"
    assert "never seen beyond" in last_sentence(steps)


def test_an_arc_into_a_wall_that_has_left_the_view() -> None:
    wall = Box(standing_at(8.0, 1.5), length_m=20.0, width_m=0.2)
    steps = GovernedDrive(lambda t: Twist(0.8, 0.0) if t < 6.0 else Twist(0.4, 0.3), [wall]).run(14.0)
    assert steps[-1].governed.v_mps == 0.0
    assert min(one.clearance_m for one in steps) > 0.2


def test_a_crate_below_the_view_is_not_forgotten_when_the_arc_changes() -> None:
    # 0.3 m high: from 0.65 m ahead of the camera on it cannot be seen any more.
    crate = Box(standing_at(4.0, 0.0), height_m=0.3)
    drive = GovernedDrive(lambda t: Twist(0.4, 0.004 * round(t)), [crate])
    steps = drive.run(16.0)
    assert steps[-1].governed.v_mps == 0.0
    assert 0.15 < steps[-1].clearance_m < 1.0


def test_at_speed_a_sharper_arc_is_entered_as_the_yaw_rate_admits() -> None:
    steps = GovernedDrive(lambda t: Twist(1.4, 0.0) if t < 8.0 else Twist(1.4, 1.4)).run(9.2)
    w = [one.governed.w_radps for one in steps]
    assert max(w) <= LIMITS.max_yaw_rate_radps + 1e-9
    assert max(w) > 0.79
    assert steps[-1].governed.v_mps < 1.3


def unhealthy(condition: CameraCondition) -> GovernedDrive:
    def alter(scene: Scene, t_s: float) -> Scene:
        bad = CameraHealth(condition, "it rains", 0.2)
        return replace(scene, health=bad) if t_s > 4.0 else scene

    return GovernedDrive(always(0.9), alter=alter)


def test_a_camera_that_cannot_be_trusted_stops_it_and_a_degraded_one_slows_it() -> None:
    steps = unhealthy(CameraCondition.UNTRUSTWORTHY).run(9.0)
    assert steps[-1].governed.v_mps == 0.0
    assert "cannot be trusted: it rains" in last_sentence(steps)
    steps = unhealthy(CameraCondition.DEGRADED).run(9.0)
    assert steps[-1].governed.v_mps == pytest.approx(0.5)


def test_with_a_degraded_camera_no_corner_of_a_turn_in_place_is_faster_than_it_may() -> None:
    """From rest, where a limit of the way ahead is lower than the camera's for the first moments."""
    bad = CameraHealth(CameraCondition.DEGRADED, "it rains", 0.2)
    drive = GovernedDrive(
        always(0.0, 0.8),
        alter=lambda scene, _: replace(scene, health=bad),
        decision=DecisionConfig(sight=SightConfig(degraded_mps=0.1)),
    )
    steps = drive.run(6.0)
    corner_mps = [abs(one.governed.w_radps) * corner_m(drive.robot) for one in steps]
    assert max(corner_mps) == pytest.approx(0.1, abs=1e-9)
    assert corner_mps[-1] == pytest.approx(0.1)
    assert "degraded (it rains): at most 0.10 m/s" in last_sentence(steps)


@pytest.mark.parametrize("planner", [always(0.8, 0.1), always(0.0, 0.5)])
def test_without_fresh_scenes_it_stops(planner: object) -> None:
    assert callable(planner)
    drive = GovernedDrive(planner, alter=lambda scene, t_s: scene if t_s < 3.0 else None)
    steps = drive.run(8.0)
    assert any(abs(one.governed.w_radps) > 0.05 for one in steps)
    assert (steps[-1].governed.v_mps, steps[-1].governed.w_radps) == (0.0, 0.0)
    assert "the last scene is" in last_sentence(steps)


def test_an_impossible_scene_stops_it() -> None:
    def alter(scene: Scene, t_s: float) -> Scene:
        nowhere = tuple(replace(one, position_m=np.full(3, np.nan)) for one in scene.obstacles)
        return scene if t_s < 3.0 else replace(scene, obstacles=nowhere)

    drive = GovernedDrive(always(0.8), [Box(standing_at(9.0, 3.0))], alter=alter)
    steps = drive.run(8.0)
    assert steps[100].governed.v_mps > 0.2
    assert steps[-1].governed.v_mps == 0.0


def test_a_robot_that_does_not_know_where_it_is_stops() -> None:
    drive = GovernedDrive(always(0.8))
    drive.run(4.0)
    drive.pose = PlanarPose(math.nan, 0.0, 0.0)
    scene, wish = drive.scene, Twist(0.8, 0.0)
    speeds = [
        drive.governor.step(k * 20_000_000, scene, wish, drive.pose, 0.5).v_mps for k in range(200, 500)
    ]
    assert speeds[-1] == 0.0
    assert max(abs(np.diff(speeds))) <= LIMITS.max_accel_mps2 * PERIOD_S + 1e-9


def test_a_scene_from_where_nobody_knows_stops_it_and_spoils_nothing() -> None:
    def alter(scene: Scene, t_s: float) -> Scene:
        nowhere = PlanarPose(math.nan, 0.0, 0.0)
        return replace(scene, robot_pose=nowhere) if 4.0 <= t_s < 4.3 else scene

    steps = GovernedDrive(always(0.8), alter=alter).run(9.0)
    unknown = [one.governed.decision for one in after(steps, 4.1) if one.t_s < 4.3]
    assert {one.reason.sentence for one in unknown} == {
        "the robot's pose at the time of the scene is not known: stop"
    }
    assert {one.target_speed_mps for one in unknown} == {0.0}
    assert steps[-1].governed.v_mps > 0.5


def test_noise_makes_no_false_stop() -> None:
    boxes = [Box(standing_at(4.0, 1.8)), Box(standing_at(8.0, -1.4)), Box(standing_at(12.0, 1.6))]
    steps = GovernedDrive(always(0.8), boxes, noise=Noise(0.0075, 0.1, 3)).run(14.0)
    assert min(one.governed.v_mps for one in after(steps, 5.0)) > 0.6


def test_scenes_without_a_pose_get_that_of_their_time() -> None:
    drive = GovernedDrive(
        always(0.8), [Box(standing_at(6.0, 0.0))], alter=lambda scene, _: replace(scene, robot_pose=None)
    )
    steps = drive.run(12.0)
    assert steps[-1].governed.v_mps == 0.0
    assert 0.4 < steps[-1].clearance_m < 0.6


def test_two_runs_are_alike_to_the_bit() -> None:
    def once() -> list[tuple[float, float]]:
        drive = GovernedDrive(
            lambda t: Twist(0.7, 0.3 * math.sin(t)), [Box(standing_at(5.0, 0.8))], noise=Noise(0.0075, 0.1)
        )
        return [(one.governed.v_mps, one.governed.w_radps) for one in drive.run(3.0)]

    assert once() == once()


def test_nothing_is_learned_of_the_floor_from_a_camera_that_cannot_be_trusted() -> None:
    crate = np.array([[x, y] for x in (3.9, 4.0, 4.1) for y in (-0.4, -0.3, -0.2, -0.1, 0.0)])
    behind = np.array([[x, y] for x in np.arange(4.6, 6.4, 0.1) for y in np.arange(-0.4, 0.4, 0.1)])

    def alter(scene: Scene, t_s: float) -> Scene:
        if t_s < 4.0:
            return scene
        bands = len(scene.free_space.bearing_tan)
        open_hall = replace(scene.free_space, nearest_m=np.full(bands, np.inf), known_m=np.full(bands, 10.0))
        frozen = CameraHealth(CameraCondition.UNTRUSTWORTHY, "frozen", 0.9)
        return replace(scene, free_space=open_hall, obstacles=(), health=frozen)

    drive = GovernedDrive(always(0.6), [Box(standing_at(4.2, -0.2), 0.5, 0.5, 1.0)], alter=alter)
    ground = drive.governor._ground
    drive.run(4.0)
    seen = ground.blocked(crate, round(drive.t_s * NS_PER_S)).sum(), ground.free(behind).sum()
    drive.run(4.0)
    assert seen[0] > 0
    assert (ground.blocked(crate, round(drive.t_s * NS_PER_S)).sum(), ground.free(behind).sum()) == seen


def test_body_out_of_view_is_remembered_through_every_new_arc() -> None:
    """Somebody slower beside the way is overtaken; out of view he may step in for 2 s at least."""
    drive = GovernedDrive(always(0.8), [Box(walking(4.5, 1.9, 0.35, -0.02))])
    arcs, remembered = {}, []  # kept alive: a new object may have the identity of a dead one
    for step in itertools.count():
        drive.step()
        known = drive.governor._ahead.known
        assert known is not None
        arcs[id(drive.governor.path)] = drive.governor.path
        remembered.append(int(np.count_nonzero(known.remembered)))
        if step > 14.0 / PERIOD_S:
            break
    first = remembered.index(1)
    assert len(arcs) > 10
    assert all(remembered[first : first + round(2.0 / PERIOD_S)])
