"""How fast a path may be driven where: sections, bends, and the slowing down ahead of them."""

from __future__ import annotations

import math

import numpy as np

from config.path import PathSpec
from config.robot import Robot
from controller.braking import comfort, slowing_distance, speed_before_section
from hal.types import FloatArray

_SPEED_STEP_M = 0.05
# The rest is kept for holding the path: tracks slip in yaw by 10 % and more.
YAW_RATE_FOR_THE_BEND = 0.8


def section_speeds(
    spec: PathSpec, robot: Robot, curvature: FloatArray, piece_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Speed over s: what section and bend allow, lowered ahead of each slower one as a comfortable
    braking needs (controller/braking.py)."""
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
        # One grid step early: the step itself may lie anywhere between two grid points.
        distances = s[start - 1] - s[:start]
        slowed = np.flatnonzero(distances <= slowing_distance(top, float(speed[start]), brake))
        for k in slowed:
            reach = speed_before_section(float(distances[k]), float(speed[start]), brake)
            speed[k] = min(speed[k], reach)
    return s, speed
