"""Commands leave at the same moment of every period, or at once when that moment has passed."""

from __future__ import annotations

import pytest

from controller.realtime.punctual import PunctualChassis
from hal.clocks import SimulatedClock
from hal.types import ChassisState, Setpoint
from tests.support.chassis_rig import agilex_rig

MS = 1_000_000


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
    assert seen == [(None, 1000.0), (0.1, began_ms)], "what is sent, and its time, are not changed"
