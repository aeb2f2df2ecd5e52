"""A TUM folder as a camera: what comes out of a spoiled one, and of one that is none."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from hal.cameras.recording import SkippedFrame
from hal.cameras.tum_replay import TumReplay
from hal.errors import BadRecording
from tests.support.recordings import (
    colour_files,
    depth_files,
    read_all,
    set_key,
)


def spoil_cut_colour(folder: Path) -> str:
    path = colour_files(folder)[1]
    path.write_bytes(path.read_bytes()[:-30])
    return "is cut off: its end is missing"


def spoil_colour_size(folder: Path) -> str:
    assert cv2.imwrite(str(colour_files(folder)[1]), np.zeros((24, 32, 3), np.uint8))
    return "is 32x24, its calibration says 64x48"


def spoil_colour_kind(folder: Path) -> str:
    assert cv2.imwrite(str(colour_files(folder)[1]), np.zeros((48, 64), np.uint16))
    return "is 16-bit with 1 channel, a colour image has 3 or 4 channels, or 8 bits of grey"


def spoil_colour_gone(folder: Path) -> str:
    colour_files(folder)[1].unlink()
    return "cannot be read (No such file or directory)"


def spoil_depth_kind(folder: Path) -> str:
    assert cv2.imwrite(str(depth_files(folder)[1]), np.zeros((48, 64), np.uint8))
    return "is 8-bit with 1 channel, a depth image has 16 bits and 1 channel"


def spoil_depth_empty(folder: Path) -> str:
    depth_files(folder)[1].write_bytes(b"")
    return "is empty"


@pytest.mark.parametrize("read_ahead", [0, 2])
@pytest.mark.parametrize(
    ("guilty", "spoil"),
    [
        ("rgb/1.033333333.png", spoil_cut_colour),
        ("rgb/1.033333333.png", spoil_colour_size),
        ("rgb/1.033333333.png", spoil_colour_kind),
        ("rgb/1.033333333.png", spoil_colour_gone),
        ("depth/1.033333333.png", spoil_depth_kind),
        ("depth/1.033333333.png", spoil_depth_empty),
    ],
)
def test_a_bad_frame_is_left_out_and_told_and_the_others_come(
    recording: Path,
    guilty: str,
    spoil: Callable[[Path], str],
    read_ahead: int,
    capfd: pytest.CaptureFixture[str],
) -> None:
    reason = spoil(recording)
    replay = TumReplay(recording, read_ahead=read_ahead)
    frames = read_all(replay)
    assert [frame.sequence for frame in frames] == [0, 2, 3]
    assert replay.skipped == (SkippedFrame(guilty, reason),)
    assert capfd.readouterr().err == ""


def test_images_without_partner_are_counted_and_leave_a_gap_in_the_sequence(recording: Path) -> None:
    index = recording / "depth.txt"
    lines = index.read_text().splitlines()
    index.write_text("\n".join([*lines[:2], *lines[3:], "77.0 depth/alone.png"]) + "\n")
    replay = TumReplay(recording)
    assert (replay.unpaired_colour, replay.unpaired_depth) == (1, 1)
    assert "1 colour images without depth of the same time" in replay.notes
    assert "1 depth images without colour of the same time" in replay.notes
    assert [frame.sequence for frame in read_all(replay)] == [0, 2, 3]


def test_the_greatest_gap_between_colour_and_depth_can_be_set(recording: Path) -> None:
    index = recording / "depth.txt"
    lines = [line.split() for line in index.read_text().splitlines()[1:]]
    index.write_text("".join(f"{float(stamp) + 0.015:.9f} {file}\n" for stamp, file in lines))
    assert TumReplay(recording).frame_count == 4
    with pytest.raises(BadRecording, match=r"within 0.005 s of each other; the closest are 0.015 s apart"):
        TumReplay(recording, max_pair_gap_s=0.005)


def test_bad_index_lines_are_told_first_of_all(recording: Path) -> None:
    with (recording / "rgb.txt").open("a") as index:
        index.write("whatever this is\n")
    replay = TumReplay(recording)
    assert [str(bad) for bad in replay.skipped] == ["rgb.txt:6: 'whatever' is not a time in seconds"]
    assert len(read_all(replay)) == 4


def test_times_out_of_order_are_sorted_and_equal_ones_counted(recording: Path) -> None:
    for name in ("rgb.txt", "depth.txt"):
        head, *lines = (recording / name).read_text().splitlines()
        (recording / name).write_text("\n".join([head, *reversed(lines), lines[0]]) + "\n")
    replay = TumReplay(recording)
    stamps_ns = [frame.captured_ns for frame in read_all(replay)]
    assert stamps_ns == sorted(set(stamps_ns))
    assert len(stamps_ns) == 4
    assert replay.duplicates == 2
    assert "2 images with the time of an earlier one, left out" in replay.notes
    assert any(note.endswith("index lines out of time order, sorted") for note in replay.notes)


def test_recording_without_a_usable_frame_is_refused_with_the_first_reason(recording: Path) -> None:
    set_key(recording, "width", "640")
    with (
        TumReplay(recording) as replay,
        pytest.raises(
            BadRecording, match=r"none of the 4 frames is usable.*is 64x48, its calibration says 640x48"
        ),
    ):
        replay.read(0.0)


@pytest.mark.parametrize("name", ["rgb.txt", "depth.txt", "camera.yaml"])
def test_a_missing_file_is_a_bad_recording_that_names_it(recording: Path, name: str) -> None:
    (recording / name).unlink()
    with pytest.raises(BadRecording, match=f"{name} missing; a recording is a folder with"):
        TumReplay(recording)


def test_a_missing_folder_and_a_file_instead_are_bad_recordings(tmp_path: Path) -> None:
    with pytest.raises(BadRecording, match="there is no such folder"):
        TumReplay(tmp_path / "nowhere")
    (tmp_path / "file.bag").write_text("")
    with pytest.raises(BadRecording, match="it is not a folder"):
        TumReplay(tmp_path / "file.bag")


@pytest.mark.parametrize("name", ["rgb.txt", "depth.txt"])
def test_an_index_without_images_is_a_bad_recording(recording: Path, name: str) -> None:
    (recording / name).write_text("# nothing\n")
    with pytest.raises(BadRecording, match=f"{name}: names no image"):
        TumReplay(recording)
    (recording / name).write_text("who knows\n")
    with pytest.raises(BadRecording, match=f"first bad line: {name}:1: 'who' is not a time"):
        TumReplay(recording)


def test_a_mistake_in_camera_yaml_is_told_with_file_key_and_reason(recording: Path) -> None:
    set_key(recording, "fx", "wide")
    with pytest.raises(BadRecording, match=r"camera\.yaml: fx: .*found 'wide'") as caught:
        TumReplay(recording)
    assert "\n" not in str(caught.value)


def test_a_camera_yaml_that_is_no_yaml_is_a_bad_recording(recording: Path) -> None:
    (recording / "camera.yaml").write_text("width: [640\n")
    with pytest.raises(BadRecording, match=r"camera\.yaml: is not valid YAML"):
        TumReplay(recording)


@pytest.mark.parametrize("why", ["above", "itself"])
def test_a_folder_that_may_not_be_read_is_not_called_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, why: str
) -> None:
    def forbidden(_path: Path) -> os.stat_result:
        raise PermissionError

    if why == "above":
        monkeypatch.setattr("hal.cameras.tum_replay.os.stat", forbidden)
    else:
        monkeypatch.setattr("hal.cameras.tum_replay.os.access", lambda *_: False)
    with pytest.raises(BadRecording, match="may not be"):
        TumReplay(tmp_path)
