"""Camera poses of a recording: odometry.txt (dead reckoning) or groundtruth.txt (for evaluation)."""

from __future__ import annotations

import math
from bisect import bisect_right
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from config.camera import OdometryChoice
from hal.cameras.tum_index import content_lines, parse_stamp_ns
from hal.clocks import NS_PER_S
from hal.errors import BadRecording
from hal.types import FloatArray, Pose

_ODOMETRY = "odometry.txt"
_FILE_OF: dict[OdometryChoice, str] = {
    "auto": _ODOMETRY,
    "file": _ODOMETRY,
    "groundtruth": "groundtruth.txt",
}
_COLUMNS = 8
# Files carry four digits and more: a quaternion that is further from unit length than this is
# something else, such as Euler angles or a shifted column.
_UNIT_TOLERANCE = 0.01
# Below this angle sin(angle) / angle is 1 to the last digit but divides by nearly nothing.
_SMALL_ANGLE_RAD = 1e-6


class PoseFile:
    """OdometrySource from lines ``t tx ty tz qx qy qz qw``: the camera optical frame in the world."""

    def __init__(self, path: Path, max_gap_s: float = 0.2) -> None:
        """Raises BadRecording with file and line: not finite, not a unit quaternion, a time twice."""
        self.path = path
        self._max_gap_ns = round(max_gap_s * NS_PER_S)
        rows: dict[int, FloatArray] = {}
        for number, line in content_lines(path):
            try:
                stamp_ns, values = _parse(line)
                if stamp_ns in rows:
                    raise ValueError(f"the time {line.split()[0]} stands here for the second time")
            except ValueError as error:
                raise BadRecording(f"{path}:{number}: {error}; mend or remove the line") from error
            rows[stamp_ns] = values
        if not rows:
            raise BadRecording(f"{path}: holds no pose; each line must be t tx ty tz qx qy qz qw")
        self._stamps_ns = sorted(rows)
        values = np.stack([rows[stamp_ns] for stamp_ns in self._stamps_ns])
        self._positions_m = values[:, :3]
        self._quaternions = values[:, 3:] / np.linalg.norm(values[:, 3:], axis=1, keepdims=True)

    def __len__(self) -> int:
        return len(self._stamps_ns)

    def camera_pose(self, stamp_ns: int) -> Pose | None:
        """Interpolated between the neighbours: position linearly, attitude along the shortest turn.

        None before the first pose, after the last, and between two that are further apart than max_gap_s.
        """
        after = bisect_right(self._stamps_ns, stamp_ns)
        if after == 0:
            return None
        before = after - 1
        start_ns = self._stamps_ns[before]
        if start_ns == stamp_ns:
            return self._pose(self._positions_m[before], self._quaternions[before])
        if after == len(self._stamps_ns) or self._stamps_ns[after] - start_ns > self._max_gap_ns:
            return None
        share = (stamp_ns - start_ns) / (self._stamps_ns[after] - start_ns)
        position_m = (1.0 - share) * self._positions_m[before] + share * self._positions_m[after]
        return self._pose(position_m, _slerp(self._quaternions[before], self._quaternions[after], share))

    @staticmethod
    def _pose(position_m: FloatArray, quaternion: FloatArray) -> Pose:
        return Pose(rotation_matrix(quaternion), position_m.copy())


def open_odometry(folder: Path, choice: OdometryChoice) -> PoseFile | None:
    """The poses of a recording that shall serve as odometry; None for none.

    "auto" takes odometry.txt where the recording has one; "file" asks for it, as "groundtruth" does for
    groundtruth.txt, and raises BadRecording where it is not there.
    """
    if choice == "none":
        return None
    path = folder / _FILE_OF[choice]
    if not path.is_file():
        if choice == "auto":
            return None
        raise BadRecording(f"{path}: there is no such file; choose another odometry, or none")
    return PoseFile(path)


def rotation_matrix(quaternion: FloatArray) -> FloatArray:
    """(qx, qy, qz, qw) of unit length -> (3, 3)."""
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _parse(line: str) -> tuple[int, FloatArray]:
    """Time and (tx, ty, tz, qx, qy, qz, qw). Raises ValueError saying what is wrong."""
    fields = line.split()
    if len(fields) != _COLUMNS:
        raise ValueError(f"has {len(fields)} columns, a pose is t tx ty tz qx qy qz qw")
    stamp_ns = parse_stamp_ns(fields[0])
    try:
        values: NDArray[np.float64] = np.array([float(field) for field in fields[1:]])
    except ValueError:
        raise ValueError(f"holds something that is not a number: {line!r}") from None
    if not np.isfinite(values).all():
        raise ValueError(f"holds a value that is not finite: {line!r}")
    length = float(np.linalg.norm(values[3:]))
    if abs(length - 1.0) > _UNIT_TOLERANCE:
        raise ValueError(f"its quaternion qx qy qz qw has length {length:.3f} instead of 1")
    return stamp_ns, values


def _slerp(start: FloatArray, end: FloatArray, share: float) -> FloatArray:
    """Shoemake's spherical interpolation of unit quaternions, the short way round."""
    cosine = float(start @ end)
    if cosine < 0.0:  # q and -q are the same attitude
        end, cosine = -end, -cosine
    angle_rad = math.acos(min(cosine, 1.0))
    if angle_rad < _SMALL_ANGLE_RAD:
        return start
    mixed = math.sin((1.0 - share) * angle_rad) * start + math.sin(share * angle_rad) * end
    return mixed / math.sin(angle_rad)
