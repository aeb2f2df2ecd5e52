"""Linear equations for the velocity of points over ground (eqs. 6 to 9 of Daeef 2020).

A point anchored at (x, y, z) some frames ago would now, if it were static, be at S = (X, Y, Z) in the camera
frame: S contains the robot's own motion. If it moved with velocity V over ground for a time T, it is at
S + V T. It is seen at (x', y') on the plane z = 1, so

    x' (Z + Vz T) = X + Vx T        y' (Z + Vz T) = Y + Vy T        z' = Z + Vz T

which is linear in V. For two ends of one segment at one depth, the difference of the image equations of the
two ends is the paper's length ratio, Z + Vz T = Z L_static / L_now (eqs. 6, 8). The first equation is the
paper's lateral speed, X + Vx T = x' (Z + Vz T) (eqs. 7, 9), without a division by the image x, which is zero
in the centre. The third equation is the measurement of the depth image, weighted by its noise.
"""

from __future__ import annotations

import numpy as np

from hal.compiled import compiled
from hal.records import record
from hal.types import Flags, FloatArray, Matrix, Vector

STATIC_END_CHI2 = 6.0  # of static_chi2: 95 % of static ends lie below; 2 degrees of freedom
_MIN_DETERMINANT = 1e-18  # m^4, of a covariance: a lower bound that avoids a division by 0


@record(frozen=True, slots=True, eq=False)
class EndResiduals:
    """Residuals of N tracked points, in the present camera axes. Symbols: see the module docstring.

    static_m: S, where the point would be if it were static, (N, 3).
    ray: x', y', (N, 2).
    lag_s: T, (N,).
    residual_m: x' Z - X, y' Z - Y; zero for a static point, (N, 2).
    covariance: xx, xy, yy of residual_m in m^2, from pixels and the camera's pose, (N, 3).
    depth_effect: change of residual_m by one sigma of the anchor's depth, (N, 2).
    depth_step_m: z' - Z, NaN where depth is missing, (N,).
    depth_step_sigma_m: its standard deviation, (N,).
    depth_lag_s: time in which it came about, (N,). It is longer than T, since Z is an average over the frames
        before the anchor as well.
    static_chi2: with 2 degrees of freedom, the smaller one for the near and the far surface, (N,).
    usable: none of the others but depth_step_m is NaN where this is true, (N,).
    """

    static_m: Matrix
    ray: Matrix
    lag_s: Vector
    residual_m: Matrix
    covariance: Matrix
    depth_effect: Matrix
    depth_step_m: Vector
    depth_step_sigma_m: Vector
    depth_lag_s: Vector
    static_chi2: Vector
    usable: Flags


@compiled(EndResiduals, "float64[:]")
def normal_equations(motion: EndResiduals, weight: FloatArray) -> FloatArray:
    """Normal equations of the weighted least squares for V, (12, N): one column per point.

    From the two image equations of each point, weighted by their covariance and weight (N,). Rows 0 to 5:
    entries 00, 01, 02, 11, 12, 22 of the symmetric matrix. Rows 6 to 8: right-hand side. Rows 9 to 11:
    right-hand side for one sigma of a depth error common to all points of a body. Zero where weight is zero,
    even if other inputs are NaN there.
    """
    table = np.zeros((12, len(weight)))
    for k in range(len(weight)):
        if weight[k] == 0.0:
            continue
        lag_s = motion.lag_s[k]
        xx, xy, yy = motion.covariance[k]
        scale = weight[k] * lag_s / max(xx * yy - xy * xy, _MIN_DETERMINANT)
        pxx, pxy, pyy = yy * scale, -xy * scale, xx * scale
        x, y = motion.ray[k]
        # Rows (1, 0, -x') T and (0, 1, -y') T with information [[pxx, pxy], [pxy, pyy]].
        qx, qy = -(pxx * x + pxy * y), -(pxy * x + pyy * y)
        table[0, k] = pxx * lag_s
        table[1, k] = pxy * lag_s
        table[2, k] = qx * lag_s
        table[3, k] = pyy * lag_s
        table[4, k] = qy * lag_s
        table[5, k] = -(qx * x + qy * y) * lag_s
        for row, vector in ((6, motion.residual_m[k]), (9, motion.depth_effect[k])):
            a, b = vector
            table[row, k] = pxx * a + pxy * b
            table[row + 1, k] = pxy * a + pyy * b
            table[row + 2, k] = qx * a + qy * b
    return table
