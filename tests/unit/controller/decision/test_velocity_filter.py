"""Velocities averaged as their spread demands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from controller.decision.bodies import Bodies
from controller.decision.velocity_filter import VelocityFilter
from tests.support.floor_bodies import box

FRAME_NS = 33_333_333


def seen(
    frame: int, vx_mps: float, vy_mps: float, sigma_mps: float, number: int = 1, stood_s: float = 0.0
) -> Bodies:
    """Tracked since frame 0, and for stood_s before."""
    age_s = stood_s + frame * FRAME_NS / 1e9
    body = box(5.0, 0.0, vx_mps, vy_mps, number=number, sigma_mps=sigma_mps, age_s=age_s)
    return replace(body, captured_ns=frame * FRAME_NS)


def test_a_first_sight_is_taken_as_it_is() -> None:
    found = VelocityFilter().update(seen(1, -1.0, 0.2, 0.5))
    assert found.velocity_mps.tolist() == [[-1.0, 0.2]]
    assert found.innovation_mps.tolist() == [[0.0, 0.0]]


def test_noise_far_away_is_averaged_out() -> None:
    random = np.random.default_rng(1)
    velocities, found = VelocityFilter(), []
    for frame in range(1, 300):
        measured = -1.0 + 0.3 * float(random.standard_normal())
        found.append(float(velocities.update(seen(frame, measured, 0.5, 0.3)).velocity_mps[0, 0]))
    assert np.std(found[50:]) < 0.15
    assert np.mean(found[50:]) == pytest.approx(-1.0, abs=0.05)


def test_well_measured_velocity_is_followed_at_once() -> None:
    velocities = VelocityFilter()
    for frame in range(1, 20):
        velocities.update(seen(frame, -1.0, 0.0, 0.03))
    for frame in range(20, 24):
        found = velocities.update(seen(frame, -1.0, 0.5, 0.03))
    assert found.velocity_mps[0, 1] > 0.35
    # What is not followed yet is told, but for what any measurement differs by; and that it goes on.
    left_mps = 0.5 - found.velocity_mps[0, 1]
    assert left_mps > 0.03
    assert found.innovation_mps[0, 1] == pytest.approx(2.0 * (left_mps - 0.5 * 0.03))


def test_accelerating_body_is_expected_to_get_faster() -> None:
    """It sets off at 1.3 m/s^2, measured 0.15 s late: faster than measured, though not faster than it is."""
    velocities = VelocityFilter()
    for frame in range(1, 21):
        late_mps = max(frame / 30.0 - 0.15, 0.0) * 1.3
        found = velocities.update(seen(frame, 0.0, late_mps, 0.1))
    now_mps = 20 / 30.0 * 1.3
    assert found.velocity_mps[0, 1] < 0.8 * now_mps
    assert late_mps + 0.05 < found.velocity_mps[0, 1] + found.innovation_mps[0, 1] < now_mps


def test_noise_is_no_surprise() -> None:
    velocities = VelocityFilter()
    for frame in range(1, 60):
        velocities.update(seen(frame, -1.0, 0.0, 0.1))
    assert velocities.update(seen(60, -1.0, 0.04, 0.1)).innovation_mps[0, 1] == 0.0
    assert velocities.update(seen(61, -1.0, -0.5, 0.1)).innovation_mps[0, 1] < -0.3


def test_velocity_average_of_a_body_that_stood_starts_anew() -> None:
    velocities = VelocityFilter()
    velocities.update(seen(1, -1.0, 0.0, 0.3))
    velocities.update(seen(2, 0.0, 0.0, 0.3))
    assert velocities.update(seen(3, 0.8, 0.0, 0.3)).velocity_mps[0, 0] == pytest.approx(0.8)


def test_body_that_stood_and_sets_off_may_reach_a_walking_speed() -> None:
    """1.2 m/s, along the way on which it sets off, for a second."""
    velocities = VelocityFilter()
    for frame in range(1, 31):
        found = velocities.update(seen(frame, -0.3, 0.4, 0.05, stood_s=1.0))
        assert (found.velocity_mps + found.innovation_mps)[0] == pytest.approx([-0.72, 0.96])
    assert velocities.update(seen(31, -0.3, 0.4, 0.05, stood_s=1.0)).innovation_mps[0] == pytest.approx(
        [0.0, 0.0]
    )


def test_body_that_sets_off_at_walking_speed_gets_no_faster() -> None:
    assert not VelocityFilter().update(seen(1, -1.0, 0.8, 0.05, stood_s=1.0)).innovation_mps.any()


def test_body_that_was_never_seen_to_stand_does_not_set_off() -> None:
    assert not VelocityFilter().update(seen(9, -0.3, 0.4, 0.05)).innovation_mps.any()
    velocities = VelocityFilter()
    for frame in range(1, 20):
        assert not velocities.update(seen(frame, -0.3, 0.4, 0.05)).innovation_mps.any()


def test_others_are_not_mixed_up() -> None:
    velocities = VelocityFilter()
    velocities.update(seen(1, -1.0, 0.0, 0.3, number=1))
    assert velocities.update(seen(2, 1.0, 0.0, 0.3, number=2)).velocity_mps[0, 0] == 1.0
