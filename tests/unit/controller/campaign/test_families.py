from __future__ import annotations

import math

import numpy as np
import pytest

from controller.campaign import oracle
from controller.campaign.stage import Stage, sight_limited_speed_mps
from sim.families import FAMILY_NAMES, generate
from sim.polygons import separation
from tests.support.campaign import CONFIG

TOP_MPS = sight_limited_speed_mps(CONFIG)


@pytest.mark.parametrize("family", FAMILY_NAMES)
def test_missions_start_clear_and_are_solvable_unless_they_are_blocked(family: str) -> None:
    for seed in range(21):
        made = Stage(generate(family, seed), CONFIG.robot)
        scenario = made.case.scenario
        robot = made.robot_polygons(made.path_poses(np.zeros(1)))
        for t_s in (0.0, 1.0):
            polygons, _ = made.world.snapshot(t_s)
            gaps = separation(np.repeat(robot, len(polygons), axis=0), polygons)[made.in_height]
            assert gaps.min(initial=math.inf) > 0.15, (seed, t_s)
        best = oracle.solve(made, TOP_MPS, scenario.duration_s)
        assert math.isfinite(best.total_s) == (scenario.outcome == "target"), seed
        assert made.world.end_s < scenario.duration_s, seed


@pytest.mark.parametrize("family", FAMILY_NAMES)
def test_walkers_of_all_families_stay_clear_of_racks(family: str) -> None:
    for seed in range(6):
        world = Stage(generate(family, seed), CONFIG.robot).world
        times = np.arange(0.0, 25.0, 0.25)
        for mover in np.flatnonzero(world.moves).tolist():
            way = world.sample(times, mover)
            for still in np.flatnonzero(~world.moves).tolist():
                assert separation(way, world.sample(times, still)).min() > -0.05, (seed, world.names[still])


def test_the_envelope_never_exceeds_the_robots_top_speed() -> None:
    assert 0.5 < TOP_MPS <= CONFIG.robot.limits.max_speed_mps
    near = CONFIG.decision.sight.model_copy(update={"range_m": 3.0})
    short = CONFIG.model_copy(update={"decision": CONFIG.decision.model_copy(update={"sight": near})})
    assert sight_limited_speed_mps(short) < 0.8 * TOP_MPS
