"""The floor that the robot's body sweeps along its path (the corridor), and where bodies are relative to it.

Corridor holds the swept width along one path; place() puts bodies into path coordinates at future times;
path_velocities() turns their velocities into speeds along the path and across it.
"""

from __future__ import annotations

import math

import numpy as np

from config.robot import Body
from controller.decision.bodies import Bodies
from controller.path.path import Path
from controller.path.projection import Projection, located
from hal.compiled import compiled, inlined
from hal.directions import along_and_left
from hal.records import record
from hal.types import FloatArray, Matrix, Vector

# Bodies and surfaces are looked for this much farther along the path than the range of sight.
BEYOND_RANGE_M = 2.0
_STEP_M = 0.1
# The path is searched from this far behind the robot.
_BEHIND_M = 2.0


class Corridor:
    """The swept width along one path. All s are of the robot's turning centre.

    half_widths_m (W,): sampled every _STEP_M, from overhang_m before the beginning of the path on.
    """

    half_widths_m: Vector
    overhang_m: float
    front_m: float
    rear_m: float

    def __init__(self, path: Path, body: Body) -> None:
        self.path = path
        self.front_m, self.rear_m, self.height_m = body.front_m, body.rear_m, body.height_m
        self.overhang_m = max(body.front_m, body.rear_m)
        s_m = np.arange(-self.overhang_m, path.length_m + self.overhang_m + _STEP_M, _STEP_M)
        # A bend widens the corridor from where the front enters it until the tail has left it.
        around = s_m[:, None] + np.linspace(-self.overhang_m, self.overhang_m, 11)
        bend = np.abs(path.curvatures(around)).max(axis=1)
        half_m = body.width_m / 2.0
        radius = 1.0 / np.maximum(bend, 1e-9)
        outer = np.sqrt((radius + half_m) ** 2 + self.overhang_m**2) - radius
        self.half_widths_m = np.where(bend > 1e-6, outer, half_m)
        self.straight = not (bend > 1e-6).any()

    def half_width(self, s_m: FloatArray) -> FloatArray:
        """(P,) half of the swept width at s_m (P,); in bends that of the outer corner, on both sides."""
        return _half_widths(self, s_m)

    def half_width_at(self, s_m: float) -> float:
        """Half of the swept width at a single s_m."""
        return _one_half_width(self, s_m)

    def locate(self, points_m: FloatArray, from_s_m: float, to_s_m: float) -> FloatArray:
        """(3, P) path coordinates s_m and d_m of points (P, 2), and half of the swept width there.

        The path is searched from from_s_m to to_s_m.
        """
        return _points_along(self.path.projection, self, points_m, from_s_m, to_s_m)


@record(frozen=True, slots=True, eq=False)
class Placed:
    """N bodies at K times in path coordinates, each (N, K).

    s_m, d_m: centre.
    heading_rad: heading of the path there.
    half_s_m: half size along the path.
    block_from_s_m, block_to_s_m: while the robot's turning centre is between these, robot and body overlap
        along the path.
    clearance_m: free floor between the body's side and the corridor; negative: inside it.
    """

    s_m: Matrix
    d_m: Matrix
    heading_rad: Matrix
    half_s_m: Matrix
    block_from_s_m: Matrix
    block_to_s_m: Matrix
    clearance_m: Matrix


def place(bodies: Bodies, corridor: Corridor, times_s: FloatArray, near_s_m: float, reach_m: float) -> Placed:
    """Where the bodies are times_s (K,) after they were seen if they keep their velocity.

    The path is searched from _BEHIND_M behind near_s_m to reach_m ahead of it.
    """
    from_s_m, to_s_m = near_s_m - _BEHIND_M, near_s_m + reach_m
    return Placed(*_placed(corridor.path.projection, bodies, corridor, times_s, from_s_m, to_s_m))


@inlined
def _half_width(corridor: Corridor, s_m: float) -> float:
    """Half of the swept width at s_m, interpolated."""
    half_widths_m = corridor.half_widths_m
    # max(0.0, ...) in this order gives 0.0 for NaN; max(..., 0.0) would give NaN.
    place = min(max(0.0, (s_m + corridor.overhang_m) / _STEP_M), len(half_widths_m) - 1.0)
    k = min(int(place), len(half_widths_m) - 2)
    return float(half_widths_m[k] + (place - k) * (half_widths_m[k + 1] - half_widths_m[k]))


