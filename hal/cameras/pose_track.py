"""Camera poses over time, with interpolation."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence

import numpy as np

from hal.clocks import NS_PER_MS
from hal.types import FloatArray, Pose

# Poses further apart than this are not interpolated: the motion between them would be a guess.
_MAX_GAP_NS = 200 * NS_PER_MS
# Below this angle sin(angle) / angle is 1 to the last digit, but the division would be by nearly zero.
_SMALL_ANGLE_RAD = 1e-6


class PoseTrack:
    """OdometrySource: poses of the camera's optical frame in a fixed frame.

    name: where the poses come from.
    stamps_ns: N increasing times.
    positions_m: (N, 3).
    quaternions: (N, 4), qx qy qz qw, of unit length.
    """

    def __init__(
        self, name: str, stamps_ns: Sequence[int], positions_m: FloatArray, quaternions: FloatArray
    ) -> None:
        self.name = name
        self._stamps_ns = stamps_ns
        self._positions_m, self._quaternions = positions_m, quaternions

    def __len__(self) -> int:
        return len(self._stamps_ns)

    def camera_pose(self, stamp_ns: int) -> Pose | None:
        """The pose at stamp_ns, interpolated between its neighbours: position linearly, rotation by slerp.

        None before the first pose, after the last, and between two poses that are too far apart.
        """
        after = bisect_right(self._stamps_ns, stamp_ns)
        if after == 0:
            return None
        before = after - 1
        start_ns = self._stamps_ns[before]
        if start_ns == stamp_ns:
            return self._pose(self._positions_m[before], self._quaternions[before])
        if after == len(self._stamps_ns) or self._stamps_ns[after] - start_ns > _MAX_GAP_NS:
            return None
        fraction = (stamp_ns - start_ns) / (self._stamps_ns[after] - start_ns)
        position_m = (1.0 - fraction) * self._positions_m[before] + fraction * self._positions_m[after]
        return self._pose(position_m, _slerp(self._quaternions[before], self._quaternions[after], fraction))

    @staticmethod
    def _pose(position_m: FloatArray, quaternion: FloatArray) -> Pose:
        return Pose(rotation_matrix(quaternion), position_m.copy())


def rotation_matrix(quaternion: FloatArray) -> FloatArray:
    """The rotation matrix (3, 3) of a unit quaternion (qx, qy, qz, qw)."""
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_of(rotation: FloatArray) -> FloatArray:
    """The quaternion (qx, qy, qz, qw) of a rotation matrix (3, 3).

    It is the eigenvector of the largest eigenvalue of Bar-Itzhack's matrix, which is accurate at every angle.
    """
    r = rotation
    k = np.array(
        [
            [r[0, 0] - r[1, 1] - r[2, 2], 0.0, 0.0, 0.0],
            [r[0, 1] + r[1, 0], r[1, 1] - r[0, 0] - r[2, 2], 0.0, 0.0],
            [r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], r[2, 2] - r[0, 0] - r[1, 1], 0.0],
            [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], r[0, 0] + r[1, 1] + r[2, 2]],
        ]
    )
    vectors: FloatArray = np.linalg.eigh(k / 3.0).eigenvectors
    return vectors[:, -1]


def _slerp(start: FloatArray, end: FloatArray, fraction: float) -> FloatArray:
    """Spherical linear interpolation of unit quaternions (Shoemake), along the shorter arc."""
    cosine = float(start @ end)
    if cosine < 0.0:  # q and -q are the same rotation
        end, cosine = -end, -cosine
    angle_rad = math.acos(min(cosine, 1.0))
    if angle_rad < _SMALL_ANGLE_RAD:
        return start
    mixed = math.sin((1.0 - fraction) * angle_rad) * start + math.sin(fraction * angle_rad) * end
    return mixed / math.sin(angle_rad)
