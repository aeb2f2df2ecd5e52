"""Limits for who moves: which choices and margins are kept from step to step, and until when."""

from __future__ import annotations

import numpy as np
import pytest

from config.decision import DecisionConfig, Margins
from config.robot import Body, Limits
from controller.decision.bodies import Bodies
from controller.decision.corridor import Corridor, path_velocities, place
from controller.decision.crossing import likely_enters
from controller.decision.lateral_margin import LateralMargin
from controller.decision.limits import Motion
from controller.decision.moving_limits import MovingLimits
from controller.decision.watched import Watched
from tests.support.floor_bodies import box, line_path

TIMES = np.arange(0.0, 8.1, 0.2)
CORRIDOR = Corridor(line_path(), Body(width_m=0.8, length_m=1.0, rear_m=0.5))


def asked(moving: MovingLimits, bodies: Bodies, now_s: float) -> None:
    """For a robot at 0 that drives 1 m/s."""
    placed = place(bodies, CORRIDOR, TIMES, 0.0, 12.0)
    velocities = path_velocities(bodies, placed.heading_rad[:, 0])
    enters = likely_enters(placed, TIMES, np.zeros(len(bodies)))
    watched = Watched(bodies, 0.0, placed, velocities, enters, enters)
    moving.limits(watched, 0.0, Motion(1.0, 0.0, 0.2), 1.5, now_s)


def in_the_way_of(beside: LateralMargin) -> list[int]:
    """Which of the bodies 1 and 2 have to leave the wider margin."""
    return [track_id for track_id in (1, 2) if beside.needed_m(track_id) > beside.lateral_m]


@pytest.mark.parametrize("besides", [False, True])
def test_a_mover_that_has_left_has_no_wider_margin_for_having_grazed(besides: bool) -> None:
    """Whether somebody else is still in the way, or nobody."""
    beside = LateralMargin(Margins())
    moving = MovingLimits(DecisionConfig(), Limits(), TIMES, beside)
    other = box(8.0, 0.0, -0.5, 0.0, number=2)
    crosses, gone = box(6.0, 0.0, 0.0, 0.5), box(6.0, 2.0, 0.0, 0.5)
    asked(moving, crosses.joined(other), 0.0)
    assert in_the_way_of(beside) == [1, 2]
    asked(moving, gone.joined(other) if besides else gone, 2.0)
    assert in_the_way_of(beside) == [2], "not asked of, or still in the way"


def test_a_mover_that_is_hardly_out_of_the_way_still_has_it() -> None:
    """It may stop there, and whether it moves is not certain in each scene."""
    beside = LateralMargin(Margins())
    moving = MovingLimits(DecisionConfig(), Limits(), TIMES, beside)
    asked(moving, box(6.0, 0.0, 0.0, 0.5), 0.0)
    left_m = 0.4 + 0.25 + DecisionConfig().margins.lateral_m + 0.5 * DecisionConfig().margins.graze_m
    asked(moving, box(6.0, left_m, 0.0, 0.5), 2.0)
    assert in_the_way_of(beside) == [1]
