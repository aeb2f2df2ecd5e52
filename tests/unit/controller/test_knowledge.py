"""What the decision knows of the way ahead: who is a newcomer, and who only has a new number."""

from __future__ import annotations

import pytest

from config.decision import DecisionConfig
from config.robot import Robot
from controller.knowledge import Knowledge
from controller.path import OnPath
from hal.types import PlanarPose
from tests.support.deciding import MOUNT, PATH, Bench, obstacle
from vision.scene import Obstacle

START = OnPath(0.0, 0.0, 0.0)


def ages_s(*shown: Obstacle) -> list[float]:
    """For how long each was seen, by what is known after ten frames of a crate and one of these instead."""
    bench = Bench()
    known = Knowledge(PATH, Robot(), MOUNT, DecisionConfig(), 0.0)
    for one in [(obstacle(4.0, 0.0),)] * 10 + [shown]:
        bench.now_ns += 33_000_000
        known.update(bench.scene(*one), PlanarPose(0.0, 0.0, 0.0), START, 0.5, bench.now_ns)
    ages_s: list[float] = known.bodies.age_s.tolist()
    return ages_s


def test_what_stands_where_something_stood_is_no_newcomer() -> None:
    assert ages_s(obstacle(4.0, 0.1, age_s=0.03, number=6)) == [0.5]
    assert ages_s(obstacle(4.0, 1.0, age_s=0.03, number=6)) == [pytest.approx(0.03)]
    assert ages_s(obstacle(4.0, 0.1, age_s=2.0, number=6)) == [2.0]


def test_an_edge_that_shows_there_is_nothing_by_itself() -> None:
    """2 cm wide: when it goes, nothing is waited for that could not be seen to leave."""
    assert ages_s(obstacle(4.0, 0.1, age_s=0.03, number=6, size_m=(0.02, 0.3))) == [pytest.approx(0.03)]
    assert ages_s(obstacle(4.0, 0.1, age_s=0.03, number=6, size_m=(0.05, 0.3))) == [0.5]
