"""Lag and drift of a chassis, learnt from a drive of known numbers."""

from __future__ import annotations

import numpy as np
import pytest

from controller.base.chassis_lag import ChassisLag

STEP_S = 0.02


def drive(lag: ChassisLag, lag_s: float, drift: float, noise_m: float = 0.0, seconds: float = 12.0) -> None:
    """Accelerate at 0.3 m/s2 to 1.5 m/s and go on; odometry is behind by the lag and short by the drift."""
    noise = np.random.default_rng(1)
    v = commanded = 0.0
    lag.update(0.0, 0.0, 0.0, 50.0)
    for _ in range(int(seconds / STEP_S)):
        a = 0.3 if v < 1.5 else 0.0
        commanded += (v + 0.5 * a * STEP_S) * STEP_S
        step = (v + 0.5 * a * STEP_S) * STEP_S
        v += a * STEP_S
        travelled = commanded * (1.0 - drift) - lag_s * max(v - lag_s * a, 0.0)
        lag.update(step, v, a, 50.0 - travelled + float(noise.normal()) * noise_m)


@pytest.mark.parametrize("lag_s", [0.0, 0.1, 0.25, 0.4])
@pytest.mark.parametrize("drift", [-0.03, 0.0, 0.02])
def test_learns_lag_and_drift(lag_s: float, drift: float) -> None:
    lag = ChassisLag(0.15)
    drive(lag, lag_s, drift, noise_m=0.003)
    assert lag.seconds == pytest.approx(lag_s, abs=0.02)
    # 1 m to go at 1.5 m/s: the lag's part has been commanded already, the drift's has to be added.
    expected = (1.0 - lag_s * 1.5) / (1.0 - drift)
    assert lag.to_command_m(1.0, 1.5, 0.0) == pytest.approx(expected, abs=0.04)


def test_before_driving_the_configured_lag_counts() -> None:
    lag = ChassisLag(0.2)
    assert lag.seconds == 0.2
    assert lag.to_command_m(1.0, 1.0, 0.0) == pytest.approx(0.8)
    assert lag.to_command_m(1.0, 1.0, 0.5) == pytest.approx(1.0 - 0.2 * 0.9)


def test_an_absurd_jump_of_the_odometry_is_not_learnt() -> None:
    lag = ChassisLag(0.1)
    drive(lag, 0.1, 0.0)
    before = lag.seconds
    lag.update(0.03, 1.5, 0.0, 12.0)
    assert lag.seconds == before
    lag.update(0.03, 1.5, 0.0, 11.97)
    lag.update(0.03, 1.5, 0.0, 11.94)
    assert lag.seconds == pytest.approx(before, abs=0.005)


def test_the_estimate_stays_within_reason() -> None:
    lag = ChassisLag(0.5)
    drive(lag, 0.9, 0.0)
    assert lag.seconds <= 0.6


def test_lag_learnt_while_the_chassis_did_not_follow_is_undone() -> None:
    """Of the last two seconds; what was learnt before stays."""
    lag = ChassisLag(0.2)
    drive(lag, 0.1, 0.0)
    learnt = lag.seconds, lag.to_command_m(1.0, 1.0, 0.0)
    to_go_m = 35.9
    for step in range(60):
        to_go_m -= 0.03 if step < 50 else 0.012
        lag.update(0.03, 1.5, 0.0, to_go_m)
    assert lag.to_command_m(1.0, 1.0, 0.0) != pytest.approx(learnt[1], abs=1e-3)
    lag.take_back()
    assert (lag.seconds, lag.to_command_m(1.0, 1.0, 0.0)) == pytest.approx(learnt, abs=2e-3)
    assert lag.seconds == pytest.approx(0.1, abs=0.02)


def test_taken_back_at_once_it_is_as_configured() -> None:
    lag = ChassisLag(0.2)
    lag.update(0.0, 0.0, 0.0, 50.0)
    lag.update(0.03, 0.3, 0.0, 49.98)
    assert lag.seconds != 0.2
    lag.take_back()
    assert lag.seconds == 0.2


def test_measured_anew_while_it_drives_it_stays_right() -> None:
    """At 1 m/s, 0.1 s behind: where the measurement begins the chassis is behind, and not ahead."""
    lag = ChassisLag(0.1)
    lag.update(0.0, 1.0, 0.0, 20.1)
    for step in range(1, 200):
        lag.update(0.02, 1.0, 0.0, 20.1 - 0.02 * step)
    assert lag.seconds == pytest.approx(0.1, abs=1e-6)
    assert lag.to_command_m(1.0, 1.0, 0.0) == pytest.approx(0.9, abs=1e-6)
