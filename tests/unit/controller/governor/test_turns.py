"""Turns in place: controller.governor.governor.SpeedGovernor in closed loop, among boxes."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from config.governor import GovernorConfig
from config.robot import Robot
from controller.base.response_monitor import SpeedCap
from controller.governor.request import Twist
from tests.support.closed_loop import PERIOD_S, Box, standing_at, walking
from tests.support.governed_drive import GovernedDrive, after, last_sentence, rules
from vision.scene import Scene

LIMITS = Robot().limits


def test_a_turn_in_place_at_the_start_is_free_by_consent_and_jerk_limited() -> None:
    drive = GovernedDrive(lambda t: Twist(0.0, 0.5) if t < 5.0 else Twist(0.0, 0.0))
    steps = drive.run(9.0)
    w = [one.governed.w_radps for one in steps]
    assert max(w) == pytest.approx(0.5)
    assert w[-1] == 0.0
    assert all(one.governed.v_mps == 0.0 for one in steps)
    corner_m = math.hypot(0.51, 0.39)
    rates = np.diff(w) * corner_m / PERIOD_S
    assert np.abs(rates).max() <= LIMITS.max_accel_mps2 + 1e-6
    assert np.abs(np.diff(rates)).max() / PERIOD_S <= LIMITS.max_jerk_mps3 + 1e-3
    assert math.hypot(steps[-1].pose.x_m, steps[-1].pose.y_m) < 1e-6


def stop_then_turn(t: float) -> Twist:
    return Twist(0.8, 0.0) if t < 8.0 else Twist(0.0, 0.5)


def test_between_driving_and_turning_the_robot_stands() -> None:
    steps = GovernedDrive(stop_then_turn).run(14.0)
    turning = [one for one in steps if one.governed.v_mps == 0.0 and one.governed.w_radps > 0.0]
    assert turning[0].t_s > 10.0
    assert turning[-1].governed.w_radps == pytest.approx(0.5)
    for one in after(steps, 8.0):
        assert one.governed.v_mps == 0.0 or one.governed.w_radps == 0.0


def test_turning_the_other_way_goes_through_standstill() -> None:
    steps = GovernedDrive(lambda t: Twist(0.0, 0.5 if t < 4.0 else -0.5)).run(10.0)
    w = np.array([one.governed.w_radps for one in steps])
    assert w.min() == pytest.approx(-0.5)
    assert np.abs(np.diff(w)).max() < 0.012


def test_no_turn_in_place_beside_a_wall_that_its_corners_would_touch() -> None:
    wall = Box(standing_at(8.0, 0.7), length_m=20.0, width_m=0.2)
    steps = GovernedDrive(stop_then_turn, [wall]).run(14.0)
    assert all(one.governed.w_radps == 0.0 for one in steps)
    assert rules(steps)[-1] == "turn"
    assert "something stands 0.0 m ahead and 0.5 m to the left" in last_sentence(steps)
    free = GovernedDrive(stop_then_turn, [Box(standing_at(8.0, 1.2), length_m=20.0, width_m=0.2)]).run(14.0)
    assert free[-1].governed.w_radps == pytest.approx(0.5)


def test_no_turn_in_place_on_floor_that_was_seen_too_long_ago() -> None:
    drive = GovernedDrive(stop_then_turn, config=GovernorConfig(turn_memory_s=2.0))
    steps = drive.run(14.0)
    assert all(one.governed.w_radps == 0.0 for one in steps)
    assert "has not been seen within 2 s" in last_sentence(steps)


def test_a_person_who_comes_near_stops_a_turn() -> None:
    # They walk straight at the robot's side from ahead, where the camera sees them.
    person = Box(walking(5.0, 0.3, -1.0, 0.0, from_s=0.0, to_s=3.9))
    steps = GovernedDrive(lambda _: Twist(0.0, 0.02), [person]).run(6.0)
    assert rules(steps)[:3] == ["camera", "requested", "turn"]
    stood = next(one for one in steps if one.governed.decision.reason.rule == "turn" and one.t_s > 1.0)
    assert stood.clearance_m > 1.0
    assert after(steps, stood.t_s + 0.6)[0].governed.w_radps == 0.0


def test_turn_in_place_is_refused_beside_a_body_too_near_to_be_measured() -> None:
    def covered(scene: Scene, t: float) -> Scene:
        free = scene.free_space
        nothing = replace(free, nearest_m=free.nearest_m * math.inf, known_m=0.0 * free.known_m)
        return scene if t < 4.0 else replace(scene, free_space=nothing)

    steps = GovernedDrive(lambda _: Twist(0.0, 0.1), alter=covered).run(7.0)
    assert max(one.governed.w_radps for one in steps) == pytest.approx(0.1)
    assert steps[-1].governed.w_radps == 0.0
    assert rules(steps)[-1] == "turn"
    assert "right before the camera nothing is seen" in last_sentence(steps)


def test_turn_in_place_ends_where_the_base_runs_away_ahead(monkeypatch: pytest.MonkeyPatch) -> None:
    """A base that moves ahead at a command of 0 gets a cap of 0 (controller/base/response_monitor.py)."""
    drive = GovernedDrive(lambda _: Twist(0.0, 0.5))
    assert drive.run(4.0)[-1].governed.w_radps == pytest.approx(0.5)
    monkeypatch.setattr(drive.governor, "step", partial(drive.governor.step, cap=SpeedCap(0.0, hard=True)))
    assert drive.run(6.0)[-1].governed.w_radps == 0.0
