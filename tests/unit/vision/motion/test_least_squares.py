"""Fragments' own velocities: what their two ends say, in the image and in depth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.support.point_motion import static_miss
from vision.motion.least_squares import BodyVelocities, body_velocities, fragment_velocities, long_static
from vision.motion.velocities import PointMotion

NAN = float("nan")


def two_ends(depth_step_m: tuple[float, float], usable: tuple[bool, bool]) -> PointMotion:
    """Of one fragment at 4 m that went 0.2 m to the right in 0.5 s, known to a millimetre."""
    static = np.array([[0.0, -0.4, 4.0], [0.0, 0.4, 4.0]])
    ray = (static[:, :2] + np.array([0.2, 0.0])) / 4.0
    return PointMotion(
        static_m=static,
        ray=ray,
        lag_s=np.full(2, 0.5),
        miss_m=static_miss(static, ray),
        covariance=np.tile([1e-6, 0.0, 1e-6], (2, 1)),
        depth_effect=np.zeros((2, 2)),
        depth_step_m=np.array(depth_step_m),
        depth_step_sigma_m=np.full(2, 0.05),
        depth_lag_s=np.full(2, 0.5),
        static_chi2=np.full(2, 99.0),
        usable=np.array(usable),
    )


def test_two_ends_tell_the_velocity_of_their_fragment() -> None:
    found = fragment_velocities(two_ends((NAN, NAN), (True, True)), 1.5)
    np.testing.assert_allclose(found.velocity_mps[0], [0.4, 0.0, 0.0], atol=1e-3)
    assert found.per_end.shape == (14, 2)


def test_depth_says_how_fast_along_the_line_of_sight() -> None:
    """Information by hand: (0.5 s / 0.05 m)^2 = 100 and 0.5 / 0.05 * 0.1 / 0.05 = 20."""
    found = fragment_velocities(two_ends((0.1, NAN), (True, True)), 1.5)
    np.testing.assert_allclose(found.per_end[12:], [[100.0, 0.0], [20.0, 0.0]])


def test_an_end_that_is_not_usable_says_nothing() -> None:
    both = two_ends((0.1, NAN), (True, False))
    other = replace(both, miss_m=both.miss_m + np.array([[0.0, 0.0], [5.0, -3.0]]))
    found, same = fragment_velocities(both, 1.5), fragment_velocities(other, 1.5)
    assert not found.per_end[:, 1].any()
    np.testing.assert_array_equal(found.velocity_mps, same.velocity_mps)
    unknown = fragment_velocities(two_ends((0.1, 0.1), (False, False)), 1.5)
    # Bounded by the greatest speed, never zero.
    np.testing.assert_allclose(unknown.covariance[0], 1.5**2 * np.eye(3))


def test_long_static_are_those_whose_ends_have_both_lain_still_for_a_while() -> None:
    motion = two_ends((NAN, NAN), (True, True))
    old, young = np.array([0.27]), np.array([0.24])
    assert not long_static(motion, old)[0]
    still = replace(motion, static_chi2=np.array([6.0, 0.5]))
    assert long_static(still, old)[0]
    assert not long_static(still, young)[0]
    assert not long_static(replace(still, static_chi2=np.array([0.5, 6.1])), old)[0]
    assert not long_static(replace(still, usable=np.array([True, False])), old)[0]


def swinging(speeds_mps: list[float]) -> BodyVelocities:
    """One body at 4 m whose ends each go sideways at a speed of their own, known to 2 mm in 0.25 s."""
    count = len(speeds_mps)
    static = np.stack((np.zeros(count), np.linspace(-0.4, 0.4, count), np.full(count, 4.0)), axis=1)
    went = np.array(speeds_mps)[:, None] * [0.25, 0.0]
    ray = (static[:, :2] + went) / 4.0
    motion = PointMotion(
        static_m=static,
        ray=ray,
        lag_s=np.full(count, 0.25),
        miss_m=static_miss(static, ray),
        covariance=np.tile([4e-6, 0.0, 4e-6], (count, 1)),
        depth_effect=np.zeros((count, 2)),
        depth_step_m=np.full(count, NAN),
        depth_step_sigma_m=np.full(count, 0.05),
        depth_lag_s=np.full(count, 0.25),
        static_chi2=np.square(went[:, 0]) / 4e-6,
        usable=np.ones(count, np.bool_),
    )
    per_end = fragment_velocities(motion, 1.5).per_end
    return body_velocities(motion, per_end, np.zeros(count, np.intp), 1, np.zeros((1, 3)), 1.5)


def test_limbs_that_swing_about_their_body_widen_its_velocity() -> None:
    """Mean 1.0 m/s, standard deviation 0.44 over eight ends: 0.16. Each end is known to 0.008 m/s."""
    found = swinging([0.4, 1.6, 0.6, 1.4, 0.8, 1.2, 0.5, 1.5])
    assert found.velocity_mps[0, 0] == pytest.approx(1.0, abs=0.25)
    assert 0.08 < np.sqrt(found.covariance[0, 0, 0]) < 0.3
    assert found.agreement[0] < 0.2
    assert found.unexplained[0] == 1.0


def test_an_outlier_does_not_widen_a_rigid_body() -> None:
    found = swinging([1.0] * 9 + [-2.0])
    assert found.velocity_mps[0, 0] == pytest.approx(1.0, abs=0.03)
    assert np.sqrt(found.covariance[0, 0, 0]) < 0.02
    assert found.agreement[0] == pytest.approx(0.9)


def test_what_stands_is_explained() -> None:
    assert swinging([0.0] * 8).unexplained[0] == 0.0
