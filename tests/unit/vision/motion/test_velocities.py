from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hal.types import FloatArray
from tests.support.point_motion import static_miss
from vision.motion.velocities import (
    NormalEquations,
    PointMotion,
    chi2_2d,
    end_information,
    normal_equations,
    solve_velocity,
)


def points(static_m: FloatArray, ray: FloatArray, lag_s: float) -> PointMotion:
    """Points whose pixel covariance is the unit matrix (1 m^2) and whose depth is exact."""
    count = len(static_m)
    return PointMotion(
        static_m=static_m,
        ray=ray,
        lag_s=np.full(count, lag_s),
        miss_m=static_miss(static_m, ray),
        covariance=np.tile([1.0, 0.0, 1.0], (count, 1)),
        depth_effect=np.zeros((count, 2)),
        depth_step_m=np.full(count, np.nan),
        depth_step_sigma_m=np.ones(count),
        depth_lag_s=np.full(count, lag_s),
        static_chi2=np.zeros(count),
        usable=np.ones(count, np.bool_),
    )


def test_length_ratio_and_lateral_speed_follow_from_the_point_equations() -> None:
    """Two ends at one depth: the general equations give the numbers of the paper's eqs. 6 to 9."""
    static = np.array([[-0.3, 0.0, 4.0], [0.3, 0.0, 4.0]])
    # One second later, seen 60 px long instead of 45 (f = 300), and 20 px right of the centre.
    ray = np.array([[-30.0 + 20.0, 0.0], [30.0 + 20.0, 0.0]]) / 300.0
    equations = normal_equations(points(static, ray, 1.0), np.ones(2))
    information = equations.matrix.sum(axis=0)
    velocity = np.linalg.solve(information, equations.rhs.sum(axis=0))
    later_m = 4.0 * 45.0 / 60.0  # eqs. 6 and 8: Z' = Z L / L'
    assert velocity[2] == pytest.approx(later_m - 4.0)  # -1 m/s
    assert velocity[0] == pytest.approx(20.0 / 300.0 * later_m)  # 0.2 m/s; eqs. 7 and 9: X' = x' Z'
    assert velocity[1] == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("miss", "covariance", "effect", "expected"),
    [
        ((3.0, 4.0), (9.0, 0.0, 16.0), (0.0, 0.0), 2.0),
        # The inverse of [[2, 1], [1, 2]] is [[2, -1], [-1, 2]] / 3.
        ((1.0, 0.0), (2.0, 1.0, 2.0), (0.0, 0.0), 2.0 / 3.0),
        # Depth's effect (1, 0) doubles the variance along x.
        ((2.0, 1.0), (1.0, 0.0, 1.0), (1.0, 0.0), 3.0),
        # Effect (1, 1) on the unit matrix makes [[2, 1], [1, 2]] again.
        ((1.0, 0.0), (1.0, 0.0, 1.0), (1.0, 1.0), 2.0 / 3.0),
    ],
)
def test_chi2_by_numbers(
    miss: tuple[float, float],
    covariance: tuple[float, float, float],
    effect: tuple[float, float],
    expected: float,
) -> None:
    result = chi2_2d(np.array([miss]), np.array([covariance]), np.array([effect]))
    np.testing.assert_allclose(result, [expected])


def test_information_of_an_end_is_the_inverse_of_its_covariance() -> None:
    base = points(np.array([[0.0, 0.0, 2.0]]), np.array([[0.1, -0.2]]), 0.5)
    motion = replace(base, covariance=np.array([[1.0, 0.5, 1.0]]), depth_effect=np.array([[1.0, 0.5]]))
    # [[1, 0.5], [0.5, 1]] + [[1, 0.5], [0.5, 0.25]] = [[2, 1], [1, 1.25]], determinant 1.5.
    np.testing.assert_allclose(end_information(motion)[:, 0], np.array([1.25, -1.0, 2.0]) / 1.5)


def test_normal_equations_of_one_point_by_hand() -> None:
    motion = points(np.array([[1.0, 0.0, 4.0]]), np.array([[0.5, 0.0]]), 2.0)
    np.testing.assert_allclose(motion.miss_m, [[1.0, 0.0]])
    equations = normal_equations(motion, np.array([3.0]))
    # Rows (2, 0, -1) and (0, 2, 0), weighted with 3.
    np.testing.assert_allclose(equations.matrix[0], [[12.0, 0.0, -6.0], [0.0, 12.0, 0.0], [-6.0, 0.0, 3.0]])
    np.testing.assert_allclose(equations.rhs[0], [6.0, 0.0, -3.0])
    np.testing.assert_allclose(equations.doubt[0], [0.0, 0.0, 0.0])


