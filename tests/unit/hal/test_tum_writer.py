"""What TumWriter writes, TumReplay reads back to the bit."""

from __future__ import annotations

import dataclasses
import errno
import math
import os
from pathlib import Path

import numpy as np
import pytest

from hal.cameras.tum_replay import TumReplay
from hal.cameras.tum_writer import TumWriter, _AppendFile
from hal.errors import DeviceRefused
from hal.types import CameraMount, Pose
from tests.support.recordings import small_frame, write_recording


def test_frames_times_and_calibration_come_back_as_written(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    frames = [
        dataclasses.replace(
            small_frame(number),
            colour=rng.integers(0, 256, (48, 64, 3), dtype=np.uint8),
            depth=rng.integers(0, 65536, (48, 64)).astype(np.uint16),
            captured_ns=1305031236_733922123 + number * 33_333_333,
        )
        for number in range(3)
    ]
    with TumWriter(tmp_path) as writer:
        for frame in frames:
            writer.write(frame)
    with TumReplay(tmp_path) as replay:
        for frame in frames:
            read = replay.read(0.0)
            np.testing.assert_array_equal(read.colour, frame.colour)
            np.testing.assert_array_equal(read.depth, frame.depth)
            assert read.captured_ns == frame.captured_ns
            assert read.depth_scale_m == frame.depth_scale_m
            assert read.intrinsics == frame.intrinsics


def test_the_mount_comes_back(tmp_path: Path) -> None:
    mount = CameraMount(0.45, -0.1, 0.6, math.radians(4.0))
    with TumWriter(tmp_path, mount) as writer:
        writer.write(small_frame(0))
    read = TumReplay(tmp_path).mount
    assert read is not None
    assert (read.forward_m, read.left_m, read.height_m) == (0.45, -0.1, 0.6)
    assert read.pitch_rad == pytest.approx(mount.pitch_rad)


def test_frames_written_before_an_abrupt_end_can_be_read(tmp_path: Path) -> None:
    writer = TumWriter(tmp_path)
    with writer:
        writer.write(small_frame(0))
        assert TumReplay(tmp_path).frame_count == 1


def test_a_folder_that_holds_a_recording_is_not_overwritten(tmp_path: Path) -> None:
    write_recording(tmp_path)
    with pytest.raises(DeviceRefused, match="holds a recording already"):
        TumWriter(tmp_path).__enter__()


@pytest.mark.parametrize("name", ["camera.yaml", "odometry.txt", "groundtruth.txt"])
def test_a_file_that_would_pass_for_a_part_of_the_recording_is_left_alone(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("of another recording")
    with pytest.raises(DeviceRefused, match=rf"a part of one \({name}\); choose another folder"):
        TumWriter(tmp_path).prepare()
    assert (tmp_path / name).read_text() == "of another recording"
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_folder_that_cannot_be_made_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(DeviceRefused, match="cannot be written"):
        TumWriter(tmp_path / "file" / "recording").__enter__()


def test_calibration_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    with TumWriter(tmp_path) as writer:
        (tmp_path / "camera.yaml").mkdir()
        with pytest.raises(DeviceRefused, match=r"camera\.yaml: cannot be"):
            writer.write(small_frame(0))


def test_time_must_go_on_and_the_camera_stay_the_same(tmp_path: Path) -> None:
    with TumWriter(tmp_path) as writer:
        writer.write(small_frame(1))
        with pytest.raises(ValueError, match="not later"):
            writer.write(small_frame(1))
        with pytest.raises(ValueError, match="one camera"):
            writer.write(dataclasses.replace(small_frame(2), depth_scale_m=0.0002))


@pytest.mark.parametrize("fails", ["rgb/", "depth/", "depth.txt", "odometry.txt"])
def test_a_full_disk_leaves_whole_frames_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: str
) -> None:
    """Half of an image, or of a line of an index, was written when the disk was full."""
    whole, full = Path.write_bytes, OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def half_an_image(path: Path, data: bytes) -> int:
        if fails in str(path):
            whole(path, data[: len(data) // 2])
            raise full
        return whole(path, data)

    add = _AppendFile.add

    def half_a_line(lines: _AppendFile, line: str) -> None:
        if lines.name == fails:
            lines._file.write(line.encode()[:7])
            raise full
        add(lines, line)

    pose = Pose(np.eye(3), np.zeros(3))
    with TumWriter(tmp_path) as writer:
        writer.write(small_frame(0), pose)
        with monkeypatch.context() as patched:
            patched.setattr(Path, "write_bytes", half_an_image)
            patched.setattr(_AppendFile, "add", half_a_line)
            with pytest.raises(DeviceRefused, match=f"{fails}.*No space left on device.; make room"):
                writer.write(small_frame(1), pose)
        assert len(list((tmp_path / "rgb").iterdir())) == len(list((tmp_path / "depth").iterdir())) == 1
        writer.write(small_frame(2), pose)  # somebody has made room
    kept = TumReplay(tmp_path)
    assert (kept.frame_count, kept.skipped) == (2, ())
    for name in ("rgb.txt", "depth.txt", "odometry.txt"):
        assert (tmp_path / name).read_text().count("\n") == 3


def test_a_calibration_that_did_not_fit_is_written_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def half(path: Path, text: str, encoding: str) -> int:
        path.write_bytes(text.encode(encoding)[:9])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with TumWriter(tmp_path) as writer:
        with monkeypatch.context() as patched:
            patched.setattr(Path, "write_text", half)
            with pytest.raises(DeviceRefused, match=r"camera\.yaml: cannot be written"):
                writer.write(small_frame(0))
        assert not (tmp_path / "camera.yaml").exists()
        writer.write(small_frame(1))
    assert TumReplay(tmp_path).frame_count == 1
