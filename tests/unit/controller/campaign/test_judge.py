from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from config.app import AppConfig
from config.camera import SimulatedCameraConfig
from config.faults import Faults
from config.scenario import Go, MotionPlan, RobotBody, Wait
from controller.campaign.drive_log import DriveLog
from controller.campaign.judge import Row, false_stops, flaps, judge
from controller.campaign.oracle import OracleTime
from controller.campaign.stage import Stage
from controller.campaign.task import judge_reference
from controller.decision.decision import Action
from sim.polygons import separation
from tests.support.campaign import CONFIG, crate, frozen, late, log_of, mover, silent, stage

UP, DOWN, KEEP = Action.INCREASE, Action.DECREASE, Action.KEEP


def judged(made: Stage, log: DriveLog, config: AppConfig = CONFIG) -> Row:
    return judge(made, log, "ours", "noise", judge_reference(made, config))


def cruise(v_mps: float, duration_s: float, then: tuple[float, ...] = ()) -> DriveLog:
    return log_of([v_mps] * round(duration_s / 0.02) + list(then))


def test_clearance_is_that_of_the_nearest_pass() -> None:
    """The crate's side is at y = 0.7, the robot's at 0.39."""
    row = judged(stage(crate(4.0, 1.0), length_m=9.0), cruise(1.0, 8.0))
    assert row.min_clearance_m == pytest.approx(0.31, abs=1e-3)
    assert row.contacts == 0


@pytest.mark.parametrize("beside_m", [-1.6, -1.3, 1.2, 1.7])
def test_clearance_is_the_least_of_all_steps_and_bodies(beside_m: float) -> None:
    """Most distances are never computed; none of them would have been the least."""
    who = mover(7.0, beside_m, -3.0, beside_m + 0.2, 1.1)
    made = stage(crate(5.0, 1.9), who, crate(2.0, -2.2, name="other"), length_m=9.0)
    log = cruise(0.8, 9.0)
    robots = made.robot_polygons(log.pose_array())
    times = np.array(log.times_s)
    least_m = min(separation(robots, made.world.sample(times, body)).min() for body in range(3))
    assert least_m > 0.16
    assert judged(made, log).min_clearance_m == round(float(least_m), 4)


def test_driving_into_a_crate_is_a_contact_at_fault() -> None:
    row = judged(stage(crate(4.0), length_m=9.0, blocked=True), cruise(1.0, 5.0))
    assert (row.contacts, row.contacts_at_fault, row.touched) == (1, 1, ("crate",))
    assert row.min_clearance_m < -0.1


def test_being_walked_into_while_standing_is_not_at_fault() -> None:
    row = judged(stage(mover(6.0, 0.0, -6.0, 0.0, 1.0)), cruise(0.0, 8.0))
    assert (row.contacts, row.contacts_at_fault) == (1, 0)


def test_a_contact_with_what_comes_from_behind_is_not_at_fault() -> None:
    row = judged(stage(mover(-6.0, 0.0, 12.0, 0.0, 2.0)), cruise(0.5, 8.0))
    assert row.contacts == 1
    assert row.contacts_at_fault == 0


def test_a_contact_with_what_steps_out_too_near_is_not_at_fault() -> None:
    """It comes from the side, out of the field of view, at 3 m/s: nobody could do anything about it."""
    row = judged(stage(mover(3.2, 6.0, 3.2, -6.0, 3.0, start_s=0.2), length_m=9.0), cruise(1.0, 6.0))
    assert row.contacts == 1
    assert row.contacts_at_fault == 0


def test_a_contact_with_what_was_seen_coming_is_at_fault() -> None:
    row = judged(stage(mover(9.0, 2.0, 3.0, -1.0, 0.9), length_m=9.0), cruise(0.6, 9.0))
    assert row.contacts == 1
    assert row.contacts_at_fault == 1


def sets_off(x_m: float, y_m: float, at_s: float, speed_mps: float) -> RobotBody:
    """Stands in view, and drives across the way later."""
    steps = (
        Wait(kind="wait", duration_s=at_s),
        Go(kind="go", x_m=x_m, y_m=-4.0, speed_mps=speed_mps),
    )
    who = mover(x_m, y_m, x_m, -4.0, speed_mps)
    return who.model_copy(update={"motion": MotionPlan(accel_mps2=20.0, steps=steps)})


