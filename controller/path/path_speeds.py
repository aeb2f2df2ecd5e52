"""How fast a path may be driven where: sections, bends, and the slowing down ahead of them."""

from __future__ import annotations

import math

import numpy as np

from config.path import PathSpec
from config.robot import Robot
from controller.braking import comfort, slowing_distance, speed_before_section
from hal.types import FloatArray

_SPEED_STEP_M = 0.05
# Share of the robot's yaw rate that a bend may need. The rest is for the path controller: tracks slip in yaw
# by 10 % and more.
YAW_RATE_FOR_THE_BEND = 0.8
_SLOWEST_BEND_MPS = 0.1  # a bend that cannot be driven at this speed is refused


def least_radius_m(robot: Robot) -> float:
    """The tightest bend: in a tighter one the inner track would run backwards, or the yaw rate leaves no
    speed to drive."""
    slow_m = _SLOWEST_BEND_MPS / (robot.limits.max_yaw_rate_radps * YAW_RATE_FOR_THE_BEND)
    return max(robot.body.width_m / 2.0, slow_m)


def section_speeds(
    spec: PathSpec, robot: Robot, curvature: FloatArray, piece_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Speeds over s: what sections and bends allow, and less ahead of slower ones.

    The speed ahead of a slower part is what comfortable braking (controller/braking.py) needs. curvature and
    piece_s: of the pieces, at their beginnings. Returns s in metres and the speeds in m/s, on a regular grid.
    """
    top = robot.limits.max_speed_mps
    brake = comfort(robot.limits)
    yaw = robot.limits.max_yaw_rate_radps * YAW_RATE_FOR_THE_BEND
    length = spec.length_m
    s = np.linspace(0.0, length, max(2, math.ceil(length / _SPEED_STEP_M) + 1))
    ends = np.cumsum([segment.length_m for segment in spec.segments])
    asked = np.array([segment.max_speed_mps or top for segment in spec.segments])
    speed = np.minimum(asked[np.minimum(np.searchsorted(ends, s, side="right"), len(ends) - 1)], top)
    bend = np.abs(curvature[np.searchsorted(piece_s, s, side="right") - 1])
    speed = np.minimum(speed, yaw / np.maximum(bend, yaw / top))
    starts = np.flatnonzero(np.diff(speed) < 0.0) + 1
    for start in starts:
        # Slow down one grid step early: the change may lie anywhere between two grid points.
        distances = s[start - 1] - s[:start]
        slowed = np.flatnonzero(distances <= slowing_distance(top, float(speed[start]), brake))
        for k in slowed:
            reach = speed_before_section(float(distances[k]), float(speed[start]), brake)
            speed[k] = min(speed[k], reach)
    return s, speed
