"""The limit by what obstacles could do at worst: how far ahead it has to look, and for how long aside."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from config.decision import DecisionConfig, Prediction
from config.robot import Body, Limits
from controller import braking
from controller.decision.bodies import Bodies
from controller.decision.corridor import Corridor, path_velocities, place
from controller.decision.limits import Limit, Motion
from controller.decision.watched import Watched
from controller.decision.worst_case_limit import WorstCase
from tests.support.floor_bodies import box, line_path

LIMITS = Limits()
LATENCY_S = 0.2
CORRIDOR = Corridor(line_path(), Body(width_m=0.8, length_m=1.0, rear_m=0.5))


def asked(worst: WorstCase, body: Bodies, v_mps: float, chosen_mps: float | None = None) -> Limit | None:
    """Of a robot at 0 that drives v_mps, and would go on so if nothing else is chosen."""
    placed = place(body, CORRIDOR, worst.times_s, 0.0, 12.0)
    velocities = path_velocities(body, placed.heading_rad[:, 0])
    motion = Motion(v_mps, 0.0, LATENCY_S)
    enters = np.array([True])
    watched = Watched(body, 0.0, placed, velocities, enters, enters)
    return worst.limit(watched, 0.0, motion, v_mps if chosen_mps is None else chosen_mps)


def limit(lo_m: float, age_s: float, confirm_s: float) -> Limit | None:
    """For a robot at its greatest speed with lo_m of free way to something that stands on it."""
    config = DecisionConfig(prediction=Prediction(confirm_s=confirm_s))
    worst = WorstCase(config, LIMITS)
    body = box(0.0, 0.0, age_s=age_s, sigma_mps=0.0)
    at_zero_m = place(body, CORRIDOR, np.zeros(1), 0.0, 12.0).block_from_s_m[0, 0]
    body = box(lo_m - at_zero_m, 0.0, age_s=age_s, sigma_mps=0.0)
    return asked(worst, body, LIMITS.max_speed_mps)


@pytest.mark.parametrize("confirm_s", [1.0, 2.0])
def test_young_body_counts_once_there_is_no_room_left_to_confirm_it(confirm_s: float) -> None:
    """Until it is confirmed the robot goes on; the hard stop after that must still fit."""
    v_mps = LIMITS.max_speed_mps
    stop_m = braking.stop(v_mps, 0.0, braking.emergency(LIMITS)).distance_m
    needed_m = stop_m + (LATENCY_S + confirm_s) * v_mps + DecisionConfig().margins.least_m
    near = limit(needed_m - 0.5, age_s=0.0, confirm_s=confirm_s)
    assert near is not None
    assert near.speed_mps < v_mps
    assert limit(needed_m + 0.01, age_s=0.0, confirm_s=confirm_s) is None
    # Confirmed: nothing has to be waited for.
    assert limit(needed_m - 0.5, age_s=5.0, confirm_s=confirm_s) is None


def beside(x_m: float, unseen_s: float) -> Limit | None:
    """For a robot at 0 that drives 0.5 m/s, its front at 0.5 m; somebody comes towards it along its left
    side, 0.75 m clear, and has not been seen for so long."""
    worst = WorstCase(DecisionConfig(), LIMITS)
    body = replace(box(x_m, 0.4 + 0.25 + 0.75, -0.9, 0.0, sigma_mps=0.15), unseen_s=np.array([unseen_s]))
    return asked(worst, body, 0.5)


def test_position_of_an_unseen_body_is_as_uncertain_as_its_velocity() -> None:
    """In 2 s twice 0.15 m/s may add up to 0.6 m of those 0.75."""
    assert beside(2.0, 0.0) is None
    found = beside(2.0, 2.0)
    assert found is not None
    assert found.speed_mps < 0.5


def test_unseen_body_expected_beside_the_robot_may_still_be_ahead() -> None:
    """Its near side 0.2 m behind the robot's front."""
    assert beside(0.5, 0.0) is None
    assert beside(0.5, 2.2) is not None


def test_a_robot_that_stops_anyway_may_still_have_to_brake_harder() -> None:
    """Somebody 1 m ahead of the front steps in; by comfort it would take 2.2 m from 1 m/s."""
    worst = WorstCase(DecisionConfig(), LIMITS)
    near = asked(worst, box(1.75, 0.8, 0.0, -0.8), 1.0, chosen_mps=0.0)
    assert near is not None
    assert near.urgent
    # Where the stop that is driven anyway suffices, there is nothing to add.
    assert asked(worst, box(6.0, 0.8, 0.0, -0.8), 1.0, chosen_mps=0.0) is None
