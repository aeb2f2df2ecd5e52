"""The world of one mission in the plane: the ground truth for camera model, judge and oracle."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from config.app import AppConfig, LockstepRunner
from config.robot import Robot
from controller.decision.camera_limits import CameraLimits
from controller.path.path import Path
from hal.compiled import compiled
from hal.geometry import mount_of
from hal.types import FloatArray, PlanarPose
from sim.contact import body_radius, robot_footprints
from sim.families import Case
from sim.planar import PlanarWorld
from sim.polygons import overlap

_TABLE_STEP_M = 0.02  # of the poses along the path; for the accuracy of Stage.pose()
# Steps along the path in which the robot is tried: it is much longer, so nothing slips through between them.
_SWEEP_STEP_M = 0.05


class Stage:
    """A case with its path and its robot. in_height (N,): whether the robot could touch the body."""

    def __init__(self, case: Case, robot: Robot) -> None:
        self.case, self.robot = case, robot
        self.world = PlanarWorld(case.scenario, case.seed)
        self.path = Path(case.scenario.path, robot)
        low_m, high_m = self.world.z_m[:, 0], self.world.z_m[:, 1]
        self.in_height: NDArray[np.bool_] = (low_m < robot.body.height_m) & (high_m > robot.body.clearance_m)
        s_m = np.arange(0.0, self.path.length_m + 1.0, _TABLE_STEP_M)
        self._pose_table = self.path_poses(s_m)

    def pose(self, s_m: float, d_m: float = 0.0) -> PlanarPose:
        """The path's pose at s_m, moved d_m to its left. From a table, accurate to 1 mm on a radius of 0.1
        m."""
        return PlanarPose(*_interpolated_pose(self._pose_table, s_m / _TABLE_STEP_M, d_m))

    def robot_polygons(self, poses: FloatArray) -> FloatArray:
        """The robot's rectangles (T, 4, 2) at poses (T, 3): x, y, heading."""
        return robot_footprints(self.robot.body, poses)

    def path_poses(self, s_m: FloatArray) -> FloatArray:
        """Poses (T, 3) of the path at s_m (T,)."""
        return np.stack(self.path.poses(s_m), axis=1)

    def blocked(self, times_s: FloatArray) -> list[list[tuple[float, float]]]:
        """For each time, the intervals (from, to) of s in which the robot would touch something."""
        intervals: list[list[tuple[float, float]]] = [[] for _ in times_s]
        s_m = np.arange(0.0, self.path.length_m + _SWEEP_STEP_M, _SWEEP_STEP_M)
        poses = self.path_poses(s_m)
        robot_polygons = self.robot_polygons(poses)
        reach_m = body_radius(self.robot.body)
        for k in np.flatnonzero(self.in_height).tolist():
            moves = bool(self.world.moves[k])
            polygons = self.world.sample(times_s if moves else times_s[:1], k)
            time_index, pose_index = _close_pairs(enclosing_circles(polygons), poses, reach_m)
            if not len(time_index):
                continue
            touching = overlap(robot_polygons[pose_index], polygons[time_index])
            for t, (low, high) in _runs(time_index[touching], pose_index[touching]):
                interval = (s_m[low] - 0.5 * _SWEEP_STEP_M, s_m[high] + 0.5 * _SWEEP_STEP_M)
                for step_intervals in [intervals[t]] if moves else intervals:
                    step_intervals.append(interval)
        return intervals


@compiled("float64[:, :, :]")
def enclosing_circles(polygons: FloatArray) -> FloatArray:
    """Circles (T, 3), centre and radius, that enclose polygons (T, K, 2)."""
    circles = np.empty((len(polygons), 3))
    for t in range(len(polygons)):
        x = y = square = 0.0
        for k in range(polygons.shape[1]):
            x, y = x + polygons[t, k, 0], y + polygons[t, k, 1]
        x, y = x / polygons.shape[1], y / polygons.shape[1]
        for k in range(polygons.shape[1]):
            square = max(square, (polygons[t, k, 0] - x) ** 2 + (polygons[t, k, 1] - y) ** 2)
        circles[t] = x, y, math.sqrt(square)
    return circles


@compiled("float64[:, ::1], float64[:, ::1], float64")
def _close_pairs(
    circles: FloatArray, poses: FloatArray, reach_m: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The pairs of circles (T, 3) and poses (S, 3) whose circle and circle of reach_m overlap: their indices,
    sorted."""
    overlaps, count = np.empty((len(circles), len(poses)), np.bool_), 0
    for t in range(len(circles)):
        square = (reach_m + circles[t, 2]) ** 2
        for s in range(len(poses)):
            dx, dy = circles[t, 0] - poses[s, 0], circles[t, 1] - poses[s, 1]
            overlaps[t, s] = dx * dx + dy * dy < square
            count += overlaps[t, s]
    time_index, pose_index, found = np.empty(count, np.intp), np.empty(count, np.intp), 0
    for t in range(len(circles)):
        for s in range(len(poses)):
            if overlaps[t, s]:
                time_index[found], pose_index[found] = t, s
                found += 1
    return time_index, pose_index


@compiled("float64[:, ::1], float64, float64")
def _interpolated_pose(poses: FloatArray, index: float, d_m: float) -> tuple[float, float, float]:
    """The pose at index, a fractional index of poses (S, 3), moved d_m to its left."""
    # In this order of the arguments of max, NaN becomes a valid index.
    index = min(max(0.0, index), len(poses) - 1.001)
    k = int(index)
    before, step, fraction = poses[k], poses[k + 1] - poses[k], index - k
    heading = before[2] + fraction * step[2]
    return (
        before[0] + fraction * step[0] - d_m * math.sin(heading),
        before[1] + fraction * step[1] + d_m * math.cos(heading),
        heading,
    )


def _runs(time_index: NDArray[np.intp], pose_index: NDArray[np.intp]) -> list[tuple[int, tuple[int, int]]]:
    """Runs of consecutive poses (first, last) for each time. time_index, pose_index: sorted by time,
    then pose."""
    if not len(time_index):
        return []
    breaks = np.flatnonzero((np.diff(time_index) != 0) | (np.diff(pose_index) != 1)) + 1
    firsts, lasts = np.append(0, breaks), np.append(breaks, len(time_index)) - 1
    return [
        (int(time_index[a]), (int(pose_index[a]), int(pose_index[b])))
        for a, b in zip(firsts, lasts, strict=True)
    ]


def sight_limited_speed_mps(config: AppConfig) -> float:
    """The top speed that the camera's range allows with the minimum latency."""
    robot, decision = config.robot, config.decision
    latency_s = 1.0 / config.runner.control_rate_hz + decision.chassis_delay_s
    perception_s = config.runner.perception_latency_s if isinstance(config.runner, LockstepRunner) else 0.0
    by_camera = CameraLimits(decision, robot, mount_of(robot), latency_s)
    return min(by_camera.range_mps(perception_s), robot.limits.max_speed_mps)
