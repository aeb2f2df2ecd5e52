"""How far from what blocks the way the robot stands."""

from __future__ import annotations

import pytest

from config.decision import DecisionConfig, SightConfig
from tests.support.closed_loop import Mission, Thing, stands, straight


@pytest.mark.parametrize("near_m", [1.3, 0.4, 0.18])
def test_a_camera_that_looks_down_steeply_is_no_reason_to_stand_nearer(near_m: float) -> None:
    config = DecisionConfig(sight=SightConfig(near_m=near_m))
    crate = Thing(stands(9.0, 0.0), length_m=0.6, width_m=0.6, height_m=1.2)
    log = Mission(straight(14.0), [crate], config=config).run(40.0)
    assert min(log.clearance_m) == pytest.approx(config.margins.stop_m, abs=0.02)
    assert not any(decision.emergency for decision in log.decisions)
