"""Where the robot is that keeps its path."""

from __future__ import annotations

import math

import pytest

from config.path import ArcSpec, PathSpec
from controller.campaign.stage import Stage
from sim.families import Case
from tests.support.campaign import CONFIG, stage

BEND = PathSpec(segments=(ArcSpec(kind="arc", radius_m=2.0, angle_deg=90.0),))


@pytest.mark.parametrize("s_m", [0.0, 0.013, 1.0, 3.1])
def test_the_table_is_the_path_and_what_is_beside_it(s_m: float) -> None:
    scenario = stage().case.scenario.model_copy(update={"path": BEND})
    pose = Stage(Case("made", 1, scenario), CONFIG.robot).pose(s_m, 0.5)
    angle = s_m / 2.0
    assert pose.heading_rad == pytest.approx(angle)
    assert (pose.x_m, pose.y_m) == pytest.approx(
        (1.5 * math.sin(angle), 2.0 - 1.5 * math.cos(angle)), abs=1e-4
    )


def test_beyond_the_table_it_stands_at_its_ends() -> None:
    made = stage(length_m=10.0)
    assert made.pose(-1.0) == made.pose(math.nan) == made.pose(0.0)
    assert made.pose(1000.0).x_m == pytest.approx(11.0, abs=0.03)
