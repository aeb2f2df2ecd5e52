"""How fast things move over ground, from what static things would have done (eqs. 6 to 9 of Daeef 2020).

A point anchored at (x, y, z) some frames ago and static would now be at S = (X, Y, Z) in the camera
frame: the robot's own motion is in S. If it moved with velocity V over ground for a time T it is at
S + V T, and it is seen at (x', y') on the plane z = 1, so

    x' (Z + Vz T) = X + Vx T        y' (Z + Vz T) = Y + Vy T        z' = Z + Vz T

which is linear in V. For two ends of one segment at one depth the difference of the first two is the
paper's length ratio, Z + Vz T = Z L_static / L_now (eqs. 6, 8), and the first is its lateral speed,
X + Vx T = x' (Z + Vz T) (eqs. 7, 9), without a division by the image x, which is zero in the centre.
The third is the depth image itself, as good as its noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hal.types import FloatArray


def depth_after(depth_m: FloatArray, length_before: FloatArray, length_now: FloatArray) -> FloatArray:
    """Eqs. 6 and 8: Z_{t+1} = Z_t L_t / L_{t+1}, for lengths of one segment in two images."""
    return depth_m * length_before / length_now


def lateral_after(x_image: FloatArray, depth_m: FloatArray) -> FloatArray:
    """Eqs. 7 and 9 solved for the coordinate itself: X = x Z, with x on the image plane z = 1 m."""
    return x_image * depth_m


@dataclass(frozen=True, slots=True, eq=False)
class PointMotion:
    """Evidence of N tracked points, in the camera axes now. All NaN-free where usable.

    static_m (N, 3): where it would be if static. ray (N, 2): x', y' now. lag_s (N,): T.
    miss_m (N, 2): x' Z - X, y' Z - Y: zero for a static point. covariance (N, 3): xx, xy, yy of miss_m
    from pixels (m^2). depth_effect (N, 2): change of miss_m by one sigma of the anchor's depth.
    depth_step_m (N,): z' - Z, NaN where depth is missing. depth_step_sigma_m (N,).
    static_chi2 (N,): 2 degrees of freedom, the smaller one of the near and the far surface.
    usable (N,) bool.
    """

    static_m: FloatArray
    ray: FloatArray
    lag_s: FloatArray
    miss_m: FloatArray
    covariance: FloatArray
    depth_effect: FloatArray
    depth_step_m: FloatArray
    depth_step_sigma_m: FloatArray
    static_chi2: FloatArray
    usable: NDArray[np.bool_]


def static_miss(static_m: FloatArray, ray: FloatArray) -> FloatArray:
    """(N, 2) x' Z - X and y' Z - Y: how far, in metres at its depth, a point is from where it should be."""
    return ray * static_m[:, 2:3] - static_m[:, :2]


def chi2_2d(miss: FloatArray, covariance: FloatArray, effect: FloatArray) -> FloatArray:
    """(N,) squared Mahalanobis length of miss (N, 2) under covariance (N, 3) plus effect effect^T."""
    xx = covariance[:, 0] + effect[:, 0] ** 2
    xy = covariance[:, 1] + effect[:, 0] * effect[:, 1]
    yy = covariance[:, 2] + effect[:, 1] ** 2
    determinant = np.maximum(xx * yy - xy * xy, 1e-18)
    a, b = miss[:, 0], miss[:, 1]
    result: FloatArray = (yy * a * a - 2.0 * xy * a * b + xx * b * b) / determinant
    return result


@dataclass(frozen=True, slots=True, eq=False)
class NormalEquations:
    """Per point: matrix (N, 3, 3), rhs (N, 3) and doubt (N, 3) of the weighted least squares for V.

    doubt is the right side that one sigma of a depth error common to all points of a body would make.
    """

    matrix: FloatArray
    rhs: FloatArray
    doubt: FloatArray


def normal_equations(motion: PointMotion, weight: FloatArray) -> NormalEquations:
    """The two image equations of each point, weighted by their covariance and weight (N,)."""
    count = len(weight)
    lag = motion.lag_s
    xx, xy, yy = motion.covariance.T
    scale = weight / np.maximum(xx * yy - xy * xy, 1e-18)
    pxx, pxy, pyy = yy * scale, -xy * scale, xx * scale
    x, y = motion.ray[:, 0], motion.ray[:, 1]
    # Rows (1, 0, -x') T and (0, 1, -y') T with information [[pxx, pxy], [pxy, pyy]].
    qx, qy = pxx * x + pxy * y, pxy * x + pyy * y
    squared = lag * lag
    matrix = np.empty((count, 3, 3))
    matrix[:, 0, 0] = pxx * squared
    matrix[:, 1, 1] = pyy * squared
    matrix[:, 0, 1] = matrix[:, 1, 0] = pxy * squared
    matrix[:, 0, 2] = matrix[:, 2, 0] = -qx * squared
    matrix[:, 1, 2] = matrix[:, 2, 1] = -qy * squared
    matrix[:, 2, 2] = (qx * x + qy * y) * squared
    rhs = _right_side(motion.miss_m, pxx, pxy, pyy, qx, qy, lag)
    doubt = _right_side(motion.depth_effect, pxx, pxy, pyy, qx, qy, lag)
    return NormalEquations(matrix, rhs, doubt)


def _right_side(
    miss: FloatArray,
    pxx: FloatArray,
    pxy: FloatArray,
    pyy: FloatArray,
    qx: FloatArray,
    qy: FloatArray,
    lag: FloatArray,
) -> FloatArray:
    a, b = miss[:, 0], miss[:, 1]
    result = np.empty((len(a), 3))
    result[:, 0] = (pxx * a + pxy * b) * lag
    result[:, 1] = (pxy * a + pyy * b) * lag
    result[:, 2] = -(qx * a + qy * b) * lag
    return result


def solve_velocity(
    matrix: FloatArray, rhs: FloatArray, doubt: FloatArray, max_speed_mps: float
) -> tuple[FloatArray, FloatArray]:
    """Velocity (..., 3) and covariance (..., 3, 3) from summed normal equations.

    What the equations leave open is bounded by max_speed_mps (the paper's V_omax), never zero.
    """
    information = matrix + np.eye(3) / max_speed_mps**2
    covariance = np.linalg.inv(information)
    velocity = (covariance @ rhs[..., None])[..., 0]
    common = (covariance @ doubt[..., None])[..., 0]
    return velocity, covariance + common[..., :, None] * common[..., None, :]
