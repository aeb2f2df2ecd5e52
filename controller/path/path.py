"""The planned path: where the robot is along it, how it bends, and how fast it may be driven.

Everything is computed in closed form on pieces of constant curvature (controller/path/path_pieces.py);
controller/path/projection.py finds the path coordinates of points.

Path coordinates: s_m along the path from its start, d_m to the left of it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from config.loader import ConfigError
from config.path import ArcSpec, PathSpec
from config.robot import Robot
from controller.path.path_pieces import pieces_of
from controller.path.path_speeds import least_radius_m, section_speeds
from controller.path.projection import Projection
from hal.compiled import compiled
from hal.geometry import body_in_floor, wrap_angle_rad
from hal.records import record
from hal.types import FloatArray, PlanarPose

IntArray = NDArray[np.intp]

_NOW = np.zeros(1)
# A pose is searched this far behind and ahead of where it was last.
_LOOK_BACK_M = 0.25
_LOOK_AHEAD_M = 2.0
_SHOWN_M, _SHOWN_STEP_M = 12.0, 0.25  # of the path in pictures
# (N, 2) in the body frame: the way of a robot that is shown to drive straight on, whatever its path.
STRAIGHT_AHEAD_M = np.column_stack([np.linspace(0.0, 10.0, 41), np.zeros(41)])
_OPPOSED_RAD = math.radians(120.0)  # headings that differ by more are opposed


class PathError(ConfigError):
    """The path cannot be driven by this robot: what, where and what to do, in one line."""


@record(frozen=True, slots=True)
class OnPath:
    """A pose in path coordinates: s_m along, d_m to the left, heading_rad relative to the path."""

    s_m: float
    d_m: float
    heading_rad: float


class Path:
    """The path in the frame of its start pose; immutable.

    projection: of points onto it.
    Raises PathError when a bend is tighter than the robot can drive or the path doubles back on itself.
    """

    def __init__(self, spec: PathSpec, robot: Robot) -> None:
        pieces = pieces_of(spec)
        self.length_m = pieces[-1].s_m
        _check_bends(spec, robot)
        self.projection = Projection(pieces)
        self._s, _, _, _, self._curvature = self.projection.chain
        self._check_doubling_back(robot.body.width_m)
        speed_s, speed = section_speeds(spec, robot, self._curvature[1:-1], self._s[1:-1])
        self._speed_step_m = float(speed_s[1] - speed_s[0])
        self._speed = speed

    @property
    def start(self) -> PlanarPose:
        """Where the path begins."""
        return self.pose(0.0)

    def pose(self, s_m: float) -> PlanarPose:
        """Point and direction of the path at s_m; the path goes straight on beyond its ends."""
        x, y, heading = self.poses(np.array([s_m]))
        return PlanarPose(float(x[0]), float(y[0]), wrap_angle_rad(float(heading[0])))

    def poses(self, s_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """x_m, y_m and heading_rad (not wrapped) of the path at s_m (S,), (S,) each."""
        return self.projection.poses(s_m)

    def ahead(self, s_m: float, body: PlanarPose) -> FloatArray:
        """(N, 2) points of the path from s_m on, in the body frame, for pictures."""
        end_m = min(s_m + _SHOWN_M, self.length_m)
        x_m, y_m, _ = self.poses(np.arange(s_m, end_m + _SHOWN_STEP_M, _SHOWN_STEP_M).clip(max=end_m))
        floor = np.column_stack([x_m, y_m, np.zeros_like(x_m)])
        return body_in_floor(body).inverse().apply(floor)[:, :2]

    def curvature(self, s_m: float) -> float:
        """Curvature in 1/m at s_m, positive to the left."""
        return float(self._curvature[self._piece_at(np.array([s_m]))[0]])

    def curvatures(self, s_m: FloatArray) -> FloatArray:
        """Curvatures in 1/m at each s_m."""
        return self._curvature[self._piece_at(s_m)]

    def project(self, pose: PlanarPose, hint_s_m: float) -> OnPath:
        """The pose in path coordinates.

        It is searched from 0.25 m behind hint_s_m to 2 m ahead of it only, so that it cannot jump to another
        part of the path that is near.
        """
        s, d, heading = self.projection.project(
            pose.x_m, pose.y_m, hint_s_m - _LOOK_BACK_M, hint_s_m + _LOOK_AHEAD_M
        )
        return OnPath(s, d, wrap_angle_rad(pose.heading_rad - heading))

    def project_points(
        self, points_m: FloatArray, from_s_m: float = -math.inf, to_s_m: float = math.inf
    ) -> tuple[FloatArray, FloatArray]:
        """Path coordinates s_m (N,), d_m (N,) of points (N, 2), on the part from_s_m..to_s_m of the path."""
        located = self.projection.locate(points_m, np.zeros(points_m.shape), _NOW, from_s_m, to_s_m)
        return located[0, :, 0], located[1, :, 0]

    def speed_limit(self, s_m: float) -> float:
        """The greatest speed at s_m, in m/s, at which every slower section and bend ahead can be met.

        Raises ValueError for NaN, which would pass for the beginning of the path.
        """
        if math.isnan(s_m):
            raise ValueError("the robot's place on the path is not known: there is no speed limit for it")
        return _between(self._speed, min(max(0.0, s_m), self.length_m) / self._speed_step_m)

    def _piece_at(self, s_m: FloatArray) -> IntArray:
        return np.maximum(self._s.searchsorted(s_m, side="right") - 1, 0)

    def _check_doubling_back(self, width_m: float) -> None:
        s = np.append(np.arange(0.0, self.length_m, width_m / 4.0), self.length_m)
        x, y, heading = self.poses(s)
        first, again = _swept_twice(x, y, heading, width_m)
        if again > first:
            raise PathError(
                "path: doubles back on itself: the robot would sweep the same floor at "
                f"{s[first]:.1f} m and, the other way, at {s[again]:.1f} m; "
                f"widen the turn to a radius above {width_m / 2:.2f} m"
            )


@compiled("float64[:], float64[:], float64[:], float64")
def _swept_twice(
    x_m: FloatArray, y_m: FloatArray, heading_rad: FloatArray, width_m: float
) -> tuple[int, int]:
    """Indices of the first two poses (S,) nearer to each other than width_m and opposed; 0, 0: none."""
    for k in range(len(x_m)):
        for j in range(k, len(x_m)):
            if math.hypot(x_m[j] - x_m[k], y_m[j] - y_m[k]) < width_m:
                turned = (heading_rad[j] - heading_rad[k] + math.pi) % (2.0 * math.pi) - math.pi
                if abs(turned) > _OPPOSED_RAD:
                    return k, j
    return 0, 0


@compiled("float64[::1], float64")
def _between(values: FloatArray, place: float) -> float:
    """The value at a fractional index place, interpolated between values (S,)."""
    k = min(int(place), len(values) - 2)
    return float(values[k] + (place - k) * (values[k + 1] - values[k]))


def _check_bends(spec: PathSpec, robot: Robot) -> None:
    """Refuse bends that are tighter than this robot can drive."""
    tightest_m = least_radius_m(robot)
    for number, segment in enumerate(spec.segments):
        if isinstance(segment, ArcSpec) and segment.radius_m < tightest_m:
            raise PathError(
                f"path: segments.{number}: radius_m {segment.radius_m:g} is tighter than this robot can "
                f"drive; use at least {tightest_m:.2f} m (its half width, and what its yaw rate allows)"
            )
