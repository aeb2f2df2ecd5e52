"""Segments a scan into clusters at range jumps. Their middles are the input of the lidar tracker."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controller.evaluation.methods.lidar_scan import Scan
from hal.types import FloatArray

_JUMP_M = 0.25  # least distance between neighbouring points of two clusters
_JUMP_PER_M = 0.02  # what is added to it per metre of range, because of slanted surfaces
_MIN_BEAMS = 4
_MAX_SIZE_M = 1.8  # wider clusters are walls and racks, not people or robots
_MIN_SIZE_M = 0.12


@dataclass(frozen=True, slots=True, eq=False)
class Clusters:
    """N clusters on the sensor's axes (forward, left).

    centre_m: (N, 2).
    size_m: (N,).
    unoccluded: (N,) bool, nothing nearer occludes it at either end. Then its centre does not shift when the
    sensor moves.
    """

    centre_m: FloatArray
    size_m: FloatArray
    unoccluded: FloatArray


def find_clusters(scan: Scan) -> Clusters:
    """All clusters whose size fits a person or a robot."""
    has_return = np.isfinite(scan.range_m)
    index = np.flatnonzero(has_return)
    if len(index) == 0:
        return Clusters(np.empty((0, 2)), np.empty(0), np.empty(0, np.bool_))
    range_m, bearing = scan.range_m[index], scan.bearings_rad[index]
    points = np.stack([range_m * np.cos(bearing), range_m * np.sin(bearing)], axis=1)
    step_m = np.hypot(*np.diff(points, axis=0).T)
    nearer_m = np.minimum(range_m[1:], range_m[:-1])
    is_jump = (step_m > _JUMP_M + _JUMP_PER_M * nearer_m) | (np.diff(index) > 2)
    first = np.concatenate([[0], np.flatnonzero(is_jump) + 1])
    last = np.concatenate([first[1:], [len(index)]]) - 1
    size_m = np.hypot(*(points[last] - points[first]).T)
    fits = (last - first + 1 >= _MIN_BEAMS) & (size_m <= _MAX_SIZE_M) & (size_m >= _MIN_SIZE_M)
    # Occluded if the next beam at an end has a shorter range, or is beyond the field of view.
    padded = np.concatenate([[0.0], scan.range_m, [0.0]])
    occluded = (padded[index[first]] < range_m[first]) | (padded[index[last] + 2] < range_m[last])
    selected = np.flatnonzero(fits)
    centres = np.array(
        [0.5 * (points[first[k] : last[k] + 1].min(axis=0) + points[first[k] : last[k] + 1].max(axis=0))
         for k in selected]
    ).reshape(-1, 2)  # fmt: skip
    return Clusters(centres, size_m[selected], ~occluded[selected])
