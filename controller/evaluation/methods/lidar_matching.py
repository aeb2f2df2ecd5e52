"""Scan matching: the sensor's motion between two scans, with the odometry as the first guess.

Point-to-line ICP (Chen and Medioni 1992) with robust weights, so that points on movers have little weight. It
corrects the yaw error of slipping tracks; without it, static objects would seem to rotate about the sensor.
"""

from __future__ import annotations

import math

import numpy as np

from controller.evaluation.methods.lidar_scan import Scan
from hal.types import FloatArray, PlanarPose

_ITERATIONS = 8
_WINDOW = 4  # the corresponding point is searched this many beams to either side
_GATE_M = 0.25  # greatest distance of corresponding points
_CAUCHY_M = 0.05  # residuals above this lose weight (Cauchy)
_MIN_POINTS = 30
# Standard deviation of the odometry within one scan. It decides in directions that the scene leaves open.
_GUESS_SIGMA = np.array([0.01, 0.01, 0.01])  # m, m, rad


def refine(before: Scan, now: Scan, guess: PlanarPose) -> PlanarPose:
    """Pose of the current sensor in the previous one; the guess itself if too few points match."""
    reference = _points(before)
    normals = _normals(reference)
    valid = np.isfinite(now.range_m)
    points = _points(now)[valid]
    pose = np.array([guess.x_m, guess.y_m, guess.heading_rad])
    prior = np.diag(1.0 / np.square(_GUESS_SIGMA))
    start = pose.copy()
    for _ in range(_ITERATIONS):
        moved = _transform(points, pose)
        match, distance_m = _correspondences(moved, reference, before)
        usable = (distance_m <= _GATE_M) & np.isfinite(normals[match]).all(axis=1)
        if np.count_nonzero(usable) < _MIN_POINTS:
            return guess
        normal, matched = normals[match[usable]], moved[usable]
        residual = ((reference[match[usable]] - matched) * normal).sum(axis=1)
        lever = matched - pose[:2]
        rotation_column = normal[:, 1] * lever[:, 0] - normal[:, 0] * lever[:, 1]
        jacobian = np.column_stack([normal, rotation_column])
        weight = 1.0 / (_CAUCHY_M**2 + np.square(residual))
        information = (jacobian * weight[:, None]).T @ jacobian + prior
        gradient = jacobian.T @ (weight * residual) + prior @ (start - pose)
        step = np.linalg.solve(information, gradient)
        pose = pose + step
        if np.abs(step).max() < 1e-5:
            break
    return PlanarPose(float(pose[0]), float(pose[1]), float(pose[2]))


def _points(scan: Scan) -> FloatArray:
    """(N, 2) on the sensor's axes; NaN where a beam has no return."""
    range_m = np.where(np.isfinite(scan.range_m), scan.range_m, np.nan)
    return np.stack([range_m * np.cos(scan.bearings_rad), range_m * np.sin(scan.bearings_rad)], axis=1)


def _normals(points: FloatArray) -> FloatArray:
    """(N, 2) unit normals from the points two beams to either side; NaN at ends, edges and gaps."""
    along = np.full_like(points, np.nan)
    along[2:-2] = points[4:] - points[:-4]
    length = np.hypot(along[:, 0], along[:, 1])
    range_m = np.hypot(points[:, 0], points[:, 1])
    smooth = length < 0.15 + 0.08 * range_m
    unit = along / np.where(smooth & (length > 0.0), length, np.nan)[:, None]
    return np.stack([-unit[:, 1], unit[:, 0]], axis=1)


def _transform(points: FloatArray, pose: FloatArray) -> FloatArray:
    c, s = math.cos(pose[2]), math.sin(pose[2])
    moved: FloatArray = points @ np.array([[c, s], [-s, c]]) + pose[:2]
    return moved


def _correspondences(
    points: FloatArray, reference: FloatArray, scan: Scan
) -> tuple[np.ndarray[tuple[int, ...], np.dtype[np.intp]], FloatArray]:
    """For each of N points, index and distance of the nearest reference point in a window of beams."""
    step_rad = float(scan.bearings_rad[1] - scan.bearings_rad[0])
    bearing = np.arctan2(points[:, 1], points[:, 0])
    middle = np.rint((bearing - scan.bearings_rad[0]) / step_rad).astype(np.intp)
    candidates = np.clip(middle[:, None] + np.arange(-_WINDOW, _WINDOW + 1), 0, len(reference) - 1)
    distance = np.linalg.norm(reference[candidates] - points[:, None], axis=2)
    distance = np.where(np.isfinite(distance), distance, np.inf)
    nearest = np.argmin(distance, axis=1)
    rows = np.arange(len(points))
    return candidates[rows, nearest], distance[rows, nearest]
