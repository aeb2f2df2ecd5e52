"""Camera poses of a recording: odometry.txt (dead reckoning) or groundtruth.txt (for evaluation)."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from config.camera import OdometryChoice
from hal.cameras.pose_track import PoseTrack
from hal.cameras.tum_index import content_lines, parse_stamp_ns
from hal.errors import BadRecording
from hal.types import FloatArray

_ODOMETRY = "odometry.txt"
_FILE_OF: dict[OdometryChoice, str] = {
    "auto": _ODOMETRY,
    "file": _ODOMETRY,
    "groundtruth": "groundtruth.txt",
}
_COLUMNS = 8
# Files have at least four digits. A quaternion that is further than this from unit length is something else,
# such as Euler angles or a shifted column.
_UNIT_TOLERANCE = 0.01


class PoseFile(PoseTrack):
    """Poses from lines ``t tx ty tz qx qy qz qw``: the camera optical frame in the world."""

    def __init__(self, path: Path) -> None:
        """Read the file. Raises BadRecording with file and line if a value is not finite, a quaternion is not
        of unit length, or a time stands there twice."""
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
        stamps_ns = sorted(rows)
        values = np.stack([rows[stamp_ns] for stamp_ns in stamps_ns])
        attitudes = values[:, 3:] / np.linalg.norm(values[:, 3:], axis=1, keepdims=True)
        super().__init__(path.name, stamps_ns, values[:, :3], attitudes)


def open_odometry(folder: Path, choice: OdometryChoice) -> PoseFile | None:
    """The poses of a recording that are used as odometry; None for none.

    "auto" uses odometry.txt if the recording has one. "file" requires odometry.txt and "groundtruth" requires
    groundtruth.txt; they raise BadRecording if the file is missing.
    """
    if choice == "none":
        return None
    path = folder / _FILE_OF[choice]
    if not os.path.isfile(path):
        if choice == "auto":
            return None
        raise BadRecording(f"{path}: there is no such file; choose another odometry, or none")
    return PoseFile(path)


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
