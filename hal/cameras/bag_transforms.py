"""The tree of frames in a bag's static transforms."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np

from hal.cameras.pose_track import rotation_matrix
from hal.types import Pose


class StaticTransforms:
    """The poses of frames relative to each other."""

    def __init__(self) -> None:
        self._edges: dict[str, dict[str, Pose]] = {}

    def add(self, parent: str, child: str, transform: Any) -> None:
        """Add a transform: a geometry_msgs Transform, child in parent. Raises ValueError if it is invalid."""
        t, q = transform.translation, transform.rotation
        quaternion, origin_m = np.array([q.x, q.y, q.z, q.w]), np.array([t.x, t.y, t.z])
        length = float(np.linalg.norm(quaternion))
        if not (length > 0.0 and np.isfinite(length) and np.isfinite(origin_m).all()):
            raise ValueError(f"the transform from {parent} to {child} is impossible")
        pose = Pose(rotation_matrix(quaternion / length), origin_m)
        self._edges.setdefault(parent, {})[child] = pose
        self._edges.setdefault(child, {})[parent] = pose.inverse()

    def find(self, outer: str, inner: str) -> Pose | None:
        """The pose of the inner frame in the outer one, over any frames in between; None if not connected."""
        poses = {outer: Pose(np.eye(3), np.zeros(3))}
        queue = deque([outer])
        while queue and inner not in poses:
            frame = queue.popleft()
            for neighbour, pose in self._edges.get(frame, {}).items():
                if neighbour not in poses:
                    poses[neighbour] = poses[frame] @ pose
                    queue.append(neighbour)
        return poses.get(inner)


def frame_name(name: str) -> str:
    """The name of a frame without the leading slash of ROS 1."""
    return name.lstrip("/")
