"""The output guard never speaks against the shaper, and never lets pass what breaks a bound."""

from __future__ import annotations

import math

from hypothesis import given, settings
from hypothesis import strategies as st

from config.robot import Limits
from controller.base.guard import GuardLimits, objection
from controller.shape import SpeedShaper
from hal.types import Setpoint

PERIOD_NS = 20_000_000
ROBOT = Limits()
LIMITS = GuardLimits.of(ROBOT, 0.02, 0.1)

commands = st.tuples(
    st.one_of(st.sampled_from([0.0, 0.3, 1.5, 9.0, math.nan]), st.floats(0.0, 2.0)),
    st.booleans(),
    st.one_of(st.just(math.inf), st.floats(0.0, 6.0)),
    st.integers(1, 60),
)


@settings(max_examples=60, deadline=None)
@given(st.lists(commands, min_size=1, max_size=8))
def test_the_shaper_s_every_setpoint_passes(plan: list[tuple[float, bool, float, int]]) -> None:
    shaper = SpeedShaper(ROBOT, 0.02, 0.15)
    last = Setpoint(0, 0.0, 0.0, 0.0)
    now_ns = 0
    for target, emergency, to_end_m, steps in plan:
        for _ in range(steps):
            now_ns += PERIOD_NS
            shaped = shaper.step(target, emergency=emergency, distance_to_end_m=to_end_m)
            to_end_m = max(to_end_m - shaped.v_mps * 0.02, 0.0)
            setpoint = Setpoint(now_ns, shaped.v_mps, shaped.a_mps2, 0.0)
            assert objection(setpoint, last, LIMITS, now_ns) == ""
            last = setpoint


anything = st.floats(width=32)
near = st.floats(-1.0, 2.0)


@settings(max_examples=500)
@given(
    st.builds(Setpoint, st.integers(0, 10**9), near, near, near),
    st.builds(
        Setpoint, st.integers(0, 10**9), st.one_of(near, anything), st.one_of(near, anything), anything
    ),
    st.integers(0, 10**9),
)
def test_setpoint_that_passes_is_within_every_bound(last: Setpoint, setpoint: Setpoint, now_ns: int) -> None:
    if objection(setpoint, last, LIMITS, now_ns):
        return
    assert -1e-6 <= setpoint.v_mps <= 1.5 + 1e-6
    assert abs(setpoint.w_radps) <= 0.8 + 1e-6
    assert -0.7 - 1e-6 <= setpoint.a_mps2 <= 0.3 + 1e-6
    assert last.stamp_ns <= setpoint.stamp_ns <= now_ns
    assert now_ns - setpoint.stamp_ns <= 100_000_000
    dt_s = max((setpoint.stamp_ns - last.stamp_ns) / 1e9, 0.02)
    assert -0.7 - 1e-6 <= (setpoint.v_mps - last.v_mps) / dt_s <= 0.3 + 1e-6
