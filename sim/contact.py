"""Exact clearance between the robot's rectangle and everything at its height."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from config.robot import Body
from hal.geometry import body_in_floor
from hal.types import FloatArray, PlanarPose
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


def robot_footprint(body: Body, pose: PlanarPose) -> FloatArray:
    """The robot's rectangle (4, 2) on the floor, counter-clockwise, with its turning centre at pose."""
    front, rear, half = body.front_m, -body.rear_m, 0.5 * body.width_m
    corners = np.array([[front, -half, 0.0], [front, half, 0.0], [rear, half, 0.0], [rear, -half, 0.0]])
    return body_in_floor(pose).apply(corners)[:, :2]


def nearest_body(world: World, body: Body, pose: PlanarPose, t_s: float) -> Clearance:
    """The body that is closest to the robot at t_s, or the building's walls.

    Bodies that hang above the robot, or that it may drive over, do not count.
    """
    robot = robot_footprint(body, pose)
    best = Clearance(BUILDING, _room_clearance(world, robot))
    reach = math.hypot(max(body.front_m, body.rear_m), 0.5 * body.width_m)
    in_height = [state for state in world.bodies(t_s) if overlaps_height(body, state)]
    # Gaps between circles around the robot and each body: lower bounds of their distances.
    gaps = [
        math.hypot(state.pose.x_m - pose.x_m, state.pose.y_m - pose.y_m) - state.reach_m - reach
        for state in in_height
    ]
    for index in sorted(range(len(gaps)), key=gaps.__getitem__):
        if gaps[index] >= best.distance_m:
            break
        distance = polygon_distance(robot, in_height[index].footprint_m)
        if distance < best.distance_m:
            best = Clearance(in_height[index].name, distance)
    return best


def overlaps_height(body: Body, state: BodyState) -> bool:
    """Whether a body is at the robot's height: neither entirely above it nor low enough to be driven over."""
    return state.z_m[0] < body.height_m and state.z_m[1] > body.clearance_m


def polygon_distance(a: FloatArray, b: FloatArray) -> float:
    """Distance between convex polygons (K, 2) and (L, 2), counter-clockwise.

    If they overlap: minus the smallest translation that separates them (separating axis theorem).
    """
    separation = max(_separation(a, b), _separation(b, a))
    if separation <= 0.0:
        return separation
    return min(_corner_distance(a, b), _corner_distance(b, a))


def _separation(a: FloatArray, b: FloatArray) -> float:
    """The largest gap over the directions of a's outward normals; negative: overlap in all of them."""
    edges = _sides(a)
    normals = np.stack([edges[:, 1], -edges[:, 0]], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    gaps = (b @ normals.T).min(axis=0) - (a * normals).sum(axis=1)
    return float(gaps.max())


def _corner_distance(corners: FloatArray, polygon: FloatArray) -> float:
    """The smallest distance from any corner (K, 2) to any edge of polygon (L, 2)."""
    edge = _sides(polygon)
    to_corner = corners[:, None] - polygon[None]
    fraction = np.clip((to_corner * edge).sum(axis=2) / (edge * edge).sum(axis=1), 0.0, 1.0)
    offset = to_corner - fraction[:, :, None] * edge
    return float(np.sqrt((offset * offset).sum(axis=2).min()))


def _sides(polygon: FloatArray) -> FloatArray:
    """Vectors (K, 2) from each corner to the next."""
    return np.concatenate([polygon[1:], polygon[:1]]) - polygon


def _room_clearance(world: World, robot: FloatArray) -> float:
    room = world.scenario.room
    low = robot.min(axis=0) - np.array([room.x_min_m, room.y_min_m])
    high = np.array([room.x_max_m, room.y_max_m]) - robot.max(axis=0)
    return float(min(low.min(), high.min()))
