"""Limits by the remembered floor (controller/governor/ground.py): start of an arc, turn in place."""

from __future__ import annotations

import math

import numpy as np

from config.decision import DecisionConfig
from config.robot import Robot
from controller import braking
from controller.decision.bodies import Bodies
from controller.decision.corridor import Corridor
from controller.decision.decision import Reason
from controller.decision.limits import Gap, Limit, Motion, allowed_text, stop_before, stopping_room
from controller.governor.arcs import corner_m
from controller.governor.ground import CELL_M, IN_VIEW_NS, GroundMemory
from controller.path.path import Path
from hal.clocks import NS_PER_S
from hal.types import FloatArray, PlanarPose

_LANES = 9  # points across the corridor
_STEP_M = 0.1  # distance of the points along it
# A turning robot needs up to this time to stop. A mover must not be able to reach it sooner.
_STOP_S = 1.5


class GroundLimits:
    """Limits by the remembered floor.

    turn_memory_s: for how long floor that was seen free counts as free in a turn in place.
    """

    def __init__(
        self, ground: GroundMemory, robot: Robot, config: DecisionConfig, turn_memory_s: float
    ) -> None:
        self._ground, self._config, self._turn_memory_s = ground, config, turn_memory_s
        self._comfort = braking.comfort(robot.limits)
        self._sweep_m = corner_m(robot) + config.margins.lateral_m

    def arc_limits(
        self, corridor: Corridor, s_m: float, to_s_m: float, motion: Motion, now_ns: int
    ) -> list[Limit]:
        """Limits by the corridor's floor up to to_s_m, which is too near for the camera to see.

        It begins at the robot's rear, because the rear swings out in a bend. s_m: the robot's place.
        """
        ground, margins, comfort = self._ground, self._config.margins, self._comfort
        cells = np.arange(s_m - corridor.rear_m + 0.5 * _STEP_M, to_s_m, _STEP_M)
        points = _across(corridor.path, cells, corridor.half_width(cells))
        flat = points.reshape(-1, 2)
        # Surfaces in view are left to the decision, which knows them more precisely than this grid.
        stands = ground.blocked(flat, now_ns, now_ns - IN_VIEW_NS).reshape(len(cells), _LANES).any(axis=1)
        unknown = ground.free(flat).reshape(len(cells), _LANES).mean(axis=1) < self._config.sight.known_share
        found = []
        front_s_m = s_m + corridor.front_m + 0.5 * _STEP_M
        if stands.any():
            gap = Gap(max(float(cells[stands.argmax()]) - front_s_m, 0.0))
            what = "stood when it was last seen,"
            found.append(stop_before(gap, motion, comfort, margins.stop_m, margins.least_m, "depth", what))
        if unknown.any():
            gap = Gap(max(float(cells[unknown.argmax()]) - front_s_m, 0.0))
            room = stopping_room(gap, motion, comfort, margins.least_m)
            sentence = f"the floor of the arc was never seen beyond {gap.distance_m:.1f} m: "
            sentence += allowed_text(room.speed_mps)
            reason = Reason("unseen", sentence, distance_m=gap.distance_m, required_m=room.required_m)
            found.append(Limit(room.speed_mps, lambda: reason))
        return found

    def turn_objection(self, bodies: Bodies, pose: PlanarPose, now_ns: int) -> str:
        """Why the robot must not turn in place at pose; "" if the circle that it sweeps is free."""
        sweep_m = self._sweep_m
        if len(bodies):
            comes = np.hypot(bodies.velocity_mps[:, 0], bodies.velocity_mps[:, 1]) * bodies.moving * _STOP_S
            room = _distance_m(bodies, pose) - comes - sweep_m
            nearest = int(room.argmin())
            if room[nearest] < 0.0:
                return f"obstacle {bodies.ids[nearest]} is too near to turn in place: stop"
        around = _disc(sweep_m)
        points = around + np.array((pose.x_m, pose.y_m))
        sweeps = f"and a turn in place sweeps {sweep_m:.2f} m around: stop"
        stands = self._ground.blocked(points, now_ns)
        if stands.any():
            return f"something stands {_where(around[stands], pose)}, {sweeps}"
        unknown = ~self._ground.free(points, now_ns - round(self._turn_memory_s * NS_PER_S))
        if unknown.any():
            where = _where(around[unknown], pose)
            return f"the floor {where} has not been seen within {self._turn_memory_s:g} s, {sweeps}"
        return ""


def _disc(radius_m: float) -> FloatArray:
    """(P, 2) offsets of points CELL_M apart within radius_m."""
    steps = np.arange(-radius_m, radius_m + CELL_M, CELL_M)
    x, y = np.meshgrid(steps, steps)
    inside = x * x + y * y <= radius_m * radius_m
    return np.stack((x[inside], y[inside]), axis=-1)


def _across(path: Path, s_m: FloatArray, half_m: FloatArray) -> FloatArray:
    """(C, lanes, 2) floor points across the corridor at s_m (C,)."""
    x, y, heading = path.poses(s_m)
    side = half_m[:, None] * np.linspace(-1.0, 1.0, _LANES)
    return np.stack(
        (x[:, None] - np.sin(heading)[:, None] * side, y[:, None] + np.cos(heading)[:, None] * side), axis=-1
    )


def _distance_m(bodies: Bodies, pose: PlanarPose) -> FloatArray:
    """(N,) distance from the centre of rotation to each box."""
    dx, dy = bodies.xy_m[:, 0] - pose.x_m, bodies.xy_m[:, 1] - pose.y_m
    cos, sin = np.cos(bodies.view_rad), np.sin(bodies.view_rad)
    along = np.maximum(np.abs(dx * cos + dy * sin) - bodies.half_view_m, 0.0)
    across = np.maximum(np.abs(dy * cos - dx * sin) - bodies.half_across_m, 0.0)
    distance: FloatArray = np.hypot(along, across)
    return distance


def _where(around_m: FloatArray, pose: PlanarPose) -> str:
    """Where the nearest of these offsets (N, 2) is, in words."""
    k = int(np.hypot(around_m[:, 0], around_m[:, 1]).argmin())
    dx, dy = around_m[k]
    cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    ahead, left = dx * cos + dy * sin, dy * cos - dx * sin
    along = f"{abs(ahead):.1f} m {'ahead' if ahead >= 0.0 else 'behind'}"
    return f"{along} and {abs(left):.1f} m to the {'left' if left >= 0.0 else 'right'}"
