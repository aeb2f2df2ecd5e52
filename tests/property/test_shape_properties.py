"""Whatever is asked in whatever order: the speed keeps its limits, never reverses, can always end at rest."""

from __future__ import annotations

import math

from hypothesis import given, settings
from hypothesis import strategies as st

from config.robot import Limits
from controller import braking
from controller.shape import SpeedShaper

PERIOD_S = 0.02
TOLERANCE = 1e-6

limits_strategy = st.builds(
    lambda v, a, extra_a, j, extra_j: Limits(
        max_speed_mps=v,
        max_accel_mps2=a,
        emergency_decel_mps2=a + extra_a,
        max_jerk_mps3=j,
        emergency_jerk_mps3=j + extra_j,
    ),
    st.floats(0.2, 3.0),
    st.floats(0.1, 2.0),
    st.floats(0.0, 3.0),
    st.floats(0.2, 5.0),
    st.floats(0.0, 10.0),
)
wild = st.one_of(st.floats(-1.0, 4.0), st.sampled_from([math.nan, math.inf, -math.inf, 0.0]))
orders = st.lists(st.tuples(wild, st.booleans(), st.integers(1, 80)), min_size=1, max_size=12)
usual_or_any = st.one_of(st.just(Limits()), limits_strategy)


class Watched:
    """A shaper whose every step is checked against the limits."""

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self.shaper = SpeedShaper(limits, PERIOD_S)
        self.v = self.a = 0.0
        self.was_emergency = False
        self.travelled_m = 0.0

    def step(self, target: float, emergency: bool, to_end_m: float = math.inf) -> None:
        shaped = self.shaper.step(target, emergency=emergency, distance_to_end_m=to_end_m)
        assert shaped.fault == ""
        self.was_emergency |= emergency
        jerk = self.limits.emergency_jerk_mps3 if self.was_emergency else self.limits.max_jerk_mps3
        decel = self.limits.emergency_decel_mps2 if self.was_emergency else self.limits.max_accel_mps2
        assert 0.0 <= shaped.v_mps <= self.limits.max_speed_mps + TOLERANCE
        assert -decel - TOLERANCE <= shaped.a_mps2 <= self.limits.max_accel_mps2 + TOLERANCE
        assert abs(shaped.a_mps2 - self.a) <= jerk * PERIOD_S + TOLERANCE
        # The speed is the integral of the acceleration that was promised, to the third order.
        mean = 0.5 * (shaped.a_mps2 + self.a) * PERIOD_S
        assert abs(shaped.v_mps - self.v - mean) <= jerk * PERIOD_S**2 / 4.0 + TOLERANCE
        if shaped.a_mps2 < 0.0:  # able to end at rest, from here, without reversing
            assert shaped.v_mps >= shaped.a_mps2**2 / (2.0 * jerk) - TOLERANCE
        if shaped.a_mps2 > 0.0:  # able to keep the speed limit
            assert shaped.v_mps + shaped.a_mps2**2 / (2 * jerk) <= self.limits.max_speed_mps + TOLERANCE
        self.travelled_m += 0.5 * (self.v + shaped.v_mps) * PERIOD_S
        self.v, self.a = shaped.v_mps, shaped.a_mps2

    def come_to_rest(self, emergency: bool) -> None:
        """Asked to stop, it stands within the time of the stopping model."""
        brake = braking.emergency(self.limits) if emergency else braking.comfort(self.limits)
        steps = math.ceil(braking.stop(self.v, self.a, brake).time_s / PERIOD_S) + 2
        for _ in range(steps):
            self.step(0.0, emergency)
        assert (self.v, self.a) == (0.0, 0.0)


@settings(max_examples=60, deadline=None)
@given(usual_or_any, orders)
def test_limits_hold_for_any_sequence_of_targets(
    limits: Limits, sequence: list[tuple[float, bool, int]]
) -> None:
    watched = Watched(limits)
    for target, emergency, steps in sequence:
        for _ in range(steps):
            watched.step(target, emergency)
    watched.come_to_rest(emergency=watched.was_emergency)


@settings(max_examples=60, deadline=None)
@given(usual_or_any, st.floats(0.01, 30.0), orders)
def test_the_path_end_is_met_from_anything(
    limits: Limits, length_m: float, sequence: list[tuple[float, bool, int]]
) -> None:
    """However the target jumped before: it is never overrun, and the last request reaches it."""
    watched = Watched(limits)
    for target, emergency, steps in sequence:
        for _ in range(steps):
            watched.step(target, emergency, length_m - watched.travelled_m)
            assert watched.travelled_m <= length_m + 0.02
    worst_s = 4 * length_m / limits.max_speed_mps + 30 * (
        limits.max_speed_mps / limits.max_accel_mps2 + limits.max_accel_mps2 / limits.max_jerk_mps3
    )
    for _ in range(math.ceil(worst_s / PERIOD_S)):
        watched.step(limits.max_speed_mps, False, length_m - watched.travelled_m)
        if watched.v == 0.0 and abs(length_m - watched.travelled_m) < 0.01:
            break
    assert watched.v == 0.0
    assert abs(length_m - watched.travelled_m) <= 0.01


@settings(max_examples=40, deadline=None)
@given(st.floats(0.0, 1.5), st.integers(0, 200), st.integers(1, 100))
def test_a_stop_takes_what_the_model_says(target: float, warm_up: int, pause: int) -> None:
    """Distance of the shaped comfort stop = braking.stop of the state that it began in."""
    watched = Watched(Limits())
    for _ in range(warm_up):
        watched.step(target, False)
    for _ in range(pause):
        watched.step(1.5, False)
    model = braking.stop(watched.v, watched.a, braking.comfort(Limits()))
    began_m = watched.travelled_m
    watched.come_to_rest(emergency=False)
    assert abs(watched.travelled_m - began_m - model.distance_m) <= 1e-3
