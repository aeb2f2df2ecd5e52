"""What is commanded of a base that does not do it: by the whole control loop, of bases of known numbers."""

from __future__ import annotations

import math

import pytest

from config.robot import Robot
from controller.base.drive_lifecycle import Outcome
from controller.base.response_monitor import ResponseMonitor, SpeedCap
from controller.control import ControlStep
from controller.record.tally import SetpointTally
from tests.support.imperfect_base import ImperfectBase
from tests.support.obedient_chassis import PERIOD_S
from tests.support.path_drive import drive, loop_on

LIMITS = Robot().limits


def driven(base: ImperfectBase, length_m: float = 6.0) -> tuple[list[ControlStep], Outcome | None]:
    """The steps of a whole drive, and its end."""
    loop = loop_on(base, length_m)
    return drive(loop, 2500), loop.lifecycle.outcome


@pytest.mark.parametrize("deaf_for_s", [0.6, 0.8, 1.0])
@pytest.mark.parametrize("from_s", [2.0, 4.0])
def test_a_base_that_hears_again_begins_gently_and_ends_at_the_target(
    deaf_for_s: float, from_s: float
) -> None:
    base = ImperfectBase(unresponsive_s=(from_s, from_s + deaf_for_s))
    taken, outcome = driven(base)
    told = [step for step in taken if step.unanswered]
    assert len(told) == 1
    hears = next(k for k, step in enumerate(taken) if step.setpoint.v_mps > 0.0) + round(
        (from_s + deaf_for_s) / PERIOD_S
    )
    speeds = base.speeds
    assert min(speeds[hears - 10 : hears + 10]) < 0.2
    rise_mps = [after - before for before, after in zip(speeds[hears:], speeds[hears + 10 :], strict=False)]
    assert max(rise_mps) < 0.1, "in 0.2 s; comfort is 0.06"
    assert outcome is Outcome.REACHED
    assert taken[-1].progress_m == pytest.approx(6.0, abs=0.03)
    tally = SetpointTally(LIMITS, PERIOD_S)
    for step in taken:
        tally.add(step.chassis.sent, step.chassis.mode, standing=step.unanswered != "")
    assert tally.violations == 0


@pytest.mark.parametrize("deaf_for_s", [0.53, 0.55, 0.57])
@pytest.mark.parametrize("from_s", [3.0, 4.0])
def test_after_a_dip_nothing_wrong_was_learnt_and_it_ends_at_the_target(
    deaf_for_s: float, from_s: float
) -> None:
    """It hears again before it has fallen by half. The lag and drift learnt of that made it go past."""
    base = ImperfectBase(unresponsive_s=(from_s, from_s + deaf_for_s))
    taken, outcome = driven(base, 8.0)
    assert outcome is Outcome.REACHED
    assert taken[-1].progress_m == pytest.approx(8.0, abs=0.03)


@pytest.mark.parametrize("gain", [-1.0, -2.0])
def test_a_base_that_goes_back_again_ends_the_drive(gain: float) -> None:
    """It would twitch back for ever, each time too briefly for hal/chassis/rolling_back.py."""
    taken, outcome = driven(ImperfectBase(gain=gain))
    assert outcome is Outcome.BROKEN_OFF
    assert len([step for step in taken if step.unanswered]) == 2
    assert "again; do its motors turn the right way?" in "".join(step.unanswered for step in taken)
    assert taken[-1].progress_m > -0.15


def test_a_base_that_never_hears_is_not_asked_for_more_and_more() -> None:
    """hal/chassis/following.py latches it; the command waits at what may break it loose."""
    base = ImperfectBase(unresponsive_s=(0.0, math.inf))
    taken = driven(base)[0][:400]
    assert max(step.setpoint.v_mps for step in taken) < 0.4
    assert taken[-1].setpoint.v_mps == pytest.approx(0.2, abs=0.01)


def test_a_base_that_tells_of_less_than_half_is_not_told_zero_every_few_seconds() -> None:
    """It never fell. hal/chassis/following.py latches it once it has been told to drive on for 3 s."""
    taken = driven(ImperfectBase(gain=0.45), 12.0)[0]
    assert not [step for step in taken if step.unanswered]


@pytest.mark.parametrize("gain", [2.0, 6.0])
def test_a_base_that_runs_away_is_not_told_to_go_faster(gain: float) -> None:
    base = ImperfectBase(gain=gain)
    taken = driven(base)[0][:600]
    speeds = base.speeds
    first = next(k for k, step in enumerate(taken) if speeds[k] > 1.5 * step.setpoint.v_mps + 0.16)
    held_mps = [step.setpoint.v_mps for step in taken[first : first + 100]]
    assert max(held_mps) < held_mps[0] + 0.06, "a jerk of 2 m/s3 takes 0.15 s from 0.3 m/s2"
    told_mps = max(step.setpoint.v_mps for step in taken[: first + 100])
    assert min(speeds[first + 25 : first + 100]) > 1.5 * told_mps + 0.15, "following.py latches it as before"


NORMAL = {
    "quick": ImperfectBase(lag_s=0.02),
    "a lag of 0.3 s": ImperfectBase(lag_s=0.3),
    "a lag of 2 s": ImperfectBase(lag_s=2.0),
    "a dead time of 0.3 s": ImperfectBase(dead_time_s=0.3),
    "both": ImperfectBase(lag_s=0.3, dead_time_s=0.2),
    "40 ms": ImperfectBase(lag_s=0.04),
    "sticks for 0.3 s": ImperfectBase(stiction_s=0.3),
    "sticks for 0.6 s with a lag": ImperfectBase(stiction_s=0.6, lag_s=0.3),
    "reports ten times a second": ImperfectBase(report_every=5),
    "reports rarely, lags": ImperfectBase(report_every=5, lag_s=0.3, dead_time_s=0.1),
    "tells half of it": ImperfectBase(gain=0.5),
    "tells a third more": ImperfectBase(gain=1.3),
}


@pytest.mark.parametrize("base", NORMAL.values(), ids=NORMAL.keys())
def test_whatever_a_base_is_like_its_commands_are_as_they_were(
    base: ImperfectBase, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No response of it ever caps a command, so they are bit for bit those of a loop that does not look."""
    given: set[SpeedCap] = set()
    really = ResponseMonitor.step

    def noted(
        self: ResponseMonitor, commanded_mps: float, measured_mps: float, feedback_ns: int | None, now_ns: int
    ) -> SpeedCap:
        cap = really(self, commanded_mps, measured_mps, feedback_ns, now_ns)
        given.add(cap)
        return cap

    monkeypatch.setattr(ResponseMonitor, "step", noted)
    driven(base, 4.0)
    assert given == {SpeedCap()}
