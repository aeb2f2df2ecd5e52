"""The floor that the robot's body will sweep along its path, and what stands where on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.robot import Body
from controller.bodies import Bodies
from controller.path import Path
from hal.types import FloatArray

_STEP_M = 0.1
# Obstacles further behind or ahead than this are nobody's business.
_BEHIND_M = 2.0


class Corridor:
    """The swept width along one path. All s are of the turning centre."""

    def __init__(self, path: Path, body: Body) -> None:
        self.path = path
        self.front_m, self.rear_m = body.front_m, body.rear_m
        overhang_m = max(body.front_m, body.rear_m)
        self._s = np.arange(-overhang_m, path.length_m + overhang_m + _STEP_M, _STEP_M)
        # A bend is felt from where the front enters it until the tail has left it.
        around = self._s[:, None] + np.linspace(-overhang_m, overhang_m, 11)
        bend = np.abs(path.curvatures(around)).max(axis=1)
        half_m = body.width_m / 2.0
        radius = 1.0 / np.maximum(bend, 1e-9)
        outer = np.sqrt((radius + half_m) ** 2 + overhang_m**2) - radius
        self._half_width = np.where(bend > 1e-6, outer, half_m)

    def half_width(self, s_m: FloatArray) -> FloatArray:
        """Half of the swept width at s_m, in metres; on bends the outer corner's, on both sides."""
        return np.interp(s_m, self._s, self._half_width)


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """N bodies at K times in path coordinates, each (N, K).

    s_m, d_m: centre. half_s_m, half_d_m: half sizes along and across the path. half_width_m: of the swept
    corridor there. lo_m, hi_m: between these positions of the robot's turning centre, the robot's length and
    the body's overlap along the path.
    """

    s_m: FloatArray
    d_m: FloatArray
    half_s_m: FloatArray
    half_d_m: FloatArray
    half_width_m: FloatArray
    lo_m: FloatArray
    hi_m: FloatArray

    @property
    def clear_m(self) -> FloatArray:
        """(N, K) free floor between the body's side and the swept corridor; negative: inside it."""
        return np.abs(self.d_m) - self.half_d_m - self.half_width_m


def place(bodies: Bodies, corridor: Corridor, times_s: FloatArray, near_s_m: float, reach_m: float) -> Placed:
    """Where the bodies are times_s (K,) after they were seen if they go on as they do.

    The path is looked at from a little behind near_s_m to reach_m ahead of it.
    """
    count, steps = len(bodies), len(times_s)
    moving = np.flatnonzero(bodies.moving)
    s, d = np.empty((count, steps)), np.empty((count, steps))
    # What stands is projected once, whatever the time.
    moved = bodies.xy_m[moving, None, :] + bodies.velocity_mps[moving, None, :] * times_s[:, None]
    points = np.concatenate((bodies.xy_m, moved.reshape(-1, 2)))
    found_s, found_d = corridor.path.project_points(points, near_s_m - _BEHIND_M, near_s_m + reach_m)
    s[:], d[:] = found_s[:count, None], found_d[:count, None]
    s[moving] = found_s[count:].reshape(-1, steps)
    d[moving] = found_d[count:].reshape(-1, steps)
    heading = corridor.path.poses(s)[2]
    turned = bodies.view_rad[:, None] - heading
    cos, sin = np.abs(np.cos(turned)), np.abs(np.sin(turned))
    along, across = bodies.half_view_m[:, None], bodies.half_across_m[:, None]
    half_s, half_d = cos * along + sin * across, sin * along + cos * across
    return Placed(
        s,
        d,
        half_s,
        half_d,
        corridor.half_width(s),
        s - half_s - corridor.front_m,
        s + half_s + corridor.rear_m,
    )


def velocity_on_path(bodies: Bodies, corridor: Corridor, s_m: FloatArray) -> tuple[FloatArray, ...]:
    """Of each body at s_m (N,): speed along the path, to its left, and the standard deviation of either."""
    heading = corridor.path.poses(s_m)[2]
    tangent = np.stack((np.cos(heading), np.sin(heading)), axis=1)
    normal = np.stack((-tangent[:, 1], tangent[:, 0]), axis=1)
    return (
        np.sum(bodies.velocity_mps * tangent, axis=1),
        np.sum(bodies.velocity_mps * normal, axis=1),
        _sigma(bodies.covariance, tangent),
        _sigma(bodies.covariance, normal),
    )


def _sigma(covariance: FloatArray, direction: FloatArray) -> FloatArray:
    variance: NDArray[np.float64] = np.einsum("ni,nij,nj->n", direction, covariance, direction)
    return np.sqrt(np.maximum(variance, 0.0))
