"""Frames on their way to the disk, and a drive whose recording is seen again as it was driven."""

from __future__ import annotations

import errno
import json
import os
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from config.loader import CONFIG_DIR
from controller.mission.command import run_mission
from controller.mission.options import MissionOptions
from controller.record.frame_recorder import FrameRecorder
from controller.replay.command import ReplayOptions, run_replay
from hal.cameras.pose_file import open_odometry
from hal.cameras.tum_replay import TumReplay
from hal.cameras.tum_writer import TumWriter
from hal.errors import DeviceRefused, EndOfStream
from hal.types import GyroSamples, Pose, RgbdFrame
from tests.support.recordings import START_NS, small_frame

SCENARIO = Path(__file__).resolve().parents[3] / "scenarios" / "short_crossing.yaml"


class StuckWriter(TumWriter):
    """Writes nothing until the disk goes on."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.goes_on = threading.Event()
        self.written: list[int] = []
        self.gyro: list[int] = []

    def write_gyro(self, samples: GyroSamples) -> None:
        self.gyro += samples.stamps_ns.tolist()

    def write(self, frame: RgbdFrame, odometry: Pose | None = None) -> None:
        assert self.goes_on.wait(10.0)
        self.written.append(frame.sequence)


def test_frames_are_left_out_and_told_where_the_disk_does_not_keep_up(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with StuckWriter(tmp_path) as writer, FrameRecorder(writer, tmp_path, may_drop=True) as recorder:
        for number in range(25):
            recorder.write(small_frame(number), None)
        writer.goes_on.set()
    assert writer.written == list(range(20))
    assert recorder.dropped == 5
    assert f"{tmp_path}: 5 frames were left out" in capsys.readouterr().err


def test_the_gyro_of_frames_that_are_left_out_is_kept(tmp_path: Path) -> None:
    """Without it, the frames after them would have no gyro."""
    with StuckWriter(tmp_path) as writer, FrameRecorder(writer, tmp_path, may_drop=True) as recorder:
        for number in range(23):
            gyro = GyroSamples(np.array([number]), np.zeros((1, 3)))
            recorder.write(replace(small_frame(number), gyro=gyro), None)
        writer.goes_on.set()
    assert writer.written == list(range(20))
    assert writer.gyro == [20, 21, 22]


def test_no_frame_is_left_out_in_simulated_time(tmp_path: Path) -> None:
    with StuckWriter(tmp_path) as writer, FrameRecorder(writer, tmp_path, may_drop=False) as recorder:
        threading.Timer(0.2, writer.goes_on.set).start()
        for number in range(25):
            recorder.write(small_frame(number), None)
    assert writer.written == list(range(25))
    assert recorder.dropped == 0


def test_the_same_moment_twice_is_one_frame(tmp_path: Path) -> None:
    with TumWriter(tmp_path) as writer, FrameRecorder(writer, tmp_path, may_drop=False) as recorder:
        for number in (0, 0, 1):
            recorder.write(small_frame(number), None)
    assert TumReplay(tmp_path).frame_count == 2


@pytest.fixture
def full(monkeypatch: pytest.MonkeyPatch) -> None:
    def write_bytes(path: Path, data: bytes) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    monkeypatch.setattr(Path, "write_bytes", write_bytes)


@pytest.mark.usefixtures("full")
def test_a_disk_that_is_full_is_told(tmp_path: Path) -> None:
    with (
        pytest.raises(DeviceRefused, match=r"\.png: cannot be written \(No space left on device\)"),
        TumWriter(tmp_path) as writer,
        FrameRecorder(writer, tmp_path, may_drop=False) as recorder,
    ):
        recorder.write(small_frame(0), None)


@pytest.mark.usefixtures("full")
def test_lost_last_frames_are_reported_after_the_drive_has_ended(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Perception ends by an error always: the control process has gone, or the camera's stream."""
    with TumWriter(tmp_path) as writer:
        recorder = FrameRecorder(writer, tmp_path, may_drop=True).__enter__()
        recorder.write(small_frame(0), None)
        recorder.__exit__(EndOfStream, EndOfStream("the last frame"), None)
    assert capsys.readouterr().err.count("cannot be written (No space left on device)") == 1


def test_odometry_comes_back_as_written(tmp_path: Path) -> None:
    turned = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    pose = Pose(turned, np.array([1.25, -2.5, 0.6]))
    with TumWriter(tmp_path) as writer:
        writer.write(small_frame(0), pose)
        writer.write(small_frame(1), None)
    odometry = open_odometry(tmp_path, "file")
    assert odometry is not None
    assert len(odometry) == 1
    read = odometry.camera_pose(START_NS)
    assert read is not None
    assert read.rotation == pytest.approx(pose.rotation, abs=1e-8)
    assert read.translation_m == pytest.approx(pose.translation_m)


def seen(path: Path) -> list[list[dict[str, Any]]]:
    return [json.loads(line)["obstacles"] for line in path.read_text().splitlines()]


def movers(obstacles: list[dict[str, Any]]) -> list[int]:
    return [one["id"] for one in obstacles if one["moving"]]


def test_a_recorded_drive_is_seen_again_as_it_was_driven(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its first two seconds."""
    robot = yaml.safe_load((CONFIG_DIR / "sim.yaml").read_text())
    robot["runner"]["max_duration_s"] = 2.0
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump(robot))
    looks = {key: robot[key] for key in ("robot", "perception", "decision") if key in robot}
    (tmp_path / "replay.yaml").write_text(yaml.safe_dump(looks))
    recording, driven, again = (tmp_path / name for name in ("recording", "driven.jsonl", "again.jsonl"))
    run_mission(
        MissionOptions(
            tmp_path / "robot.yaml",
            scenario=str(SCENARIO),
            observations=driven,
            record=recording,
            quiet=True,
        )
    )
    run_replay(ReplayOptions(recording, "auto", tmp_path / "replay.yaml", again, quiet=True))
    assert "odometry    odometry.txt" in capsys.readouterr().out
    assert len(seen(driven)) > 50
    assert any(obstacle["moving"] for frame in seen(driven) for obstacle in frame)
    for before, after in zip(seen(driven), seen(again), strict=True):
        assert movers(after) == movers(before)
        # Rotations are written as quaternions and come back to some 1e-12: that may decide about a fragment,
        # and whether one more thing that stands is an obstacle of its own.
        assert len({one["id"] for one in after} ^ {one["id"] for one in before}) <= 2
