from __future__ import annotations

import math
from dataclasses import replace

import pytest

from hal.chassis.command import CommandLimits, due, fit_tracks, is_zero, zero
from hal.chassis.tracks import TrackGeometry
from hal.types import Setpoint

MS = 1_000_000
LIMITS = CommandLimits(max_speed_mps=3.0, max_yaw_rate_radps=2.5, timeout_ns=200 * MS)


def setpoint(v_mps: float, w_radps: float = 0.0, stamp_ns: int = 0) -> Setpoint:
    return Setpoint(stamp_ns, v_mps, 0.1, w_radps)


def test_zero_is_exactly_zero() -> None:
    assert is_zero(None)
    assert is_zero(zero(5))
    assert is_zero(setpoint(-0.0))
    assert not is_zero(setpoint(1e-9))
    assert not is_zero(setpoint(0.0, 1e-9))
    assert not is_zero(setpoint(math.nan))


@pytest.mark.parametrize(
    "bad", [setpoint(math.nan), setpoint(0.0, math.nan), setpoint(math.inf), setpoint(0, -math.inf)]
)
def test_a_command_that_is_not_finite_stops(bad: Setpoint) -> None:
    assert "not finite" in LIMITS.setpoint_error(bad, 0)


def test_a_command_older_than_the_limit_stops() -> None:
    moving = setpoint(0.5)
    assert LIMITS.setpoint_error(moving, 200 * MS) == ""
    assert LIMITS.setpoint_error(moving, 240 * MS) == "the command is 240 ms old"
    assert LIMITS.setpoint_error(setpoint(0.5, stamp_ns=100 * MS), 300 * MS) == ""
    assert LIMITS.setpoint_error(setpoint(0.0), 10_000 * MS) == "", "an old zero is still a zero"
    assert LIMITS.setpoint_error(None, 0) == ""


def test_a_fast_command_is_slowed_on_the_same_curve() -> None:
    fitted = LIMITS.fit(setpoint(6.0, 1.0, stamp_ns=7), 9)
    assert (fitted.v_mps, fitted.w_radps) == pytest.approx((3.0, 0.5))
    assert fitted.stamp_ns == 7


def test_too_fast_a_turn_in_place_is_slowed() -> None:
    fitted = LIMITS.fit(setpoint(0.0, -4.0), 0)
    assert (fitted.v_mps, fitted.w_radps) == (0.0, -2.5)


def test_command_is_due_at_first_and_again_after_a_period() -> None:
    assert due(None, 20 * MS, 0)
    assert not due(1000 * MS, 20 * MS, 1000 * MS)
    assert not due(1000 * MS, 20 * MS, 1010 * MS)
    assert not due(1000 * MS, 20 * MS, 1015 * MS - 1)
    assert due(1000 * MS, 20 * MS, 1015 * MS), "early by a quarter of the period"
    assert due(1000 * MS, 20 * MS, 1020 * MS)
    assert due(1000 * MS, 20 * MS, 999 * MS), "a clock that went back keeps nothing waiting"


def test_a_command_within_limits_is_left_alone() -> None:
    slow = setpoint(1.2345, -0.3)
    assert LIMITS.fit(slow, 0) is slow


def test_no_command_is_an_explicit_zero() -> None:
    assert LIMITS.fit(None, 9) == Setpoint(9, 0.0, 0.0, 0.0)


def test_a_bend_is_slowed_until_its_outer_track_can_keep_up() -> None:
    """Tracks 0.5 m apart, 2 rad/s: the outer one is 0.5 m/s faster than the middle."""
    geometry = TrackGeometry(0.4, slip_factor=1.25)
    asked = setpoint(0.75, 2.0)
    assert fit_tracks(asked, geometry, 1.25) == (asked, 0.25, 1.25)
    fitted, left_mps, right_mps = fit_tracks(asked, geometry, 0.625)
    assert (left_mps, right_mps) == (0.125, 0.625)
    assert fitted == replace(asked, v_mps=0.375, w_radps=1.0)
