"""Fragments' own velocities: what their two ends say, in the image and in depth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hal.types import FloatArray
from tests.support.point_motion import static_miss
from vision.motion import least_squares
from vision.motion.least_squares import BodyVelocities, body_velocities, fragment_velocities
from vision.motion.velocities import EndResiduals

NAN = float("nan")


def two_ends(depth_step_m: tuple[float, float], usable: tuple[bool, bool]) -> EndResiduals:
    """Of one fragment at 4 m that went 0.2 m to the right in 0.5 s, known to a millimetre."""
    static = np.array([[0.0, -0.4, 4.0], [0.0, 0.4, 4.0]])
    ray = (static[:, :2] + np.array([0.2, 0.0])) / 4.0
    return EndResiduals(
        static_m=static,
        ray=ray,
        lag_s=np.full(2, 0.5),
        residual_m=static_miss(static, ray),
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
    other = replace(both, residual_m=both.residual_m + np.array([[0.0, 0.0], [5.0, -3.0]]))
    found, same = fragment_velocities(both, 1.5), fragment_velocities(other, 1.5)
    assert not found.per_end[:, 1].any()
    np.testing.assert_array_equal(found.velocity_mps, same.velocity_mps)
    unknown = fragment_velocities(two_ends((0.1, 0.1), (False, False)), 1.5)
    # Bounded by the greatest speed, never zero.
    np.testing.assert_allclose(unknown.covariance[0], 1.5**2 * np.eye(3))


def swinging(speeds_mps: list[float]) -> BodyVelocities:
    """One body at 4 m whose ends each go sideways at a speed of their own, known to 2 mm in 0.25 s."""
    count = len(speeds_mps)
    static = np.stack((np.zeros(count), np.linspace(-0.4, 0.4, count), np.full(count, 4.0)), axis=1)
    went = np.array(speeds_mps)[:, None] * [0.25, 0.0]
    ray = (static[:, :2] + went) / 4.0
    motion = EndResiduals(
        static_m=static,
        ray=ray,
        lag_s=np.full(count, 0.25),
        residual_m=static_miss(static, ray),
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
    assert found.contradicts_static[0] == 1.0


def test_an_outlier_does_not_widen_a_rigid_body() -> None:
    found = swinging([1.0] * 9 + [-2.0])
    assert found.velocity_mps[0, 0] == pytest.approx(1.0, abs=0.03)
    assert np.sqrt(found.covariance[0, 0, 0]) < 0.02
    assert found.agreement[0] == pytest.approx(0.9)


def test_standing_body_does_not_contradict_standing() -> None:
    assert swinging([0.0] * 8).contradicts_static[0] == 0.0


def nothing_seen(count: int) -> EndResiduals:
    """Ends whose miss is hardly known: whatever is said of them, none is an outlier."""
    static = np.tile([0.0, 0.0, 4.0], (count, 1))
    return EndResiduals(
        static_m=static,
        ray=np.zeros((count, 2)),
        lag_s=np.full(count, 0.5),
        residual_m=np.zeros((count, 2)),
        covariance=np.tile([1e20, 0.0, 1e20], (count, 1)),
        depth_effect=np.zeros((count, 2)),
        depth_step_m=np.full(count, NAN),
        depth_step_sigma_m=np.ones(count),
        depth_lag_s=np.full(count, 0.5),
        static_chi2=np.zeros(count),
        usable=np.ones(count, np.bool_),
    )


def solved(
    matrix: FloatArray, rhs: FloatArray, doubt: FloatArray, depth: FloatArray, max_speed_mps: float = 1.0
) -> BodyVelocities:
    """Of G bodies with one end each: equations (G, 3, 3), (G, 3), (G, 3); and what depth says (G, 2)."""
    count = len(matrix)
    rows, columns = np.triu_indices(3)
    per_end = np.concatenate((matrix[:, rows, columns].T, rhs.T, doubt.T, depth.T))
    start = np.zeros((count, 3))
    return body_velocities(nothing_seen(count), per_end, np.arange(count), count, start, max_speed_mps)


def test_unmeasured_velocity_has_a_bounded_covariance() -> None:
    nothing = np.zeros((1, 3))
    found = solved(np.zeros((1, 3, 3)), nothing, nothing, np.zeros((1, 2)))
    np.testing.assert_array_equal(found.velocity_mps[0], 0.0)
    np.testing.assert_allclose(found.covariance[0], np.eye(3))


def test_solution_and_its_covariance_by_hand() -> None:
    rhs, doubt = np.array([[3.0, 0.0, -6.0]]), np.array([[4.0, 0.0, 0.0]])
    found = solved(3.0 * np.eye(3)[None], rhs, doubt, np.zeros((1, 2)))
    # Information 3 + 1; one sigma of depth shifts the solution by (1, 0, 0).
    np.testing.assert_allclose(found.velocity_mps[0], [0.75, 0.0, -1.5])
    np.testing.assert_allclose(found.covariance[0], np.diag([1.25, 0.25, 0.25]))


def test_depth_adds_to_what_is_known_along_z() -> None:
    found = solved(np.eye(3)[None], np.array([[0.0, 0.0, 1.0]]), np.zeros((1, 3)), np.array([[2.0, 3.0]]))
    # Information 1 + 2 + 1, right side 1 + 3.
    np.testing.assert_allclose(found.velocity_mps[0], [0.0, 0.0, 1.0])
    np.testing.assert_allclose(found.covariance[0], np.diag([0.5, 0.5, 0.25]))


def test_bodies_are_solved_as_a_general_solver_does() -> None:
    rng = np.random.default_rng(3)
    roots = rng.normal(size=(7, 3, 3)) * [1.0, 30.0, 900.0]
    matrices = roots @ roots.transpose(0, 2, 1)
    rhs, doubt = rng.normal(size=(2, 7, 3))
    found = solved(matrices, rhs, doubt, np.zeros((7, 2)), 2.0)
    inverse = np.linalg.inv(matrices + 0.25 * np.eye(3))
    common = (inverse @ doubt[:, :, None])[:, :, 0]
    np.testing.assert_allclose(found.velocity_mps, (inverse @ rhs[:, :, None])[:, :, 0], rtol=1e-7)
    expected = inverse + common[:, :, None] * common[:, None, :]
    np.testing.assert_allclose(found.covariance, expected, rtol=1e-7)


def test_information_of_an_end_is_the_inverse_of_its_covariance() -> None:
    # [[1, 0.5], [0.5, 1]] + [[1, 0.5], [0.5, 0.25]] = [[2, 1], [1, 1.25]], determinant 1.5.
    result = np.empty(3)
    least_squares.end_information(np.array([1.0, 0.5, 1.0]), np.array([1.0, 0.5]), result)
    np.testing.assert_allclose(result, np.array([1.25, -1.0, 2.0]) / 1.5)


def test_ends_go_to_their_own_body_and_some_to_none() -> None:
    """Of three bodies the middle one has no end; one end is nobody's, one not usable, and says no number."""
    motion = nothing_seen(6)
    motion.usable[4], motion.residual_m[4], motion.static_chi2[4] = False, NAN, NAN
    motion.static_chi2[[0, 5]] = 13.9
    per_end = np.zeros((14, 6))
    per_end[[0, 3, 5]] = 1.0
    per_end[6] = [1.0, 2.0, 100.0, 3.0, NAN, 6.0]
    owner = np.array([2, 0, -1, 0, 0, 2])
    found = body_velocities(motion, per_end, owner, 3, np.zeros((3, 3)), 1.0)
    np.testing.assert_array_equal(found.ends, [2, 0, 2])
    np.testing.assert_allclose(found.velocity_mps[:, 0], [5.0 / 3.0, 0.0, 7.0 / 3.0])
    np.testing.assert_array_equal(found.agreement, [1.0, 0.0, 1.0])
    np.testing.assert_array_equal(found.contradicts_static, [0.0, 0.0, 1.0])
    np.testing.assert_allclose(found.covariance[1], np.eye(3))