@compiled(Corridor, "float64")
def _one_half_width(corridor: Corridor, s_m: float) -> float:
    return _half_width(corridor, s_m)


@compiled(Corridor, "float64[:]")
def _half_widths(corridor: Corridor, s_m: FloatArray) -> FloatArray:
    half_width = np.empty(len(s_m))
    for k in range(len(s_m)):
        half_width[k] = _half_width(corridor, s_m[k])
    return half_width


@compiled(Projection, Corridor, "float64[:, :], float64, float64")
def _points_along(
    path: Projection, corridor: Corridor, points_m: FloatArray, from_s_m: float, to_s_m: float
) -> FloatArray:
    """As Corridor.locate()."""
    points = np.empty((3, len(points_m)))
    found = located(path, points_m, np.zeros(points_m.shape), np.zeros(1), from_s_m, to_s_m)
    points[:2] = found[:2, :, 0]
    for k in range(len(points_m)):
        points[2, k] = _half_width(corridor, points[0, k])
    return points


@compiled(Projection, Bodies, Corridor, "float64[:], float64, float64")
def _placed(
    path: Projection,
    bodies: Bodies,
    corridor: Corridor,
    times_s: FloatArray,
    from_s_m: float,
    to_s_m: float,
) -> FloatArray:
    """(7, N, K) the fields of Placed, for N bodies; the path is searched from from_s_m to to_s_m."""
    placed = np.empty((7, len(bodies.xy_m), len(times_s)))
    placed[:3] = located(path, bodies.xy_m, bodies.velocity_mps, times_s, from_s_m, to_s_m)
    s_m, d_m, heading_rad, half_s, block_from, block_to, clearance = placed
    for k in range(len(s_m)):
        along, across = bodies.half_view_m[k], bodies.half_across_m[k]
        cos = sin = 0.0
        for j in range(s_m.shape[1]):
            if j == 0 or heading_rad[k, j] != heading_rad[k, j - 1]:
                turned = bodies.view_rad[k] - heading_rad[k, j]
                cos, sin = abs(math.cos(turned)), abs(math.sin(turned))
            half_s[k, j] = cos * along + sin * across
            block_from[k, j] = s_m[k, j] - half_s[k, j] - corridor.front_m
            block_to[k, j] = s_m[k, j] + half_s[k, j] + corridor.rear_m
            beside = abs(d_m[k, j]) - (sin * along + cos * across)
            clearance[k, j] = beside - _half_width(corridor, s_m[k, j])
    return placed


@record(frozen=True, slots=True, eq=False)
class PathVelocities:
    """Velocities of N bodies relative to the path where they are; each (N,).

    along_mps, left_mps: speed along the path and to its left.
    sigma_along_mps, sigma_left_mps: their standard deviations.
    innovation_along_mps, innovation_left_mps: by how much the newest measurement differs from them.
    """

    along_mps: Vector
    left_mps: Vector
    sigma_along_mps: Vector
    sigma_left_mps: Vector
    innovation_along_mps: Vector
    innovation_left_mps: Vector


def path_velocities(bodies: Bodies, heading_rad: FloatArray) -> PathVelocities:
    """The velocities relative to the path. heading_rad (N,): heading of the path where each body is."""
    return PathVelocities(*_seen_along(bodies, heading_rad))


@compiled(Bodies, "float64[:]")
def _seen_along(bodies: Bodies, heading_rad: FloatArray) -> FloatArray:
    """(6, N) the fields of PathVelocities."""
    velocities = np.empty((6, len(heading_rad)))
    along, left, sigma_along, sigma_left, more_along, more_left = velocities
    for k in range(len(heading_rad)):
        cos, sin = math.cos(heading_rad[k]), math.sin(heading_rad[k])
        x, y = bodies.velocity_mps[k]
        along[k], left[k] = along_and_left(x, y, cos, sin)
        x, y = bodies.innovation_mps[k]
        more_along[k], more_left[k] = along_and_left(x, y, cos, sin)
        spread = bodies.covariance[k]
        xx, yy = spread[0, 0], spread[1, 1]
        turned = (spread[0, 1] + spread[1, 0]) * cos * sin
        sigma_along[k] = math.sqrt(max(xx * cos * cos + turned + yy * sin * sin, 0.0))
        sigma_left[k] = math.sqrt(max(xx * sin * sin - turned + yy * cos * cos, 0.0))
    return velocities