@pytest.mark.parametrize(
    ("faults", "at_fault"),
    [
        (Faults(), 1),
        (silent(2.95, 9.0), 0),
        (frozen(2.95, 9.0), 0),
        (late(0.0, 9.0, 0.5), 0),
        # Two looks it takes, and these are none: one at 3.1 s, the next one after the gap.
        (silent(3.15, 3.55), 0),
        # Nobody drives on for two seconds without a picture.
        (silent(0.5, 9.0), 1),
        (frozen(0.5, 4.0), 1),
    ],
)
def test_the_driver_has_no_better_eyes_than_the_robot(faults: Faults, at_fault: int) -> None:
    """Who sets off after 3 s touches the robot's side 0.7 s later."""
    row = judged(stage(sets_off(3.6, 1.6, 3.0, 1.0), length_m=9.0, faults=faults), cruise(0.6, 9.0))
    assert (row.contacts, row.contacts_at_fault) == (1, at_fault)


@pytest.mark.parametrize("faults", [Faults(), silent(1.3, 4.35)])
def test_stop_without_a_visible_body_does_not_count_as_going_on(faults: Faults) -> None:
    steps = (
        Go(kind="go", x_m=4.5, y_m=1.5, speed_mps=1.5),
        Wait(kind="wait", duration_s=3.0),
        Go(kind="go", x_m=4.5, y_m=-3.0, speed_mps=0.8),
    )
    who = mover(4.5, 3.5, 4.5, -3.0, 1.5)
    who = who.model_copy(update={"motion": MotionPlan(accel_mps2=20.0, steps=steps)})
    row = judged(stage(who, length_m=9.0, faults=faults), cruise(0.9, 8.0))
    assert (row.contacts, row.contacts_at_fault) == (1, 0)


@pytest.mark.parametrize(("gain_mps2", "at_fault"), [(0.0, 1), (0.3, 0)])
def test_the_driver_takes_over_the_robot_as_it_is(gain_mps2: float, at_fault: int) -> None:
    """First seen at the same place and speed; but one is just becoming faster, and brakes later for that."""
    steps = 140
    before = [max(0.6 - gain_mps2 * 0.02 * (steps - k), 0.0) for k in range(steps)]
    log = log_of(before + [0.6] * 300, s_m=0.6 * steps * 0.02 - sum(before) * 0.02)
    narrow = CONFIG.model_copy(update={"camera": SimulatedCameraConfig(width=640)})
    row = judged(stage(mover(3.3, -4.3, 3.3, 4.0, 1.4, start_s=0.6), length_m=9.0), log, narrow)
    assert (row.contacts, row.contacts_at_fault) == (1, at_fault)


def test_body_that_stands_shows_no_sign_of_moving_on() -> None:
    """It comes to 1.5 m beside the path in full view, stands, and walks into the robot's side."""
    steps = (
        Go(kind="go", x_m=4.5, y_m=1.5, speed_mps=1.5),
        Wait(kind="wait", duration_s=3.0),
        Go(kind="go", x_m=4.5, y_m=-3.0, speed_mps=1.5),
    )
    who = mover(4.5, 3.5, 4.5, -3.0, 1.5)
    made = stage(who.model_copy(update={"motion": MotionPlan(accel_mps2=20.0, steps=steps)}), length_m=9.0)
    row = judged(made, cruise(1.0, 8.0))
    assert (row.contacts, row.contacts_at_fault) == (1, 0)


@pytest.mark.parametrize("start_s", [0.0, 30.0])
def test_driving_into_what_stands_is_at_fault_even_if_it_moves_at_another_time(start_s: float) -> None:
    """It walks into the way and stands there, or stands there and walks on long after the contact."""
    who = (
        mover(5.5, 3.0, 5.5, 0.0, 1.5) if start_s == 0.0 else mover(5.5, 0.0, 5.5, 3.0, 1.5, start_s=start_s)
    )
    row = judged(stage(who, length_m=9.0), cruise(0.6, 12.0))
    assert (row.contacts, row.contacts_at_fault) == (1, 1)


