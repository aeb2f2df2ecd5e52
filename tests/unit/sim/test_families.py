from __future__ import annotations

import pytest

from config.faults import Faults, Window
from sim.families import FAMILY_NAMES, generate
from sim.families.registry import USUAL_SLIP
from tests.support.campaign import silent


@pytest.mark.parametrize("family", FAMILY_NAMES)
def test_the_same_seed_is_the_same_mission(family: str) -> None:
    assert generate(family, 4) == generate(family, 4)
    assert generate(family, 4).scenario != generate(family, 5).scenario
    assert generate(family, 4).scenario.name == f"{family}-4"


def test_an_unknown_family_is_refused() -> None:
    with pytest.raises(KeyError, match="no_such"):
        generate("no_such", 1)


def test_every_fault_is_brought_about_by_its_family_alone() -> None:
    usual = Faults(yaw_slip=USUAL_SLIP)
    spoiled = {name for name in FAMILY_NAMES if generate(name, 0).faults != usual or generate(name, 0).glass}
    assert spoiled == {
        "glass_front",
        "camera_dropout",
        "camera_frozen",
        "odometry_slip",
        "late_frames",
        "feedback_lost",
    }


def test_a_window_holds_from_its_start_to_before_its_end() -> None:
    window = Window(start_s=2.0, end_s=3.0)
    assert [window.contains(t_s) for t_s in (1.99, 2.0, 2.99, 3.0)] == [False, True, True, False]


def test_a_fault_strikes_in_its_window_and_a_little_after() -> None:
    faults = silent(2.0, 3.0)
    assert [faults.demands_stop(t_s, 1.0) for t_s in (1.9, 2.0, 3.9, 4.0)] == [False, True, True, False]
    lost = Faults(feedback_lost_s=5.0)
    assert [lost.demands_stop(t_s, 1.0) for t_s in (4.9, 5.0, 50.0)] == [False, True, True]
    assert not Faults().demands_stop(1.0, 1.0)
