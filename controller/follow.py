"""Path following: the yaw rate that keeps a skid-steered base on its path.

The control law is written per metre driven, so that the track on the floor is the same at every speed:

    w = v * (kappa cos(psi) / (1 - kappa d) - k_d d sinc(psi) - k_psi sin(psi))

with k_d = n^2, k_psi = 2 n: critically damped, back on the path within about 3 / n metres. The bandwidth n is
lowered where v * n would come near what the chassis can follow. At v = 0 the yaw rate is 0: tracks that turn
in place damage the floor, and there is no need to turn.

In a bend of radius R, a base that turns by a share e less than commanded has the offset
d = e / ((1 - e) R k_d): 1.4 cm for 10 % on 2 m. With dead reckoning alone the robot is only as exactly on its
path as its odometry is exact.
"""

from __future__ import annotations

import math

from config.robot import Limits
from controller.path.path import OnPath, Path

_BANDWIDTH_1PM = 2.0
# Bound of v * n: the loop must stay well below what a base with a lag of some 0.2 s can follow.
_BANDWIDTH_RADPS = 2.5
# A larger offset is cut to this; its correction would turn the robot across its path.
_MOST_OFFSET_M = 0.5


class PathFollower:
    """Computes the yaw rate. preview_s: how much ahead of a bend the chassis must be commanded."""

    def __init__(self, path: Path, limits: Limits, preview_s: float = 0.0) -> None:
        self._path = path
        self._max_yaw_rate_radps = limits.max_yaw_rate_radps
        self._preview_s = preview_s

    def step(self, on_path: OnPath, v_mps: float) -> float:
        """Yaw rate in rad/s for a robot at on_path that is commanded to drive v_mps.

        Always within the robot's limit; 0 if any input is not finite or v_mps is not positive.
        """
        known = math.isfinite(on_path.s_m + on_path.d_m + on_path.heading_rad + v_mps)
        if not known or v_mps <= 0.0:
            return 0.0
        curvature = self._path.curvature(on_path.s_m + v_mps * self._preview_s)
        n = min(_BANDWIDTH_1PM, _BANDWIDTH_RADPS / v_mps)
        d = min(max(on_path.d_m, -_MOST_OFFSET_M), _MOST_OFFSET_M)
        psi = on_path.heading_rad
        sinc = math.sin(psi) / psi if abs(psi) > 1e-6 else 1.0
        # Towards the centre of a bend (kappa d -> 1) this term grows without bound, so it is bounded as at
        # half the radius.
        along = math.cos(psi) / max(1.0 - curvature * d, 0.5)
        w = v_mps * (curvature * along - n * n * d * sinc - 2.0 * n * math.sin(psi))
        return min(max(w, -self._max_yaw_rate_radps), self._max_yaw_rate_radps)
