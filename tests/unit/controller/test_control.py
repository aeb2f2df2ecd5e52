import itertools
import math
from dataclasses import replace

import pytest

from controller.base.drive_lifecycle import Outcome
from hal.types import ChassisMode, ChassisState, PlanarPose, Setpoint
from tests.support.obedient_chassis import PERIOD_S, ObedientChassis
from tests.support.path_drive import PERIOD_NS, ROBOT, drive, loop_on
from tests.support.scenes import scene


def test_a_free_way_is_driven_to_its_end_and_the_chassis_is_stopped_there() -> None:
    chassis = ObedientChassis()
    loop = loop_on(chassis)
    taken = drive(loop, 2000)
    assert loop.lifecycle.outcome is Outcome.REACHED
    assert taken[-1].progress_m == pytest.approx(3.0, abs=0.02)
    assert chassis.stopped_at_ns == [taken[-1].now_ns]
    assert chassis.armed_at_ns == [0]


class SlidingChassis(ObedientChassis):
    """Its odometry finds near the target of 3 m that it is 30 cm further."""

    def exchange(self, setpoint: Setpoint | None, now_ns: int) -> ChassisState:
        state = super().exchange(setpoint, now_ns)
        further_m = 0.3 if state.pose.x_m > 2.9 else 0.0
        return replace(state, pose=replace(state.pose, x_m=state.pose.x_m + further_m))


def test_a_robot_that_went_past_its_target_has_not_reached_it() -> None:
    chassis = SlidingChassis()
    loop = loop_on(chassis)
    taken = drive(loop, 2000)
    assert loop.lifecycle.outcome is Outcome.BROKEN_OFF
    assert loop.lifecycle.stop_reason == "went past the target"
    assert taken[-1].progress_m > 3.1
    assert chassis.stopped_at_ns == [taken[-1].now_ns]


def test_nothing_moves_before_the_chassis_is_armed() -> None:
    chassis = ObedientChassis(arms_after=20)
    taken = drive(loop_on(chassis), 60)
    moving = [index for index, step in enumerate(taken) if step.setpoint.v_mps > 0.0]
    # The exchange that reports ARMED is the 21st, so the first setpoint that may move is the 22nd.
    assert moving[0] >= 21


def test_nothing_moves_before_there_is_a_scene() -> None:
    chassis = ObedientChassis()
    loop = loop_on(chassis)
    for index in range(100):
        step = loop.step(None, index * PERIOD_NS)
        assert step.setpoint.v_mps == 0.0
        assert step.scene_ns is None


def test_a_latched_chassis_ends_the_drive_with_its_reason() -> None:
    chassis = ObedientChassis()
    loop = loop_on(chassis, length_m=10.0)
    taken = drive(loop, 200)
    assert taken[-1].setpoint.v_mps > 0.2
    chassis.fault = ChassisMode.ESTOP
    drive(loop, 5, first=200)
    assert loop.lifecycle.outcome is Outcome.CHASSIS_FAULT
    assert loop.lifecycle.stop_reason == "e-stop pressed"
    assert len(chassis.stopped_at_ns) == 1


def test_a_chassis_that_never_arms_is_given_up() -> None:
    chassis = ObedientChassis()
    chassis.fault = ChassisMode.STANDBY
    loop = loop_on(chassis)
    taken = drive(loop, 1000)
    assert loop.lifecycle.outcome is Outcome.NOT_ARMED
    assert taken[-1].now_ns == pytest.approx(5.02e9, abs=0.05e9)


