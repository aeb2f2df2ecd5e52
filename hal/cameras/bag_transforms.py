"""The tree of frames that a bag's /tf_static spans."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np

from hal.cameras.pose_track import rotation_matrix
from hal.types import Pose

TF_STATIC = "/tf_static"


class StaticTransforms:
    """Where frames stand in each other."""

    def __init__(self) -> None:
        self._seen_from: dict[str, dict[str, Pose]] = {}

    def add(self, message: Any) -> None:
        """A tf2_msgs TFMessage. Raises ValueError for a transform that is none."""
        for one in message.transforms:
            t, q = one.transform.translation, one.transform.rotation
            quaternion, origin_m = np.array([q.x, q.y, q.z, q.w]), np.array([t.x, t.y, t.z])
            length = float(np.linalg.norm(quaternion))
            parent, child = frame_name(one.header.frame_id), frame_name(one.child_frame_id)
            if not (length > 0.0 and np.isfinite(length) and np.isfinite(origin_m).all()):
                raise ValueError(f"the transform from {parent} to {child} is impossible")
            pose = Pose(rotation_matrix(quaternion / length), origin_m)
            self._seen_from.setdefault(parent, {})[child] = pose
            self._seen_from.setdefault(child, {})[parent] = pose.inverse()

    def find(self, outer: str, inner: str) -> Pose | None:
        """The inner frame as the outer one sees it, over whatever lies between; None: they are not linked."""
        poses = {outer: Pose(np.eye(3), np.zeros(3))}
        waiting = deque([outer])
        while waiting and inner not in poses:
            here = waiting.popleft()
            for there, pose in self._seen_from.get(here, {}).items():
                if there not in poses:
                    poses[there] = poses[here] @ pose
                    waiting.append(there)
        return poses.get(inner)


def frame_name(name: str) -> str:
    """ROS 1 began names of frames with a slash."""
    return name.lstrip("/")
