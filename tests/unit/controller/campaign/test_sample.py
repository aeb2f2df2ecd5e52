"""A handful of the campaign's missions; `make campaign-quick` drives more of them, with all policies."""

from __future__ import annotations

import pytest

from controller.campaign.task import Task, failed, run_task
from tests.support.campaign import CONFIG


@pytest.mark.parametrize(
    ("family", "seed"),
    [
        ("head_on_person", 1),
        ("crossing_left", 1),
        ("lead_brakes", 2),
        ("static_crate", 1),
        ("crate_beside_bend", 2),
        ("crate_beside_bend", 4),
        ("narrow_aisle", 1),
        ("camera_dropout", 1),
        ("feedback_lost", 1),
    ],
)
def test_ours_touches_nothing_keeps_its_limits_and_arrives(family: str, seed: int) -> None:
    (row,) = run_task(Task(family, seed, ("ours",), "noise", CONFIG))
    assert not failed(row), row
    assert row.contacts == 0
    assert row.flaps == 0
    assert row.max_jerk_mps3 <= CONFIG.robot.limits.emergency_jerk_mps3 + 1e-6
    assert row.max_accel_mps2 <= CONFIG.robot.limits.emergency_decel_mps2 + 1e-6
