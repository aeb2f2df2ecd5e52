from __future__ import annotations

import numpy as np
import pytest

from hal.types import FloatArray
from tests.support.point_motion import matrices, static_miss
from vision.motion.velocities import EndResiduals, normal_equations


def points(static_m: FloatArray, ray: FloatArray, lag_s: float) -> EndResiduals:
    """Points whose pixel covariance is the unit matrix (1 m^2) and whose depth is exact."""
    count = len(static_m)
    return EndResiduals(
        static_m=static_m,
        ray=ray,
        lag_s=np.full(count, lag_s),
        residual_m=static_miss(static_m, ray),
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
    information = matrices(equations).sum(axis=0)
    velocity = np.linalg.solve(information, equations[6:9].T.sum(axis=0))
    later_m = 4.0 * 45.0 / 60.0  # eqs. 6 and 8: Z' = Z L / L'
    assert velocity[2] == pytest.approx(later_m - 4.0)  # -1 m/s
    assert velocity[0] == pytest.approx(20.0 / 300.0 * later_m)  # 0.2 m/s; eqs. 7 and 9: X' = x' Z'
    assert velocity[1] == pytest.approx(0.0)


def test_normal_equations_of_one_point_by_hand() -> None:
    motion = points(np.array([[1.0, 0.0, 4.0]]), np.array([[0.5, 0.0]]), 2.0)
    np.testing.assert_allclose(motion.residual_m, [[1.0, 0.0]])
    equations = normal_equations(motion, np.array([3.0]))
    # Rows (2, 0, -1) and (0, 2, 0), weighted with 3.
    np.testing.assert_allclose(
        matrices(equations)[0], [[12.0, 0.0, -6.0], [0.0, 12.0, 0.0], [-6.0, 0.0, 3.0]]
    )
    np.testing.assert_allclose(equations[6:9].T[0], [6.0, 0.0, -3.0])
    np.testing.assert_allclose(equations[9:].T[0], [0.0, 0.0, 0.0])


def test_correlated_pixels_are_weighted_by_the_inverse_of_their_covariance() -> None:
    base = points(np.array([[0.0, 0.0, 2.0]]), np.array([[0.1, -0.2]]), 0.5)
    covariance = np.array([[2.0, 1.0], [1.0, 3.0]])
    motion = EndResiduals(
        base.static_m,
        base.ray,
        base.lag_s,
        base.residual_m,
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
    np.testing.assert_allclose(matrices(equations)[0], rows.T @ weight @ rows)
    np.testing.assert_allclose(equations[6:9].T[0], rows.T @ weight @ [0.2, -0.4])
    np.testing.assert_allclose(equations[9:].T[0], rows.T @ weight @ [0.4, 0.1])


def test_points_of_weight_0_do_not_count_even_if_they_are_nan() -> None:
    static, ray = np.tile([1.0, 0.0, 4.0], (2, 1)), np.tile([0.5, 0.0], (2, 1))
    motion = points(static, ray, 2.0)
    motion.residual_m[1] = motion.covariance[1] = np.nan
    table = normal_equations(motion, np.array([3.0, 0.0]))
    np.testing.assert_array_equal(table[:, 0], normal_equations(motion, np.full(2, 3.0))[:, 0])
    assert not table[:, 1].any()


def test_no_points_give_no_equations() -> None:
    nothing = points(np.empty((0, 3)), np.empty((0, 2)), 1.0)
    assert normal_equations(nothing, np.empty(0)).shape == (12, 0)