def test_a_requested_stop_is_jerk_limited_and_ends_at_rest() -> None:
    chassis = ObedientChassis()
    loop = loop_on(chassis, length_m=20.0)
    drive(loop, 250)
    loop.request_stop("SIGTERM received")
    loop.request_stop("something later")
    taken = drive(loop, 1000, first=250)
    assert loop.lifecycle.outcome is Outcome.STOPPED
    assert loop.lifecycle.stop_reason == "SIGTERM received"
    speeds = [step.setpoint.v_mps for step in taken]
    accelerations = [step.setpoint.a_mps2 for step in taken]
    assert speeds[0] > 0.5
    assert speeds[-1] == 0.0
    assert min(accelerations) >= -ROBOT.limits.max_accel_mps2 - 1e-6
    jerks = [(b - a) / 0.02 for a, b in itertools.pairwise(accelerations)]
    assert max(map(abs, jerks)) <= ROBOT.limits.max_jerk_mps3 + 1e-6


def test_scenes_that_stop_coming_stop_the_robot() -> None:
    loop = loop_on(ObedientChassis(), length_m=20.0)
    taken = drive(loop, 250)
    last = scene(taken[-1].now_ns, 249, pose=taken[-1].pose)
    speeds = [loop.step(last, (250 + index) * PERIOD_NS).setpoint.v_mps for index in range(500)]
    assert speeds[0] > 0.5
    assert speeds[-1] == 0.0
    assert all(math.isfinite(speed) for speed in speeds)


class LosingChassis(ObedientChassis):
    """For three exchanges on its way nobody knows where it is."""

    def exchange(self, setpoint: Setpoint | None, now_ns: int) -> ChassisState:
        state = super().exchange(setpoint, now_ns)
        lost = 100 <= len(self.sent) < 103
        return replace(state, pose=PlanarPose(math.nan, math.nan, math.nan)) if lost else state


def test_a_robot_that_knows_not_where_it_is_stops_and_the_loop_goes_on() -> None:
    taken = drive(loop_on(LosingChassis()), 140)
    assert len(taken) == 140
    faults = [index for index, step in enumerate(taken) if step.decision.reason.rule == "fault"]
    assert faults == [100, 101, 102]
    assert taken[100].decision.reason.sentence == "the robot's pose is not known: stop"
    way_m = sum(PERIOD_S * step.setpoint.v_mps for step in taken[3:-1])
    assert taken[-1].progress_m == pytest.approx(way_m, abs=1e-3), "and it knows again what it has driven"
    assert all(math.isfinite(step.setpoint.v_mps + step.setpoint.w_radps) for step in taken)


def test_odometry_has_the_time_for_which_the_chassis_tells_it() -> None:
    loop = loop_on(ObedientChassis(stamp_offset_ns=4_000_000))
    last = drive(loop, 100)[-1]
    assert last.setpoint.v_mps > 0.2
    then = loop.localiser.body_pose(last.now_ns + 4_000_000)
    assert then == loop.localiser.pose
    before = loop.localiser.body_pose(last.now_ns)
    assert before is not None
    assert then.x_m - before.x_m == pytest.approx(0.004 * last.setpoint.v_mps, rel=0.01)


class RollingChassis(ObedientChassis):
    """On a slope that it does not hold: from its hundredth exchange on it tells of going back."""

    def exchange(self, setpoint: Setpoint | None, now_ns: int) -> ChassisState:
        state = super().exchange(setpoint, now_ns)
        return replace(state, v_mps=-0.2) if len(self.sent) > 100 else state


def test_a_base_that_rolls_back_is_stopped_and_not_taken_for_one_that_goes_forward() -> None:
    taken = drive(loop_on(RollingChassis()), 400)
    before, after = taken[100], taken[101:]
    assert before.setpoint.v_mps > 0.2
    assert {(step.decision.reason.rule, step.decision.target_speed_mps) for step in after} == {("fault", 0.0)}
    assert after[0].decision.reason.sentence == "the robot moves backwards at 0.20 m/s: stop"
    assert after[0].setpoint.v_mps > 0.2, "one report may be wrong"
    assert {step.setpoint.v_mps for step in after[1:]} == {0.0}, "no command ahead to a base that goes back"
    assert [step.unanswered for step in after if step.unanswered] == [
        "the base goes back at 0.20 m/s while told to go ahead; it was told zero, and begins again gently"
    ]
