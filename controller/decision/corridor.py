"""The floor that the robot's body will sweep along its path, and what stands where on it."""

from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from config.robot import Body
from controller.decision.bodies import Bodies
from controller.path.path import Path
from hal.types import FloatArray

_STEP_M = 0.1
# Obstacles further behind or ahead than this are nobody's business.
_BEHIND_M = 2.0


class Corridor:
    """The swept width along one path. All s are of the turning centre."""

    def __init__(self, path: Path, body: Body) -> None:
        self.path = path
        self.front_m, self.rear_m, self.height_m = body.front_m, body.rear_m, body.height_m
        overhang_m = max(body.front_m, body.rear_m)
        self._s = np.arange(-overhang_m, path.length_m + overhang_m + _STEP_M, _STEP_M)
        # A bend is felt from where the front enters it until the tail has left it.
        around = self._s[:, None] + np.linspace(-overhang_m, overhang_m, 11)
        bend = np.abs(path.curvatures(around)).max(axis=1)
        half_m = body.width_m / 2.0
        radius = 1.0 / np.maximum(bend, 1e-9)
        outer = np.sqrt((radius + half_m) ** 2 + overhang_m**2) - radius
        self._half_width = np.where(bend > 1e-6, outer, half_m)
        self.straight = not (bend > 1e-6).any()
        self._half_m = half_m

    def half_width(self, s_m: FloatArray) -> FloatArray:
        """Half of the swept width at s_m, in metres; on bends the outer corner's, on both sides."""
        if self.straight:
            same = np.empty(s_m.shape)
            same.fill(self._half_m)
            return same
        return np.interp(s_m, self._s, self._half_width)


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """N bodies at K times in path coordinates, each (N, K).

    s_m, d_m: centre. heading_rad: of the path there. half_s_m: half size along the path. lo_m, hi_m: between
    these positions of the robot's turning centre, the robot's length and the body's overlap along the path.
    clear_m: free floor between the body's side and the swept corridor; negative: inside it. (On a straight
    path heading and half size are (N, 1): they do not change.)
    """

    s_m: FloatArray
    d_m: FloatArray
    heading_rad: FloatArray
    half_s_m: FloatArray
    lo_m: FloatArray
    hi_m: FloatArray
    clear_m: FloatArray

    def select(self, rows: NDArray[np.bool_], count: int) -> Placed:
        """Only these bodies, at the first count times."""
        chosen = rows.nonzero()[0]
        arrays = [array[:, :count] for array in _arrays_of(self)]
        if len(chosen) < len(rows):
            arrays = [array.take(chosen, 0) for array in arrays]
        return Placed(*arrays)


_arrays_of = attrgetter(*Placed.__slots__)


def place(bodies: Bodies, corridor: Corridor, times_s: FloatArray, near_s_m: float, reach_m: float) -> Placed:
    """Where the bodies are times_s (K,) after they were seen if they go on as they do.

    The path is looked at from a little behind near_s_m to reach_m ahead of it.
    """
    x = bodies.xy_m[:, :1] + bodies.velocity_mps[:, :1] * times_s
    y = bodies.xy_m[:, 1:] + bodies.velocity_mps[:, 1:] * times_s
    s, d, heading = corridor.path.locate(x, y, near_s_m - _BEHIND_M, near_s_m + reach_m)
    if corridor.straight:
        heading = heading[:, :1]
    turned = bodies.view_rad[:, None] - heading
    cos, sin = np.abs(np.cos(turned)), np.abs(np.sin(turned))
    along, across = bodies.half_view_m[:, None], bodies.half_across_m[:, None]
    half_s, half_d = cos * along + sin * across, sin * along + cos * across
    lo, hi = s - half_s - corridor.front_m, s + half_s + corridor.rear_m
    return Placed(s, d, heading, half_s, lo, hi, np.abs(d) - half_d - corridor.half_width(s))


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """How N bodies go, seen from the path where they are: speed along it and to its left, the standard
    deviation of either, and by how much the newest measurement differs; each (N,)."""

    along_mps: FloatArray
    left_mps: FloatArray
    sigma_along_mps: FloatArray
    sigma_left_mps: FloatArray
    surprise_along_mps: FloatArray
    surprise_left_mps: FloatArray

    def select(self, rows: NDArray[np.bool_]) -> Course:
        """Only these bodies."""
        chosen = rows.nonzero()[0]
        if len(chosen) == len(rows):
            return self
        return Course(*[array.take(chosen) for array in _courses_of(self)])


_courses_of = attrgetter(*Course.__slots__)


def course_of(bodies: Bodies, heading_rad: FloatArray) -> Course:
    """heading_rad (N,): of the path where each body is."""
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    x, y = bodies.velocity_mps.T
    more_x, more_y = bodies.surprise_mps.T
    xx, yy = bodies.covariance[:, 0, 0], bodies.covariance[:, 1, 1]
    mixed = bodies.covariance[:, 0, 1] + bodies.covariance[:, 1, 0]
    turned = mixed * cos * sin
    return Course(
        x * cos + y * sin,
        y * cos - x * sin,
        np.sqrt(np.maximum(xx * cos * cos + turned + yy * sin * sin, 0.0)),
        np.sqrt(np.maximum(xx * sin * sin - turned + yy * cos * cos, 0.0)),
        more_x * cos + more_y * sin,
        more_y * cos - more_x * sin,
    )