def test_many_ends_have_no_more_looks_at_depth_than_ten() -> None:
    """20 ends of information 1 each count as 10, beside the bound of 1."""
    per_end = np.zeros((14, 20))
    per_end[12], per_end[13] = 1.0, 0.5
    found = body_velocities(nothing_seen(20), per_end, np.zeros(20, np.intp), 1, np.zeros((1, 3)), 1.0)
    assert found.velocity_mps[0, 2] == pytest.approx(5.0 / 11.0)
    assert found.covariance[0, 2, 2] == pytest.approx(1.0 / 11.0)


@pytest.mark.parametrize("count", [1, 2, 3, 6, 7, 40, 41])
def test_the_middle_is_where_sorting_has_it(count: int) -> None:
    """Also of equal values, and of values in order."""
    rng = np.random.default_rng(count)
    plain = rng.normal(size=count)
    for values in (plain, np.sort(plain), -np.sort(plain), np.round(plain), np.zeros(count)):
        assert least_squares._upper_median(values) == np.sort(values)[count // 2]


def test_without_ends_or_bodies_there_is_nothing() -> None:
    motion = nothing_seen(0)
    assert fragment_velocities(motion, 1.5).covariance.shape == (0, 3, 3)
    per_end, owner = np.empty((14, 0)), np.empty(0, np.intp)
    assert len(body_velocities(motion, per_end, owner, 0, np.empty((0, 3)), 1.5).ends) == 0
    alone = body_velocities(motion, per_end, owner, 1, np.zeros((1, 3)), 1.5)
    np.testing.assert_allclose(alone.covariance[0], 2.25 * np.eye(3))
