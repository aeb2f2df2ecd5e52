"""The governor under any sequence of requests: not faster than asked, not off the arc, within every limit."""

from __future__ import annotations

import itertools
import math
from contextlib import suppress

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from config.robot import Robot
from controller.governor.request import MessageError, Twist, parse_request
from tests.support.closed_loop import PERIOD_S, Box, standing_at
from tests.support.governed_drive import GovernedDrive, Step

LIMITS = Robot().limits
NUMBERS = st.floats(-2.0, 2.0) | st.sampled_from([0.0, math.nan, math.inf, 1e300, 5e-324])
TWISTS = st.builds(Twist, NUMBERS, NUMBERS)
DRIVEN = st.builds(Twist, st.floats(0.05, 1.4), st.floats(-0.5, 0.5))
# What is asked for, and for how many control steps.
SEQUENCES = st.lists(st.tuples(st.none() | TWISTS | DRIVEN, st.integers(1, 60)), min_size=1, max_size=8)


def drive(sequence: list[tuple[Twist | None, int]], boxes: list[Box] | None = None) -> list[Step]:
    asked = [twist for twist, count in sequence for _ in range(count)]
    run = GovernedDrive(lambda t: asked[min(round(t / PERIOD_S), len(asked) - 1)], boxes)
    return run.run(len(asked) * PERIOD_S - 1e-6)


# A tight arc while it still gets faster, at the speed at which it turns as fast as it may.
STILL_FASTER: list[tuple[Twist | None, int]] = [
    (None, 3),
    (Twist(1.0, 0.0), 74),
    (None, 5),
    (Twist(0.25, 0.5), 1),
]


@settings(max_examples=8, deadline=None)
@given(SEQUENCES)
@example(STILL_FASTER)
def test_limits_are_kept_whatever_is_asked(sequence: list[tuple[Twist | None, int]]) -> None:
    steps = drive(sequence, [Box(standing_at(3.5, 0.2))])
    v = np.array([0.0] + [one.governed.v_mps for one in steps])
    a = np.array([0.0] + [one.governed.a_mps2 for one in steps])
    w = np.array([one.governed.w_radps for one in steps])
    assert np.isfinite(v).all()
    assert np.isfinite(w).all()
    assert (v >= 0.0).all()
    assert (v <= LIMITS.max_speed_mps + 1e-9).all()
    assert (np.abs(w) <= LIMITS.max_yaw_rate_radps + 1e-9).all()
    assert (a <= LIMITS.max_accel_mps2 + 1e-6).all()
    assert (a >= -LIMITS.emergency_decel_mps2 - 1e-6).all()
    assert np.abs(np.diff(v)).max() <= LIMITS.emergency_decel_mps2 * PERIOD_S + 1e-9
    assert np.abs(np.diff(a)).max() <= LIMITS.emergency_jerk_mps3 * PERIOD_S + 1e-6
    assert min(one.clearance_m for one in steps) > 0.0


@settings(max_examples=6, deadline=None)
@given(DRIVEN, st.integers(100, 250))
@example(Twist(1.0, 1e-5), 100)
def test_the_arc_is_kept_and_no_step_is_faster_than_asked(twist: Twist, count: int) -> None:
    for one in drive([(twist, count)], [Box(standing_at(3.0, 0.0))]):
        governed = one.governed
        assert governed.v_mps <= twist.v_mps + 1e-9
        assert abs(governed.w_radps) <= abs(twist.w_radps) + 1e-9
        # The same factor for both.
        assert math.isclose(governed.w_radps * twist.v_mps, governed.v_mps * twist.w_radps, abs_tol=1e-9)


@settings(max_examples=6, deadline=None)
@given(SEQUENCES, DRIVEN)
def test_a_slower_wish_is_never_answered_by_going_faster(
    sequence: list[tuple[Twist | None, int]], slower: Twist
) -> None:
    steps = drive([*sequence, (slower, 60)])[-60:]
    limit = max(slower.v_mps, steps[0].governed.v_mps + steps[0].governed.a_mps2 ** 2 / (2.0 * 0.6))
    assert max(one.governed.v_mps for one in steps) <= limit + 1e-6


@settings(max_examples=5, deadline=None)
@given(SEQUENCES)
def test_silence_always_ends_at_rest(sequence: list[tuple[Twist | None, int]]) -> None:
    steps = drive([*sequence, (None, 330)])
    last = steps[-1].governed
    assert (last.v_mps, last.a_mps2, last.w_radps) == (0.0, 0.0, 0.0)
    silent = [abs(one.governed.w_radps) for one in steps[-330:]]
    # On the arc that it was on: the yaw rate only falls once the speed does.
    assert all(b <= a + 1e-9 for a, b in itertools.pairwise(silent[60:]))


@settings(max_examples=200)
@given(st.binary(max_size=600) | st.text(max_size=100).map(str.encode))
def test_any_bytes_are_a_request_or_one_error(data: bytes) -> None:
    with suppress(MessageError):
        request = parse_request(data)
        assert math.isfinite(request.twist.v_mps + request.twist.w_radps + request.t_s)