def test_correlated_pixels_are_weighted_by_the_inverse_of_their_covariance() -> None:
    base = points(np.array([[0.0, 0.0, 2.0]]), np.array([[0.1, -0.2]]), 0.5)
    covariance = np.array([[2.0, 1.0], [1.0, 3.0]])
    motion = PointMotion(
        base.static_m,
        base.ray,
        base.lag_s,
        base.miss_m,
        np.array([[2.0, 1.0, 3.0]]),
        np.array([[0.4, 0.1]]),
        base.depth_step_m,
        base.depth_step_sigma_m,
        base.depth_lag_s,
        base.static_chi2,
        base.usable,
    )
    rows = 0.5 * np.array([[1.0, 0.0, -0.1], [0.0, 1.0, 0.2]])
    weight = np.linalg.inv(covariance)
    equations = normal_equations(motion, np.ones(1))
    np.testing.assert_allclose(equations.matrix[0], rows.T @ weight @ rows)
    np.testing.assert_allclose(equations.rhs[0], rows.T @ weight @ [0.2, -0.4])
    np.testing.assert_allclose(equations.doubt[0], rows.T @ weight @ [0.4, 0.1])


def sums(matrix: FloatArray, rhs: list[float], doubt: list[float]) -> NormalEquations:
    """One column of normal equations."""
    upper = matrix[np.triu_indices(3)]
    return NormalEquations(np.concatenate((upper, rhs, doubt))[:, None])


def test_what_nothing_measures_is_bounded_not_zero() -> None:
    nothing = sums(np.zeros((3, 3)), [0.0] * 3, [0.0] * 3)
    velocity, covariance = solve_velocity(nothing, 1.5)
    np.testing.assert_allclose(velocity[0], 0.0)
    np.testing.assert_allclose(covariance[0], 2.25 * np.eye(3))


def test_solution_and_its_covariance_by_hand() -> None:
    equations = sums(3.0 * np.eye(3), [3.0, 0.0, -6.0], [4.0, 0.0, 0.0])
    velocity, covariance = solve_velocity(equations, 1.0)
    # Information 3 + 1; one sigma of depth shifts the solution by (1, 0, 0).
    np.testing.assert_allclose(velocity[0], [0.75, 0.0, -1.5])
    np.testing.assert_allclose(covariance[0], np.diag([1.25, 0.25, 0.25]))


def test_depth_adds_to_what_is_known_along_z() -> None:
    equations = sums(np.eye(3), [0.0, 0.0, 1.0], [0.0] * 3)
    equations.add_depth(np.array([2.0]), np.array([3.0]))
    velocity, covariance = solve_velocity(equations, 1.0)
    # Information 1 + 2 + 1, right side 1 + 3.
    np.testing.assert_allclose(velocity[0], [0.0, 0.0, 1.0])
    np.testing.assert_allclose(covariance[0], np.diag([0.5, 0.5, 0.25]))


def test_stacks_of_bodies_are_solved_at_once_and_as_a_general_solver_does() -> None:
    rng = np.random.default_rng(3)
    roots = rng.normal(size=(7, 3, 3)) * [1.0, 30.0, 900.0]
    matrices = roots @ roots.transpose(0, 2, 1)
    rhs, doubt = rng.normal(size=(2, 7, 3))
    columns = [sums(*given).table for given in zip(matrices, rhs.tolist(), doubt.tolist(), strict=True)]
    stacked = NormalEquations(np.concatenate(columns, axis=1))
    np.testing.assert_allclose(stacked.matrix, matrices)
    velocity, covariance = solve_velocity(stacked, 2.0)
    inverse = np.linalg.inv(matrices + 0.25 * np.eye(3))
    common = (inverse @ doubt[:, :, None])[:, :, 0]
    np.testing.assert_allclose(velocity, (inverse @ rhs[:, :, None])[:, :, 0], rtol=1e-7)
    np.testing.assert_allclose(covariance, inverse + common[:, :, None] * common[:, None, :], rtol=1e-7)
