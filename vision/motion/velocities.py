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
from vision.numerics.symmetric import inverse_entries, whole


@dataclass(frozen=True, slots=True, eq=False)
class PointMotion:
    """Residuals of N tracked points, in the camera axes now. All NaN-free where usable.

    static_m (N, 3): where it would be if static. ray (N, 2): x', y' now. lag_s (N,): T.
    miss_m (N, 2): x' Z - X, y' Z - Y: zero for a static point. covariance (N, 3): xx, xy, yy of miss_m
    from pixels (m^2). depth_effect (N, 2): change of miss_m by one sigma of the anchor's depth.
    depth_step_m (N,): z' - Z, NaN where depth is missing. depth_step_sigma_m (N,). depth_lag_s (N,): the
    time in which it came about; longer than T, since Z is an average over the frames before, too.
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
    depth_lag_s: FloatArray
    static_chi2: FloatArray
    usable: NDArray[np.bool_]


def chi2_2d(miss: FloatArray, covariance: FloatArray, effect: FloatArray) -> FloatArray:
    """(N,) squared Mahalanobis length of miss (N, 2) under covariance (N, 3) plus effect effect^T."""
    xx = covariance[:, 0] + effect[:, 0] ** 2
    xy = covariance[:, 1] + effect[:, 0] * effect[:, 1]
    yy = covariance[:, 2] + effect[:, 1] ** 2
    determinant = np.maximum(xx * yy - xy * xy, 1e-18)
    a, b = miss[:, 0], miss[:, 1]
    result: FloatArray = (yy * a * a - 2.0 * xy * a * b + xx * b * b) / determinant
    return result


def end_information(motion: PointMotion) -> FloatArray:
    """(3, N) xx, xy, yy of the inverse covariance of miss_m, from pixels and from depth."""
    xx, xy, yy = motion.covariance.T
    a, b = motion.depth_effect.T
    xx, xy, yy = xx + a * a, xy + a * b, yy + b * b
    result = np.empty((3, len(xx)))
    result[0], result[1], result[2] = yy, -xy, xx
    result /= np.maximum(xx * yy - xy * xy, 1e-18)
    return result


_UNIT = np.array([[1.0], [0.0], [0.0], [1.0], [0.0], [1.0]])  # entries of the symmetric identity (3, 3)


@dataclass(frozen=True, slots=True, eq=False)
class NormalEquations:
    """Of the weighted least squares for V, one column of table (12, N) per point or sum of points.

    Rows 0 to 5: entries 00, 01, 02, 11, 12, 22 of the symmetric matrix. Rows 6 to 8: right side. Rows 9 to
    11, doubt: the right side that one sigma of a depth error common to all points of a body would make.
    """

    table: FloatArray

    @property
    def matrix(self) -> FloatArray:
        """(N, 3, 3)."""
        return whole(self.table[:6]).transpose(2, 0, 1)

    @property
    def rhs(self) -> FloatArray:
        """(N, 3)."""
        return self.table[6:9].T

    @property
    def doubt(self) -> FloatArray:
        """(N, 3)."""
        return self.table[9:].T

    def add_depth(self, information: FloatArray, measured: FloatArray) -> None:
        """Measurements of V along z: their information (N,), and that times what they say (N,)."""
        self.table[5] += information
        self.table[8] += measured


def normal_equations(motion: PointMotion, weight: FloatArray) -> NormalEquations:
    """The two image equations of each point, weighted by their covariance and weight (N,)."""
    lag = motion.lag_s
    xx, xy, yy = motion.covariance.T
    scale = weight * lag / np.maximum(xx * yy - xy * xy, 1e-18)
    pxx, pxy, pyy = yy * scale, xy * -scale, xx * scale
    x, y = motion.ray.T
    # Rows (1, 0, -x') T and (0, 1, -y') T with information [[pxx, pxy], [pxy, pyy]].
    qx, qy = -(pxx * x + pxy * y), -(pxy * x + pyy * y)
    table = np.empty((12, len(weight)))
    table[0], table[1], table[2], table[3], table[4] = pxx, pxy, qx, pyy, qy
    table[5] = -(qx * x + qy * y)
    table[:6] *= lag
    for row, vector in ((6, motion.miss_m), (9, motion.depth_effect)):
        a, b = vector.T
        table[row] = pxx * a + pxy * b
        table[row + 1] = pxy * a + pyy * b
        table[row + 2] = qx * a + qy * b
    return NormalEquations(table)


def solve_velocity(equations: NormalEquations, max_speed_mps: float) -> tuple[FloatArray, FloatArray]:
    """Velocity (N, 3) and covariance (N, 3, 3) from summed normal equations.

    What the equations leave open is bounded by max_speed_mps (the paper's V_omax), never zero.
    """
    inverse = whole(inverse_entries(equations.table[:6] + _UNIT / max_speed_mps**2))
    sides = equations.table[6:].reshape(2, 1, 3, -1)
    velocity, common = (inverse * sides).sum(axis=2)
    covariance = inverse + common[:, None] * common
    return velocity.T, covariance.transpose(2, 0, 1)
