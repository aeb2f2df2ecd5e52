"""How far a body may change its velocity at worst depends on how it moves relative to the robot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from config.decision import Prediction
from config.robot import Body
from controller.decision.bodies import Bodies
from controller.decision.corridor import Corridor, path_velocities, place
from controller.decision.manoeuvres import Manoeuvres, manoeuvres_of
from controller.decision.watched import Watched
from tests.support.floor_bodies import box, line_path

CORRIDOR = Corridor(line_path(), Body(width_m=0.8, length_m=1.0, rear_m=0.5))
PREDICTION = Prediction(sigmas=2.0)
UNSEEN_S, SINCE_S = 0.5, 0.1


def found(body: Bodies, unseen_s: float = UNSEEN_S) -> Manoeuvres:
    """For a body that was last seen unseen_s before its scene, which was 0.1 s ago."""
    body = replace(body, unseen_s=np.array([unseen_s]))
    placed = place(body, CORRIDOR, np.zeros(1), 0.0, 12.0)
    velocities = path_velocities(body, placed.heading_rad[:, 0])
    none = np.array([False])
    return manoeuvres_of(Watched(body, SINCE_S, placed, velocities, none, none), PREDICTION)


@pytest.mark.parametrize(
    ("body", "along_mps2", "left_mps2"),
    [
        (box(5.0, 2.0, 0.0, -1.0), PREDICTION.manoeuvre_mps2, PREDICTION.manoeuvre_mps2),
        (box(5.0, 2.0, 1.0, 0.0), PREDICTION.cut_in_mps2, PREDICTION.cut_in_mps2),
        (box(5.0, 0.0, 1.0, 0.0), PREDICTION.manoeuvre_mps2, PREDICTION.cut_in_mps2),
        (box(5.0, 2.0, -1.0, 0.0, age_s=2.0), PREDICTION.manoeuvre_mps2, PREDICTION.oncoming_mps2),
        (box(5.0, 2.0, -1.0, 0.0, age_s=0.5), PREDICTION.manoeuvre_mps2, PREDICTION.manoeuvre_mps2),
        (box(5.0, 2.0), 0.0, 0.0),
    ],
    ids=["crosses", "same way, beside", "same way, ahead", "comes", "comes, just seen", "stands"],
)
def test_how_hard_it_may_accelerate(body: Bodies, along_mps2: float, left_mps2: float) -> None:
    may_do = found(body)
    assert may_do.change_along_mps2[0] == along_mps2
    assert may_do.change_left_mps2[0] == left_mps2


def test_its_speed_and_twice_the_spread_of_its_velocity() -> None:
    may_do = found(box(5.0, 2.0, 0.3, -0.4, sigma_mps=0.1))
    assert may_do.speed_mps[0] == pytest.approx(0.5)
    assert may_do.spread_along_mps[0] == pytest.approx(0.2)
    assert may_do.spread_left_mps[0] == pytest.approx(0.2)


def test_a_velocity_that_has_just_changed_may_have_changed_by_more_in_the_same_direction() -> None:
    body = replace(box(5.0, 2.0, 0.3, -0.4, sigma_mps=0.1), innovation_mps=np.array([[-0.7, 0.6]]))
    may_do = found(body)
    assert may_do.surprise_along_mps[0] == pytest.approx(-0.7)
    assert may_do.surprise_left_mps[0] == pytest.approx(0.6)
    assert may_do.spread_along_mps[0] == may_do.spread_left_mps[0] == pytest.approx(0.2)


def test_body_that_comes_or_leaves_has_not_turned_out_of_view() -> None:
    crosses, comes = found(box(5.0, 2.0, 0.0, -1.0)), found(box(5.0, 2.0, -1.0, 0.0))
    leaves = found(box(5.0, 2.0, 0.0, 1.0))
    assert crosses.since_s[0] == pytest.approx(SINCE_S + UNSEEN_S)
    assert comes.since_s[0] == leaves.since_s[0] == pytest.approx(SINCE_S)
    assert crosses.uncertain_left_m[0] == comes.uncertain_along_m[0] == pytest.approx(2.0 * UNSEEN_S * 0.1)
    assert leaves.uncertain_left_m[0] == leaves.uncertain_along_m[0] == 0.0


def test_out_of_view_only_who_comes_nearly_straight_keeps_its_lane() -> None:
    """At 34 degrees to the path it may well cross it; in view, it would be seen to."""
    straight, aslant = found(box(5.0, 2.0, -1.0, -0.4)), found(box(5.0, 2.0, -1.0, -0.67))
    assert straight.since_s[0] == pytest.approx(SINCE_S)
    assert straight.change_left_mps2[0] == PREDICTION.oncoming_mps2
    assert aslant.since_s[0] == pytest.approx(SINCE_S + UNSEEN_S)
    assert aslant.change_left_mps2[0] == PREDICTION.manoeuvre_mps2
    assert found(box(5.0, 2.0, -1.0, -0.67), unseen_s=0.0).change_left_mps2[0] == PREDICTION.oncoming_mps2
