from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hal.chassis.tracks import (
    DeadReckoning,
    TrackCounter,
    TrackGeometry,
    scale_to_fit,
    wrapped_difference,
)

speeds = st.floats(-5, 5)


def test_turning_left_drives_the_right_track_faster() -> None:
    left, right = TrackGeometry(width_m=0.5).to_tracks(v_mps=1.0, w_radps=0.4)
    assert (left, right) == pytest.approx((0.9, 1.1))


def test_slip_makes_the_tracks_work_harder_for_the_same_turn() -> None:
    left, right = TrackGeometry(width_m=0.5, slip_factor=1.2).to_tracks(v_mps=0.0, w_radps=1.0)
    assert (left, right) == pytest.approx((-0.3, 0.3))


@given(speeds, speeds, st.floats(0.1, 3), st.floats(1, 3))
def test_tracks_and_twist_are_inverse(v_mps: float, w_radps: float, width_m: float, slip: float) -> None:
    geometry = TrackGeometry(width_m, slip)
    assert geometry.to_twist(*geometry.to_tracks(v_mps, w_radps)) == pytest.approx((v_mps, w_radps), abs=1e-9)


def test_limits_keep_the_curve() -> None:
    assert scale_to_fit(1.0, 0.5, 2.0, 1.0) == (1.0, 0.5)
    assert scale_to_fit(4.0, 0.5, 2.0, 1.0) == pytest.approx((2.0, 0.25))
    assert scale_to_fit(-1.0, 4.0, 2.0, 1.0) == pytest.approx((-0.25, 1.0))
    assert scale_to_fit(4.0, 4.0, 2.0, 1.0) == pytest.approx((1.0, 1.0))


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
def test_limits_are_never_exceeded_and_signs_stay(v: float, w: float) -> None:
    fitted_v, fitted_w = scale_to_fit(v, w, 3.0, 2.5)
    assert abs(fitted_v) <= 3.0 * (1 + 1e-12)
    assert abs(fitted_w) <= 2.5 * (1 + 1e-12)
    assert fitted_v * v >= 0.0
    assert fitted_w * w >= 0.0


@pytest.mark.parametrize(
    ("newer", "older", "difference"),
    [
        (5, 3, 2),
        (3, 5, -2),
        (0, 0xFFFFFFFF, 1),
        (0xFFFFFFFF, 0, -1),
        (-(2**31), 2**31 - 1, 1),
        (2**31 - 1, -(2**31), -1),
    ],
)
def test_counter_difference_goes_the_shorter_way_round(newer: int, older: int, difference: int) -> None:
    assert wrapped_difference(newer, older) == difference


@given(st.integers(0, 2**32 - 1), st.integers(-(2**31), 2**31 - 1))
def test_counter_difference_across_any_wrap(start: int, step: int) -> None:
    assert wrapped_difference((start + step) % 2**32, start) == step


def test_sixteen_bit_counters_wrap_too() -> None:
    assert wrapped_difference(2, 65535, bits=16) == 3


def test_counter_starts_at_zero_wraps_and_restarts_after_a_jump() -> None:
    counter = TrackCounter()
    assert counter.increments(2**32 - 5, 10, limit=100) == (0, 0)
    assert counter.increments(5, 0, limit=100) == (10, -10)
    assert counter.increments(5000, 0, limit=100) is None, "no track is that fast"
    assert counter.increments(5001, 2, limit=100) == (1, 2)


def test_dead_reckoning_of_a_quarter_circle() -> None:
    """Radius 1 m to the left: from the origin to (1, 1), facing +y."""
    reckoning = DeadReckoning()
    for _ in range(100):
        reckoning.advance(math.pi / 200, math.pi / 200)
    pose = reckoning.pose
    assert (pose.x_m, pose.y_m, pose.heading_rad) == pytest.approx((1.0, 1.0, math.pi / 2))
