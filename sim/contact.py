"""Exact clearance between the robot's rectangle and everything at its height."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from config.robot import Body
from hal.types import FloatArray, PlanarPose
from sim.polygons import separation
from sim.world import BodyState, World

BUILDING = "building"


@dataclass(frozen=True, slots=True)
class Clearance:
    """The nearest body. distance_m: 0 or less is contact, then minus the depth of the overlap."""

    name: str
    distance_m: float

    @property
    def touches(self) -> bool:
        """Whether the robot touches the body."""
        return self.distance_m <= 0.0


def robot_footprints(body: Body, poses: FloatArray) -> FloatArray:
    """Corners (T, 4, 2), counter-clockwise, of a robot with its turning centre at poses (T, 3)."""
    x = np.array([body.front_m, body.front_m, -body.rear_m, -body.rear_m])
    y = 0.5 * body.width_m * np.array([-1.0, 1.0, 1.0, -1.0])
    cos, sin = np.cos(poses[:, 2:3]), np.sin(poses[:, 2:3])
    return np.stack((poses[:, 0:1] + cos * x - sin * y, poses[:, 1:2] + sin * x + cos * y), axis=2)


def robot_footprint(body: Body, pose: PlanarPose) -> FloatArray:
    """The corners (4, 2) for one pose."""
    (corners,) = robot_footprints(body, np.array([[pose.x_m, pose.y_m, pose.heading_rad]]))
    return np.asarray(corners)


def body_radius(body: Body) -> float:
    """The radius of the circle around the turning centre that encloses the robot."""
    return math.hypot(max(body.front_m, body.rear_m), 0.5 * body.width_m)


def nearest_body(world: World, body: Body, pose: PlanarPose, t_s: float) -> Clearance:
    """The body that is closest to the robot at t_s, or the building's walls.

    Bodies that hang above the robot, or that it may drive over, do not count.
    """
    robot = robot_footprint(body, pose)
    best = Clearance(BUILDING, _room_clearance(world, robot))
    reach = body_radius(body)
    in_height = [state for state in world.bodies(t_s) if overlaps_height(body, state)]
    # Gaps between circles around the robot and each body: lower bounds of their distances.
    gaps = [
        math.hypot(state.pose.x_m - pose.x_m, state.pose.y_m - pose.y_m) - state.reach_m - reach
        for state in in_height
    ]
    for index in sorted(range(len(gaps)), key=gaps.__getitem__):
        if gaps[index] >= best.distance_m:
            break
        distance = float(separation(robot[None], in_height[index].footprint_m[None])[0])
        if distance < best.distance_m:
            best = Clearance(in_height[index].name, distance)
    return best


def overlaps_height(body: Body, state: BodyState) -> bool:
    """Whether a body is at the robot's height: neither entirely above it nor low enough to be driven over."""
    return state.z_m[0] < body.height_m and state.z_m[1] > body.clearance_m


def _room_clearance(world: World, robot: FloatArray) -> float:
    room = world.scenario.room
    low = robot.min(axis=0) - np.array([room.x_min_m, room.y_min_m])
    high = np.array([room.x_max_m, room.y_max_m]) - robot.max(axis=0)
    return float(min(low.min(), high.min()))
