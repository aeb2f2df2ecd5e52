"""Commands leave at the same moment of every period, or at once when that moment has passed."""

from __future__ import annotations

from itertools import pairwise

import pytest

from config.robot import Limits
from controller.base.guard import GuardedChassis, GuardLimits
from controller.realtime.punctual import PunctualChassis
from hal.clocks import SimulatedClock
from hal.types import ChassisMode, ChassisState, Setpoint
from tests.support.chassis_rig import agilex_rig
from tests.support.obedient_chassis import ObedientChassis

MS = 1_000_000
PERIOD_NS = 20 * MS


class TimedClock(SimulatedClock):
    """Notes until when somebody slept."""

    def __init__(self) -> None:
        super().__init__()
        self.slept_until_ms: list[float] = []

    def sleep_until_ns(self, deadline_ns: int) -> None:
        self.slept_until_ms.append(deadline_ns / MS)
        super().sleep_until_ns(deadline_ns)


@pytest.mark.parametrize(
    ("began_ms", "decided_ms", "leaves_ms"),
    [
        (1040.0, 1041.0, 1044.0),
        (1043.5, 1043.9, 1044.0),
        (1040.0, 1049.0, 1049.0),
        (1049.0, 1050.0, 1050.0),
        (1039.8, 1040.9, 1044.0),  # the first step itself was 0.2 ms late
    ],
)
def test_held_until_a_fifth_of_the_period(began_ms: float, decided_ms: float, leaves_ms: float) -> None:
    clock = TimedClock()
    left_at_ms: list[float] = []
    seen: list[tuple[float | None, float]] = []
    with agilex_rig("scripted") as rig:
        inner = rig.chassis

        class Noting:
            def exchange(self, setpoint: Setpoint | None, now_ns: int) -> ChassisState:
                left_at_ms.append(clock.now_ns() / MS)
                seen.append((None if setpoint is None else setpoint.v_mps, now_ns / MS))
                return inner.exchange(setpoint, now_ns)

            __enter__, __exit__ = inner.__enter__, inner.__exit__
            arm, stop = inner.arm, inner.stop

        punctual = PunctualChassis(Noting(), clock, 20 * MS)  # type: ignore[arg-type]  # a part of one
        clock.sleep_until_ns(1000 * MS)
        punctual.exchange(None, 1000 * MS)
        assert left_at_ms == [1004.0]
        clock.sleep_until_ns(round(decided_ms * MS))
        punctual.exchange(Setpoint(round(began_ms * MS), 0.1, 0.0, 0.0), round(began_ms * MS))
    assert left_at_ms[1] == leaves_ms
    assert seen == [(None, 1004.0), (0.1, leaves_ms)], "the time that it is, and what is sent is not changed"


def decide_slowly(takes_ms: float) -> list[ChassisState]:
    """A second of accelerating, then a step that takes so long before its setpoint is sent, and three more;
    the states of all of them."""
    clock, states = SimulatedClock(), list[ChassisState]()
    with agilex_rig("scripted") as rig:
        guarded = GuardedChassis(rig.chassis, GuardLimits.of(Limits(), 0.02, 0.1))
        punctual = PunctualChassis(guarded, clock, PERIOD_NS)
        began_ns, v, a = PERIOD_NS, 0.0, 0.0
        punctual.arm(began_ns)
        for step in range(64):
            clock.sleep_until_ns(began_ns)
            began_ns = clock.now_ns()
            rig.emulator.advance_to(began_ns)
            if states and states[-1].mode is ChassisMode.ARMED and step <= 60:
                a, v = min(a + 0.04, 0.25), v + 0.01 * (a + min(a + 0.04, 0.25))
            clock.sleep_until_ns(began_ns + round((takes_ms if step == 60 else 1.0) * MS))
            states.append(punctual.exchange(Setpoint(began_ns, v, a, 0.0), began_ns))
            late = max(clock.now_ns() - began_ns, PERIOD_NS) // PERIOD_NS
            began_ns += late * PERIOD_NS
    return states


def test_command_of_an_old_decision_is_not_sent() -> None:
    states = decide_slowly(400.0)
    assert states[59].mode is ChassisMode.ARMED
    assert states[59].v_mps > 0.1
    assert states[60].mode is ChassisMode.ESTOP
    assert states[60].reason.startswith("output guard: the command is 400 ms old")
    assert states[60].sent is None or states[60].sent.v_mps == 0.0


def test_a_step_of_four_periods_is_late_and_no_more() -> None:
    states = decide_slowly(80.0)
    assert {state.mode for state in states[10:]} == {ChassisMode.ARMED}


def test_the_state_says_when_it_holds() -> None:
    states = decide_slowly(80.0)
    apart_ms = [(after.stamp_ns - before.stamp_ns) / MS for before, after in pairwise(states)]
    assert apart_ms[58] == 20.0
    assert apart_ms[59] == 96.0, "from 4 ms after a step began to 80 ms after the next one did"


def test_arming_and_stopping_have_the_time_that_it_is() -> None:
    clock, chassis = SimulatedClock(), ObedientChassis()
    punctual = PunctualChassis(chassis, clock, PERIOD_NS)
    clock.sleep_until_ns(1007 * MS)
    punctual.arm(1000 * MS)
    clock.sleep_until_ns(1009 * MS)
    punctual.stop(1000 * MS)
    assert (chassis.armed_at_ns, chassis.stopped_at_ns) == ([1007 * MS], [1009 * MS])
