"""How old a frame is, by hand: one every 20 ms of the sender's clock."""

from __future__ import annotations

import pytest

from hal.chassis.frame_age import FrameAge
from tests.support.chassis_rig import MS


def test_the_fastest_frame_has_no_age_and_the_others_what_they_waited() -> None:
    """The allowance for drift is a hundredth of the time between two arrivals."""
    age = FrameAge()
    assert age.step(7, 1000 * MS) == 0
    assert age.step(20, 1020 * MS) == 0
    assert age.step(20, 1070 * MS) == 30 * MS - 50 * MS // 100
    assert age.step(20, 1071 * MS) == 11 * MS - 51 * MS // 100
    assert age.step(20, 1075 * MS) == 0, "faster than any before"
    assert age.step(20, 1100 * MS) == 5 * MS - 25 * MS // 100
    age.restart()
    assert age.step(-5000, 1120 * MS) == 0


@pytest.mark.parametrize("sender_ms", [199, 200, 201])
def test_clocks_that_drift_by_one_in_two_hundred_are_no_delay(sender_ms: int) -> None:
    """An hour and more of frames."""
    age = FrameAge()
    assert {age.step(sender_ms, k * 200 * MS) for k in range(20_000)} == {0}


def test_camera_that_falls_behind_by_five_percent_is_noticed() -> None:
    """Of 50 ms that are lost each second 10 are taken for drift: 200 ms of age after 5 s."""
    age = FrameAge()
    ages = [age.step(190, k * 200 * MS) for k in range(27)]
    assert ages[25] == 200 * MS
