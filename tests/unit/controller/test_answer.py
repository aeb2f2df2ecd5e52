"""What is commanded of a base that does not do it: by the whole control loop, of bases of known numbers."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

import pytest

from config.robot import Robot
from controller.answer import Answer, BaseAnswer
from controller.control import ControlStep
from controller.ending import Outcome
from controller.record.tally import SetpointTally
from hal.geometry import advance_pose
from hal.types import ChassisMode, ChassisState, Setpoint
from tests.support.obedient_chassis import PERIOD_S
from tests.support.scenes import ORIGIN, chassis_state
from tests.unit.controller.test_control import drive, loop_on

LIMITS = Robot().limits


@dataclass
class Base:
    """A base with a lag and a dead time, that stops by itself 0.5 s after the last command that it heard.

    deaf_s: between these times, after the first command to move, it hears nothing. gain: what it makes of a
    command. report_every: in how many control periods it reports once. sticks_s: how long it stands when it
    is told to move. speeds: its true ones.
    """

    lag_s: float = 0.08
    dead_s: float = 0.0
    deaf_s: tuple[float, float] = (math.inf, math.inf)
    gain: float = 1.0
    report_every: int = 1
    sticks_s: float = 0.0
    speeds: list[float] = field(default_factory=list)
    sent: list[Setpoint] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._pose = ORIGIN
        self._v = self._target = 0.0
        self._heard_s = -math.inf
        self._moves_s: float | None = None
        self._on_its_way: deque[tuple[float, float]] = deque()
        self._reported: tuple[float, int] = (0.0, 0)

    def __enter__(self) -> Base:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def arm(self, now_ns: int) -> None:
        """Nothing to do."""

    def stop(self, now_ns: int) -> None:
        """Nothing to do."""

    def exchange(self, setpoint: Setpoint | None, now_ns: int) -> ChassisState:
        """Drive for a control period."""
        setpoint = setpoint or Setpoint(now_ns, 0.0, 0.0, 0.0)
        self.sent.append(setpoint)
        now_s = now_ns / 1e9
        if setpoint.v_mps > 0.0 and self._moves_s is None:
            self._moves_s = now_s
        self._hear(setpoint.v_mps, now_s)
        for _ in range(20):
            self._v += (self.gain * self._target - self._v) * -math.expm1(-PERIOD_S / 20 / self.lag_s)
            self._pose = advance_pose(self._pose, self._v, 0.0, PERIOD_S / 20)
        self.speeds.append(self._v)
        if len(self.sent) % self.report_every == 0:
            self._reported = self._v, now_ns
        mode = ChassisMode.ARMED if len(self.sent) > 3 else ChassisMode.ARMING
        state = chassis_state(now_ns, mode, self._reported[0], self._pose, "", setpoint)
        return ChassisState(
            state.stamp_ns, mode, "", self._reported[1], state.v_mps, 0.0, self._pose, 48.0, (), setpoint
        )

    def _hear(self, v_mps: float, now_s: float) -> None:
        moving_s = 0.0 if self._moves_s is None else now_s - self._moves_s
        self._on_its_way.append((now_s, v_mps))
        deaf = self.deaf_s[0] <= moving_s < self.deaf_s[1]
        while self._on_its_way and self._on_its_way[0][0] <= now_s - self.dead_s + 1e-9:
            _, told_mps = self._on_its_way.popleft()
            if not deaf:
                self._target, self._heard_s = told_mps, now_s
        if now_s - self._heard_s > 0.5 or moving_s < self.sticks_s:
            self._target = 0.0


def driven(base: Base, length_m: float = 6.0) -> tuple[list[ControlStep], Outcome | None]:
    """The steps of a whole drive, and its end."""
    loop = loop_on(base, length_m)
    return drive(loop, 2500), loop.ending.outcome


@pytest.mark.parametrize("deaf_for_s", [0.6, 0.8, 1.0])
@pytest.mark.parametrize("from_s", [2.0, 4.0])
def test_a_base_that_hears_again_begins_gently_and_ends_at_the_target(
    deaf_for_s: float, from_s: float
) -> None:
    base = Base(deaf_s=(from_s, from_s + deaf_for_s))
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
        tally.add(step.chassis.sent, step.chassis.mode, stands=step.unanswered != "")
    assert tally.violations == 0


def test_a_base_that_never_hears_is_not_asked_for_more_and_more() -> None:
    """hal/chassis/following.py latches it; the command waits at what may break it loose."""
    base = Base(deaf_s=(0.0, math.inf))
    taken = driven(base)[0][:400]
    assert max(step.setpoint.v_mps for step in taken) < 0.4
    assert taken[-1].setpoint.v_mps == pytest.approx(0.2, abs=0.01)


@pytest.mark.parametrize("gain", [2.0, 6.0])
def test_a_base_that_runs_away_is_not_told_to_go_faster(gain: float) -> None:
    base = Base(gain=gain)
    taken = driven(base)[0][:600]
    speeds = base.speeds
    first = next(k for k, step in enumerate(taken) if speeds[k] > 1.5 * step.setpoint.v_mps + 0.16)
    held_mps = [step.setpoint.v_mps for step in taken[first : first + 100]]
    assert max(held_mps) < held_mps[0] + 0.06, "a jerk of 2 m/s3 takes 0.15 s from 0.3 m/s2"
    told_mps = max(step.setpoint.v_mps for step in taken[: first + 100])
    assert min(speeds[first + 25 : first + 100]) > 1.5 * told_mps + 0.15, "following.py latches it as before"


NORMAL = {
    "quick": Base(lag_s=0.02),
    "a lag of 0.3 s": Base(lag_s=0.3),
    "a lag of 2 s": Base(lag_s=2.0),
    "a dead time of 0.3 s": Base(dead_s=0.3),
    "both": Base(lag_s=0.3, dead_s=0.2),
    "40 ms": Base(lag_s=0.04),
    "sticks for 0.3 s": Base(sticks_s=0.3),
    "sticks for 0.6 s with a lag": Base(sticks_s=0.6, lag_s=0.3),
    "reports ten times a second": Base(report_every=5),
    "reports rarely, lags": Base(report_every=5, lag_s=0.3, dead_s=0.1),
    "tells half of it": Base(gain=0.5),
    "tells a third more": Base(gain=1.3),
}


@pytest.mark.parametrize("base", NORMAL.values(), ids=NORMAL.keys())
def test_whatever_a_base_is_like_its_commands_are_as_they_were(
    base: Base, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No answer of it ever caps a command, so they are bit for bit those of a loop that does not look."""
    given: set[Answer] = set()
    really = BaseAnswer.step

    def noted(
        self: BaseAnswer, commanded_mps: float, measured_mps: float, feedback_ns: int | None, now_ns: int
    ) -> Answer:
        answer = really(self, commanded_mps, measured_mps, feedback_ns, now_ns)
        given.add(answer)
        return answer

    monkeypatch.setattr(BaseAnswer, "step", noted)
    driven(base, 4.0)
    assert given == {Answer()}