def test_a_touch_between_two_control_steps_is_found() -> None:
    """Something flies past the robot's nose at 10 m/s: within one step of 20 ms it has come and gone."""
    graze = mover(1.05, 8.0, 1.05, -8.0, 10.0, start_s=0.0)
    row = judged(stage(graze.model_copy(update={"length_m": 0.05})), cruise(0.0, 3.0))
    assert row.min_clearance_m < 0.12


def test_time_and_limits_come_from_the_drive() -> None:
    log = cruise(1.0, 4.0)
    log.reached_s = 4.0
    log.setpoints.max_jerk_mps3, log.setpoints.reversals, log.setpoints.violations = 0.6, 2, 3
    row = judged(stage(length_m=4.0), log)
    assert (row.reached, row.expected, row.time_s) == (True, True, 4.0)
    assert (row.max_jerk_mps3, row.reversals, row.limit_violations) == (0.6, 2, 3)
    assert row.oracle_time_s is not None


def test_mission_that_the_oracle_cannot_finish_has_no_time() -> None:
    made = stage(crate(4.0), blocked=True)
    reference = replace(judge_reference(made, CONFIG), oracle=OracleTime(math.inf, math.inf))
    row = judge(made, cruise(0.0, 1.0), "ours", "noise", reference)
    assert (row.oracle_time_s, row.time_s, row.expected) == (None, None, False)


@pytest.mark.parametrize(
    ("actions", "expected"),
    [
        ([(UP, 1.0), (DOWN, 1.0), (UP, 1.0)], 0),
        ([(UP, 0.5), (DOWN, 0.5), (UP, 0.5), (DOWN, 0.5)], 1),
        ([(UP, 0.5), (KEEP, 0.1), (DOWN, 0.5), (KEEP, 0.1), (UP, 0.5), (DOWN, 0.5)], 1),
        ([(UP, 1.0), (DOWN, 1.5), (UP, 1.5), (DOWN, 1.0)], 0),
        ([(UP, 0.2), (DOWN, 0.2)] * 4, 2),
        ([(DOWN, 0.2), (KEEP, 0.2)] * 6, 0),
    ],
)
def test_flaps_are_three_turns_within_two_seconds(actions: list[tuple[Action, float]], expected: int) -> None:
    log = cruise(1.0, 30.0)
    every = [action for action, duration_s in actions for _ in range(round(duration_s / 0.02))]
    log.actions[: len(every)] = every
    log.actions[len(every) :] = [KEEP] * (len(log.actions) - len(every))
    assert flaps(log) == expected


def stop_and_go(stop_at_s: float, stands_s: float) -> DriveLog:
    parts = [(1.0, stop_at_s), (0.0, stands_s), (1.0, 2.0)]
    return log_of([v for v, duration_s in parts for _ in range(round(duration_s / 0.02))])


def test_a_stop_before_nothing_is_false() -> None:
    assert len(false_stops(stage(length_m=20.0), stop_and_go(3.0, 2.0))) == 1


def test_a_stop_before_a_crate_is_right() -> None:
    assert false_stops(stage(crate(8.0), length_m=20.0), stop_and_go(3.0, 2.0)) == []


def test_a_stop_for_a_crate_beside_the_swept_floor_is_false() -> None:
    assert len(false_stops(stage(crate(8.0, 0.8), length_m=20.0), stop_and_go(3.0, 2.0))) == 1


def test_a_stop_for_somebody_who_has_just_left_the_way_is_right() -> None:
    """It crosses from 1.5 to 4 s; the robot stands from 3 s on."""
    crossing = mover(6.0, 2.0, 6.0, -4.0, 1.0)
    assert false_stops(stage(crossing, length_m=20.0), stop_and_go(3.0, 3.0)) == []


def test_a_stop_for_a_camera_that_says_nothing_is_right() -> None:
    blind = silent(2.5, 3.5)
    assert false_stops(stage(length_m=20.0, faults=blind), stop_and_go(3.0, 2.0)) == []


def test_resting_at_the_target_is_no_stop() -> None:
    log = log_of([1.0] * 100 + [0.0] * 20)
    log.reached_s = 2.4
    assert false_stops(stage(length_m=2.0), log) == []
