"""Writes frames into a TUM RGB-D folder, which TumReplay and any tool for TUM folders can read."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Self

import cv2
import yaml

from hal.cameras.gyro_file import GYRO_FILE, GYRO_HEADING, gyro_lines
from hal.cameras.pose_track import quaternion_of
from hal.cameras.tum_index import format_stamp
from hal.errors import DeviceRefused
from hal.types import CameraMount, GyroSamples, Pose, RgbdFrame

# zlib's fastest level: a third of the time of the default level, for 10 % more bytes.
_PNG_FAST = (cv2.IMWRITE_PNG_COMPRESSION, 1)
# Any of them makes a folder a recording. One that is left of another recording would pass for a part of this.
_OWN_FILES = ("rgb.txt", "depth.txt", "camera.yaml", "odometry.txt", "groundtruth.txt", GYRO_FILE)


class _AppendFile:
    """A text file to which whole lines are added. They are on their way to the disk at once, so that a
    recording that ends abruptly can still be read.

    length: in bytes.
    """

    def __init__(self, path: Path, heading: str) -> None:
        self.name = path.name
        self.length = 0
        self._file = path.open("wb", buffering=0)
        self.add(heading)

    def add(self, line: str) -> None:
        """Raises OSError; a part of the line may have been written then."""
        remaining = f"{line}\n".encode()
        while remaining:  # a disk that is nearly full takes a part
            remaining = remaining[self._file.write(remaining) :]
        self.length = self._file.tell()

    def truncate_to(self, length: int) -> None:
        """Forget what was added since the file was this long."""
        with suppress(OSError):
            self._file.truncate(length)
            self._file.seek(length)
            self.length = length

    def close(self) -> None:
        """Nothing is kept back that could fail here."""
        with suppress(OSError):
            self._file.close()


class TumWriter:
    """One open recording. Its frames must have the same intrinsics and depth scale, and increasing times."""

    def __init__(self, folder: Path, mount: CameraMount | None = None) -> None:
        self._folder = folder
        self._mount = mount
        self._first: RgbdFrame | None = None
        self._last_ns = -1
        self._odometry: _AppendFile | None = None
        self._gyro: _AppendFile | None = None

    def prepare(self) -> None:
        """Make the folders. Raises DeviceRefused if that fails or if there is a recording already."""
        for name in _OWN_FILES:
            if os.path.exists(self._folder / name):
                raise DeviceRefused(
                    f"{self._folder}: holds a recording already, or a part of one ({name}); "
                    "choose another folder"
                )
        for name in ("rgb", "depth"):
            with self._refusing(name):
                (self._folder / name).mkdir(parents=True, exist_ok=True)

    def __enter__(self) -> Self:
        """Open the files. Raises DeviceRefused as prepare() does, and if the files cannot be made."""
        self.prepare()
        self._colour_index = self._open_file("rgb.txt", "# time of the colour image in seconds, file")
        self._depth_index = self._open_file("depth.txt", "# time of the depth image in seconds, file")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for file in (self._colour_index, self._depth_index, self._odometry, self._gyro):
            if file is not None:
                file.close()

    def write(self, frame: RgbdFrame, odometry: Pose | None = None) -> None:
        """Add one frame, with its gyro. odometry: the camera's pose by dead reckoning at captured_ns, for
        odometry.txt.

        Raises ValueError if the frame does not fit the earlier ones, DeviceRefused if it cannot be written.
        Nothing of it is left then: the indexes name whole files only.
        """
        if self._first is None:
            with self._refusing("camera.yaml"):
                self._write_calibration(frame)
            self._first = frame
        if (frame.intrinsics, frame.depth_scale_m) != (self._first.intrinsics, self._first.depth_scale_m):
            raise ValueError("a recording has one camera: intrinsics or depth scale changed")
        if frame.captured_ns <= self._last_ns:
            raise ValueError(f"frame {frame.sequence} is not later than the one before it")
        self._last_ns = frame.captured_ns
        stamp = format_stamp(frame.captured_ns)
        colour, depth = f"rgb/{stamp}.png", f"depth/{stamp}.png"
        with ExitStack() as rollback:
            self._write_image(colour, frame.colour, rollback)
            self._write_image(depth, frame.depth, rollback)
            if odometry is not None:
                self._add(self._pose_file(), _pose_line(stamp, odometry), rollback)
            self._add_gyro(frame.gyro, rollback)
            self._add(self._colour_index, f"{stamp} {colour}", rollback)
            self._add(self._depth_index, f"{stamp} {depth}", rollback)
            rollback.pop_all()

    def write_gyro(self, samples: GyroSamples) -> None:
        """Add the readings that came with a frame that is not written. Raises DeviceRefused."""
        with ExitStack() as rollback:
            self._add_gyro(samples, rollback)
            rollback.pop_all()

    def _write_image(self, file: str, image: cv2.typing.MatLike, rollback: ExitStack) -> None:
        # Not written by OpenCV, which reports success even if the last bytes did not fit on the disk.
        data = cv2.imencode(".png", image, _PNG_FAST)[1]
        rollback.callback(_remove, self._folder / file)
        with self._refusing(file):
            (self._folder / file).write_bytes(data.tobytes())

    def _add(self, file: _AppendFile, line: str, rollback: ExitStack) -> None:
        rollback.callback(file.truncate_to, file.length)
        with self._refusing(file.name):
            file.add(line)

    def _add_gyro(self, samples: GyroSamples | None, rollback: ExitStack) -> None:
        lines = "" if samples is None else gyro_lines(samples)
        if not lines:
            return
        if self._gyro is None:
            self._gyro = self._open_file(GYRO_FILE, GYRO_HEADING)
        self._add(self._gyro, lines, rollback)

    def _pose_file(self) -> _AppendFile:
        if self._odometry is None:
            self._odometry = self._open_file("odometry.txt", "# camera: time tx ty tz qx qy qz qw")
        return self._odometry

    @contextmanager
    def _refusing(self, file: str) -> Iterator[None]:
        """Turn an OSError, such as a full disk, into DeviceRefused."""
        try:
            yield
        except OSError as error:
            reason = f"cannot be written ({error.strerror}); make room or choose another folder"
            raise DeviceRefused(f"{self._folder / file}: {reason}") from error

    def _open_file(self, name: str, heading: str) -> _AppendFile:
        with self._refusing(name):
            return _AppendFile(self._folder / name, heading)

    def _write_calibration(self, frame: RgbdFrame) -> None:
        k = frame.intrinsics
        content: dict[str, float | int | bool] = {
            "width": k.width,
            "height": k.height,
            "fx": k.fx,
            "fy": k.fy,
            "cx": k.cx,
            "cy": k.cy,
            "depth_factor": 1.0 / frame.depth_scale_m,
            "depth_registered": True,
        }
        if self._mount is not None:
            content["camera_height_m"] = self._mount.height_m
            content["camera_pitch_deg"] = math.degrees(self._mount.pitch_rad)
            content["camera_forward_m"] = self._mount.forward_m
            content["camera_left_m"] = self._mount.left_m
        path = self._folder / "camera.yaml"
        try:
            path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
        except OSError:
            _remove(path)
            raise


def _pose_line(stamp: str, pose: Pose) -> str:
    """A line of odometry.txt."""
    values = (*pose.translation_m.tolist(), *quaternion_of(pose.rotation).tolist())
    return f"{stamp} {' '.join(f'{value:.12f}' for value in values)}"


def _remove(path: Path) -> None:
    with suppress(OSError):
        path.unlink(missing_ok=True)
