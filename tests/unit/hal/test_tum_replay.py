"""A TUM folder as a camera: what comes out of a good one. Spoiled ones: test_tum_replay_spoiled.py."""

from __future__ import annotations

import math
import threading
from pathlib import Path

import cv2
import numpy as np
import pytest

from hal.cameras.tum_replay import TumReplay
from hal.errors import DeviceRefused, EndOfStream
from hal.types import CameraMount
from tests.support.recordings import (
    PERIOD_NS,
    SMALL,
    START_NS,
    colour_files,
    depth_files,
    read_all,
    set_key,
)


@pytest.mark.parametrize("read_ahead", [0, 1, 2, 64])
def test_gives_every_frame_once_in_order_as_recorded(recording: Path, read_ahead: int) -> None:
    frames = read_all(TumReplay(recording, read_ahead=read_ahead))
    assert [frame.sequence for frame in frames] == [0, 1, 2, 3]
    for number, frame in enumerate(frames):
        assert frame.captured_ns == START_NS + number * PERIOD_NS
        assert frame.device_s == pytest.approx(1.0 + number / 30)
        assert frame.intrinsics == SMALL
        assert frame.depth_scale_m == 0.001
        assert np.all(frame.colour == 10 * number)
        assert np.all(frame.depth == 1000 + number)
        assert frame.gyro is None


def test_knows_its_size_calibration_and_length_before_it_is_opened(recording: Path) -> None:
    replay = TumReplay(recording)
    assert replay.intrinsics == SMALL
    assert replay.frame_count == 4
    assert replay.skipped == ()


def test_the_rate_is_that_of_camera_yaml_or_the_usual_distance_of_the_frames(recording: Path) -> None:
    index = recording / "rgb.txt"
    index.write_text(index.read_text().replace("1.099999999", "1.109999999", 1))
    assert TumReplay(recording).fps == pytest.approx(30.0, rel=1e-6)
    set_key(recording, "fps", "25")
    assert TumReplay(recording).fps == 25
    set_key(recording, "fps", None)
    index.write_text("1.0 rgb/1.000000000.png\n")
    assert TumReplay(recording).fps is None


def test_entering_again_starts_from_the_beginning(recording: Path) -> None:
    colour_files(recording)[1].unlink()
    replay = TumReplay(recording)
    first, second = read_all(replay), read_all(replay)
    assert [frame.sequence for frame in second] == [frame.sequence for frame in first] == [0, 2, 3]
    assert len(replay.skipped) == 1


def test_the_end_is_told_again_and_again(recording: Path) -> None:
    with TumReplay(recording) as replay:
        for _ in range(4):
            replay.read(0.0)
        for _ in range(2):
            with pytest.raises(EndOfStream):
                replay.read(0.0)


def test_leaving_in_the_middle_ends_the_reading_thread(recording: Path) -> None:
    with TumReplay(recording, read_ahead=2) as replay:
        replay.read(0.0)
        assert any("tum-replay" in thread.name for thread in threading.enumerate())
    assert not any("tum-replay" in thread.name for thread in threading.enumerate())
    with pytest.raises(DeviceRefused, match="not open"):
        replay.read(0.0)


def test_the_mount_is_unknown_unless_camera_yaml_gives_a_height(recording: Path) -> None:
    replay = TumReplay(recording)
    assert replay.mount is None
    assert any("camera_height_m" in note for note in replay.notes)
    set_key(recording, "camera_height_m", "0.6")
    set_key(recording, "camera_pitch_deg", "30")
    set_key(recording, "camera_forward_m", "0.45")
    replay = TumReplay(recording)
    assert replay.mount == CameraMount(0.45, 0.0, 0.6, math.radians(30))
    assert replay.notes == ()


def test_keys_without_meaning_are_noted(recording: Path) -> None:
    set_key(recording, "exposure_us", "8000")
    assert any("exposure_us" in note for note in TumReplay(recording).notes)


def test_depth_outside_its_range_is_no_data_and_the_limits_belong_to_it(recording: Path) -> None:
    depth = np.zeros((48, 64), np.uint16)
    depth[0, :6] = [299, 300, 301, 9999, 10000, 10001]
    assert cv2.imwrite(str(depth_files(recording)[0]), depth)
    set_key(recording, "depth_min_m", "0.3")
    set_key(recording, "depth_max_m", "10")
    with TumReplay(recording) as replay:
        assert replay.read(0.0).depth[0, :6].tolist() == [0, 300, 301, 9999, 10000, 0]


def test_a_lower_limit_alone_and_an_upper_limit_alone_work(recording: Path) -> None:
    depth = np.zeros((48, 64), np.uint16)
    depth[0, :3] = [1, 1000, 65535]
    assert cv2.imwrite(str(depth_files(recording)[0]), depth)
    set_key(recording, "depth_min_m", "1")
    with TumReplay(recording) as replay:
        assert replay.read(0.0).depth[0, :3].tolist() == [0, 1000, 65535]
    set_key(recording, "depth_min_m", None)
    set_key(recording, "depth_max_m", "1")
    with TumReplay(recording) as replay:
        assert replay.read(0.0).depth[0, :3].tolist() == [1, 1000, 0]


def test_the_depth_scale_is_the_inverse_of_the_depth_factor(recording: Path) -> None:
    set_key(recording, "depth_factor", "5000.0")
    with TumReplay(recording) as replay:
        assert replay.read(0.0).depth_scale_m == 1 / 5000
