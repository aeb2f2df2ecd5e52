"""The planned path: where the robot is along it, how it bends, and how fast it may be driven.

Every measure is closed-form on a piece of constant curvature (controller/path/path_pieces.py), and points are
projected in arrays over pieces; where all that is looked at is straight, without a search.

Path coordinates: s_m along the path from its start, d_m to the left of it.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.loader import ConfigError
from config.path import ArcSpec, PathSpec
from config.robot import Robot
from controller.path.path_pieces import EXTENSION_M, pieces_of, sinc
from controller.path.path_speeds import YAW_RATE_FOR_THE_BEND, section_speeds
from hal.geometry import wrap_angle_rad
from hal.types import FloatArray, PlanarPose

IntArray = NDArray[np.intp]

_SAMPLE_M = 0.25
_ROUNDS = 2
_STRAIGHT_1PM = 1e-7
# Near the centre of a bend "along the path" loses its sense; such a point is beside it, far inside.
_INNERMOST = 0.05
_LOOK_BACK_M = 0.25
_LOOK_AHEAD_M = 2.0
_SLOWEST_BEND_MPS = 0.1
_OPPOSED_RAD = math.radians(120.0)


class PathError(ConfigError):
    """The path cannot be driven by this robot: what, where and what to do, in one line."""


@dataclass(frozen=True, slots=True)
class OnPath:
    """A pose in path coordinates: s_m along, d_m to the left, heading_rad relative to the path."""

    s_m: float
    d_m: float
    heading_rad: float


class Path:
    """The path in the frame of its start pose; immutable.

    Raises PathError when a bend is tighter than the robot can drive or the path doubles back on itself.
    """

    def __init__(self, spec: PathSpec, robot: Robot) -> None:
        pieces = pieces_of(spec)
        self.length_m = pieces[-1].s_m
        _check_bends(spec, robot)
        self._pieces = pieces
        self._starts = [piece.s_m for piece in pieces]
        self._s = np.array([piece.s_m for piece in pieces])
        self._x = np.array([piece.x_m for piece in pieces])
        self._y = np.array([piece.y_m for piece in pieces])
        self._heading = np.array([piece.heading_rad for piece in pieces])
        self._curvature = np.array([piece.curvature_1pm for piece in pieces])
        samples = np.arange(-EXTENSION_M, self.length_m + EXTENSION_M + _SAMPLE_M, _SAMPLE_M)
        self._sample_x, self._sample_y, _ = self.poses(samples)
        self._check_doubling_back(robot.body.width_m)
        speed_s, speed = section_speeds(spec, robot, self._curvature[1:-1], self._s[1:-1])
        self._speed_step_m = float(speed_s[1] - speed_s[0])
        self._speed: list[float] = speed.tolist()
        # Straight on from a piece without a bend to the next one: how far that goes.
        self._straight_to = list(range(len(pieces)))
        for k in range(len(pieces) - 2, -1, -1):
            if pieces[k].curvature_1pm == 0.0 == pieces[k + 1].curvature_1pm:
                self._straight_to[k] = self._straight_to[k + 1]

    @property
    def start(self) -> PlanarPose:
        """Where the path begins."""
        return self.pose(0.0)

    def pose(self, s_m: float) -> PlanarPose:
        """The path's point and direction at s_m (straight on beyond the ends)."""
        x, y, heading = self.poses(np.array([s_m]))
        return PlanarPose(float(x[0]), float(y[0]), wrap_angle_rad(float(heading[0])))

    def poses(self, s_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """x_m, y_m and heading_rad (not wrapped) of the path at s_m, each of the shape of s_m."""
        return self._poses_on(self._piece_at(s_m), s_m)

    def _poses_on(self, k: IntArray, s_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        along = s_m - self._s[k]
        half_turn = 0.5 * self._curvature[k] * along
        chord = along * sinc(half_turn)
        middle = self._heading[k] + half_turn
        return (
            self._x[k] + chord * np.cos(middle),
            self._y[k] + chord * np.sin(middle),
            middle + half_turn,
        )

    def curvature(self, s_m: float) -> float:
        """1/m at s_m, positive to the left."""
        return float(self._curvature[self._piece_at(np.array([s_m]))[0]])

    def curvatures(self, s_m: FloatArray) -> FloatArray:
        """1/m at each s_m."""
        return self._curvature[self._piece_at(s_m)]

    def project(self, pose: PlanarPose, hint_s_m: float) -> OnPath:
        """The pose in path coordinates, searched near hint_s_m only, so that it cannot jump to another turn
        of the path: at most 0.25 m behind the hint and 2 m ahead of it."""
        low, high = hint_s_m - _LOOK_BACK_M, hint_s_m + _LOOK_AHEAD_M
        first = max(math.ceil((low + EXTENSION_M) / _SAMPLE_M), 0)
        last = max(int((high + EXTENSION_M) / _SAMPLE_M), first) + 1
        dx, dy = pose.x_m - self._sample_x[first:last], pose.y_m - self._sample_y[first:last]
        s = (first + int((dx * dx + dy * dy).argmin())) * _SAMPLE_M - EXTENSION_M
        ahead, left, turned, bend = self._one_seen_from(s, pose)
        for _ in range(_ROUNDS):
            if abs(bend) < _STRAIGHT_1PM:
                step = ahead
            else:
                step = math.atan2(bend * ahead, max(1.0 - bend * left, _INNERMOST)) / bend
            before, s = s, min(max(s + step, low), high)
            if s == before:
                break
            ahead, left, turned, bend = self._one_seen_from(s, pose)
        return OnPath(s, math.copysign(math.hypot(ahead, left), left), turned)

    def _one_seen_from(self, s_m: float, pose: PlanarPose) -> tuple[float, float, float, float]:
        """The pose ahead, to the left of and turned against the path at s_m, and the curvature there. The
        same as _seen_from in plain floats, ten times as fast for a single one."""
        piece = self._pieces[max(bisect_right(self._starts, s_m) - 1, 0)]
        along = s_m - piece.s_m
        bend = piece.curvature_1pm
        half_turn = 0.5 * bend * along
        chord = along * (math.sin(half_turn) / half_turn if abs(half_turn) > _STRAIGHT_1PM else 1.0)
        middle = piece.heading_rad + half_turn
        dx = pose.x_m - piece.x_m - chord * math.cos(middle)
        dy = pose.y_m - piece.y_m - chord * math.sin(middle)
        heading = middle + half_turn
        cos, sin = math.cos(heading), math.sin(heading)
        turned = wrap_angle_rad(pose.heading_rad - heading)
        return dx * cos + dy * sin, dy * cos - dx * sin, turned, bend

    def project_points(
        self, points_m: FloatArray, from_s_m: float = -math.inf, to_s_m: float = math.inf
    ) -> tuple[FloatArray, FloatArray]:
        """Path coordinates s_m (N,), d_m (N,) of points (N, 2), nearest to the part from_s_m..to_s_m."""
        return self.locate(points_m[:, 0], points_m[:, 1], from_s_m, to_s_m)[:2]

    def locate(
        self, x_m: FloatArray, y_m: FloatArray, from_s_m: float, to_s_m: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The same of points x_m, y_m, with the path's heading_rad there (not wrapped), each of one shape.

        From the nearest of samples 0.25 m apart, on the circle that the path is there: exact but for the
        steps of a blend, and those take a second round.
        """
        low = min(max(from_s_m, -EXTENSION_M), self.length_m + EXTENSION_M - _SAMPLE_M)
        high = min(max(to_s_m, low + _SAMPLE_M), self.length_m + EXTENSION_M)
        piece = max(bisect_right(self._starts, low) - 1, 0)
        if self._curvature[piece] == 0.0 and self._straight_to[piece] >= bisect_right(self._starts, high) - 1:
            return self._locate_on_line(piece, x_m, y_m, low, high)
        first = math.ceil((low + EXTENSION_M) / _SAMPLE_M)
        last = max(int((high + EXTENSION_M) / _SAMPLE_M), first) + 1
        dx = x_m[..., None] - self._sample_x[first:last]
        dy = y_m[..., None] - self._sample_y[first:last]
        s = (first + (dx * dx + dy * dy).argmin(axis=-1)) * _SAMPLE_M - EXTENSION_M
        for _ in range(_ROUNDS):
            ahead, left, bend, _ = self._seen_from(s, x_m, y_m)
            inward = np.maximum(1.0 - bend * left, _INNERMOST)
            curved = np.where(np.abs(bend) < _STRAIGHT_1PM, _STRAIGHT_1PM, bend)
            s = np.minimum(np.maximum(s + np.arctan2(curved * ahead, inward) / curved, low), high)
        ahead, left, _, heading = self._seen_from(s, x_m, y_m)
        return s, np.copysign(np.hypot(ahead, left), left), heading

    def _locate_on_line(
        self, number: int, x_m: FloatArray, y_m: FloatArray, low: float, high: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        piece = self._pieces[number]
        cos, sin = math.cos(piece.heading_rad), math.sin(piece.heading_rad)
        dx, dy = x_m - piece.x_m, y_m - piece.y_m
        along = dx * cos + dy * sin + piece.s_m
        left = dy * cos - dx * sin
        s = np.minimum(np.maximum(along, low), high)
        headings = np.empty(s.shape)
        headings.fill(piece.heading_rad)
        return s, np.copysign(np.hypot(along - s, left), left), headings

    def _seen_from(
        self, s_m: FloatArray, x_m: FloatArray, y_m: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Each point ahead and to the left of the path's pose at its s_m; the curvature and heading there."""
        k = self._piece_at(s_m)
        x, y, heading = self._poses_on(k, s_m)
        cos, sin = np.cos(heading), np.sin(heading)
        dx, dy = x_m - x, y_m - y
        return dx * cos + dy * sin, dy * cos - dx * sin, self._curvature[k], heading

    def speed_limit(self, s_m: float) -> float:
        """The greatest speed at s_m so that every section and bend ahead is entered slowly enough, m/s."""
        place = min(max(s_m, 0.0), self.length_m) / self._speed_step_m
        k = min(int(place), len(self._speed) - 2)
        return self._speed[k] + (place - k) * (self._speed[k + 1] - self._speed[k])

    def _piece_at(self, s_m: FloatArray) -> IntArray:
        return np.maximum(self._s.searchsorted(s_m, side="right") - 1, 0)

    def _check_doubling_back(self, width_m: float) -> None:
        s = np.append(np.arange(0.0, self.length_m, width_m / 4.0), self.length_m)
        x, y, heading = self.poses(s)
        for k in range(len(s)):
            near = np.hypot(x[k:] - x[k], y[k:] - y[k]) < width_m
            turned = np.abs((heading[k:] - heading[k] + math.pi) % (2.0 * math.pi) - math.pi)
            again = np.flatnonzero(near & (turned > _OPPOSED_RAD))
            if not len(again):
                continue
            first, second = s[k], s[k + again[0]]
            raise PathError(
                f"path: doubles back on itself: the robot would sweep the same floor at {first:.1f} m and, "
                f"the other way, at {second:.1f} m; widen the turn to a radius above {width_m / 2:.2f} m"
            )


def _check_bends(spec: PathSpec, robot: Robot) -> None:
    """The inner track must not run backwards, and the yaw rate must leave a speed to drive the bend with."""
    slow_m = _SLOWEST_BEND_MPS / (robot.limits.max_yaw_rate_radps * YAW_RATE_FOR_THE_BEND)
    tightest_m = max(robot.body.width_m / 2.0, slow_m)
    for number, segment in enumerate(spec.segments):
        if isinstance(segment, ArcSpec) and segment.radius_m < tightest_m:
            raise PathError(
                f"path: segments.{number}: radius_m {segment.radius_m:g} is tighter than this robot can "
                f"drive; use at least {tightest_m:.2f} m (its half width, and what its yaw rate allows)"
            )
