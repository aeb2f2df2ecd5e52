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

from hal.compiled import compiled
from hal.types import FloatArray

_LEAST_DETERMINANT = 1e-18  # m^4, of a covariance: less is none
# Where the six different entries of a symmetric matrix (3, 3) stand among its nine.
_ALL = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])


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


@dataclass(frozen=True, slots=True, eq=False)
class NormalEquations:
    """Of the weighted least squares for V, one column of table (12, N) per point.

    Rows 0 to 5: entries 00, 01, 02, 11, 12, 22 of the symmetric matrix. Rows 6 to 8: right side. Rows 9 to
    11, doubt: the right side that one sigma of a depth error common to all points of a body would make.
    """

    table: FloatArray

    @property
    def matrix(self) -> FloatArray:
        """(N, 3, 3)."""
        return self.table.take(_ALL, axis=0).transpose(2, 0, 1)

    @property
    def rhs(self) -> FloatArray:
        """(N, 3)."""
        return self.table[6:9].T

    @property
    def doubt(self) -> FloatArray:
        """(N, 3)."""
        return self.table[9:].T


def normal_equations(motion: PointMotion, weight: FloatArray) -> NormalEquations:
    """The two image equations of each point, weighted by their covariance and weight (N,)."""
    table = _equations(
        np.ascontiguousarray(motion.ray),
        np.ascontiguousarray(motion.lag_s),
        np.ascontiguousarray(motion.miss_m),
        np.ascontiguousarray(motion.covariance),
        np.ascontiguousarray(motion.depth_effect),
        np.ascontiguousarray(weight),
    )
    return NormalEquations(table)


@compiled("float64[:, ::1], float64[::1], float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[::1]")
def _equations(
    ray: FloatArray,
    lag_s: FloatArray,
    miss_m: FloatArray,
    covariance: FloatArray,
    depth_effect: FloatArray,
    weight: FloatArray,
) -> FloatArray:
    """(12, N) table of NormalEquations; zero where weight is, whatever else there is."""
    table = np.zeros((12, len(weight)))
    for k in range(len(weight)):
        if weight[k] == 0.0:
            continue
        xx, xy, yy = covariance[k]
        scale = weight[k] * lag_s[k] / max(xx * yy - xy * xy, _LEAST_DETERMINANT)
        pxx, pxy, pyy = yy * scale, -xy * scale, xx * scale
        x, y = ray[k]
        # Rows (1, 0, -x') T and (0, 1, -y') T with information [[pxx, pxy], [pxy, pyy]].
        qx, qy = -(pxx * x + pxy * y), -(pxy * x + pyy * y)
        table[0, k] = pxx * lag_s[k]
        table[1, k] = pxy * lag_s[k]
        table[2, k] = qx * lag_s[k]
        table[3, k] = pyy * lag_s[k]
        table[4, k] = qy * lag_s[k]
        table[5, k] = -(qx * x + qy * y) * lag_s[k]
        for row, vector in ((6, miss_m[k]), (9, depth_effect[k])):
            a, b = vector
            table[row, k] = pxx * a + pxy * b
            table[row + 1, k] = pxy * a + pyy * b
            table[row + 2, k] = qx * a + qy * b
    return table
