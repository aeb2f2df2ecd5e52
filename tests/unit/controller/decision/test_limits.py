"""A stop before something, as a limit with all its numbers."""

from __future__ import annotations

import math

import pytest

from controller.braking import BrakeLimits
from controller.decision.limits import Gap, Motion, standing_text, stop_before

COMFORT = BrakeLimits(0.3, 0.6)


def test_obstacle_far_enough_limits_nothing_and_states_its_margin() -> None:
    """From 1.5 m/s: 4.125 m, 0.2 s of latency 0.3 m, margin 0.45 m; 6 m leave 1.125 m."""
    limit = stop_before(
        Gap(6.0, obstacle_id=3), Motion(1.5, 0.0, 0.2), COMFORT, 0.45, 0.2, "static", "stands"
    )
    assert limit.speed_mps > 1.5
    assert not limit.urgent
    reason = limit.reason
    assert (reason.rule, reason.obstacle_id, reason.distance_m) == ("static", 3, 6.0)
    assert (reason.required_m, reason.margin_m) == pytest.approx((4.875, 1.125))
    assert reason.sentence.startswith("obstacle 3 stands 6.0 m ahead: at most 1.")


def test_a_body_that_is_remembered_is_told_as_not_seen() -> None:
    """Whoever finds the robot waiting sees nothing there, and should know what it waits for."""

    def told(unseen_s: float) -> str:
        gap = Gap(0.7, obstacle_id=3, unseen_s=unseen_s)
        return stop_before(gap, Motion(0.0, 0.0, 0.2), COMFORT, 0.7, 0.2, "static", "stands").reason.sentence

    assert told(12.3) == "obstacle 3 (not seen for 12 s) stands 0.7 m ahead: stop"
    assert told(0.9) == "obstacle 3 stands 0.7 m ahead: stop"


def test_comfort_is_urgent_when_less_than_the_least_margin_would_be_left() -> None:
    def urgent(distance_m: float) -> bool:
        motion = Motion(1.5, 0.0, 0.2)
        return stop_before(Gap(distance_m), motion, COMFORT, 0.45, 0.2, "depth", "stands").urgent

    assert not urgent(4.875 - 0.24)
    assert urgent(4.875 - 0.26)


def test_standing_is_never_urgent() -> None:
    motion = Motion(0.0, 0.0, 0.2)
    limit = stop_before(Gap(0.0), motion, COMFORT, 0.45, 0.2, "depth", "stands")
    assert limit.speed_mps == 0.0
    assert not limit.urgent
    assert limit.reason.sentence == "a surface stands 0.0 m ahead: stop"


def test_text_of_a_body_beside_the_path_states_its_room_and_the_need() -> None:
    assert standing_text(-0.1, 0.2) == standing_text(math.inf, 0.2) == "stands on the path"
    assert standing_text(0.12, 0.2) == "leaves 0.12 m beside the swept width (0.20 m needed),"


def test_an_oncoming_obstacle_needs_more() -> None:
    motion = Motion(1.0, 0.0, 0.2)
    standing = stop_before(Gap(8.0), motion, COMFORT, 0.45, 0.2, "static", "")
    coming = stop_before(Gap(8.0, closing_mps=1.0), motion, COMFORT, 0.45, 0.2, "oncoming", "")
    assert coming.reason.required_m - standing.reason.required_m == pytest.approx(0.2 + 1 / 0.3 + 0.5)
    assert coming.speed_mps < standing.speed_mps


def test_leader_that_runs_ahead_gives_room() -> None:
    motion = Motion(1.0, 0.0, 0.2)
    alone = stop_before(Gap(2.0), motion, COMFORT, 0.45, 0.2, "leader", "")
    running = stop_before(
        Gap(2.0, closing_mps=-1.0, leader_stop_m=0.5), motion, COMFORT, 0.45, 0.2, "leader", ""
    )
    assert running.speed_mps > alone.speed_mps
    assert running.reason.distance_m == 2.0
    assert running.reason.margin_m == pytest.approx(alone.reason.margin_m + 0.5)


def test_an_acceleration_under_way_lowers_the_limit() -> None:
    steady = stop_before(Gap(4.0), Motion(1.0, 0.0, 0.2), COMFORT, 0.45, 0.2, "static", "")
    speeding = stop_before(Gap(4.0), Motion(1.0, 0.3, 0.2), COMFORT, 0.45, 0.2, "static", "")
    braking = stop_before(Gap(4.0), Motion(1.0, -0.3, 0.2), COMFORT, 0.45, 0.2, "static", "")
    assert speeding.speed_mps < steady.speed_mps
    assert braking.speed_mps == steady.speed_mps
