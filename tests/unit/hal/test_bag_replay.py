"""ROS bags as recordings: frames, times, pairs, and what is wrong with a bag."""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from hal.cameras.bag_file import is_bag
from hal.cameras.bag_replay import BagReplay
from hal.errors import BadRecording, DeviceNotFound
from hal.types import Intrinsics
from tests.support.bags import (
    ALIGNED,
    ALIGNED_INFO,
    COLOUR,
    COLOUR_FRAME,
    COLOUR_INFO,
    FORMATS,
    Entry,
    Format,
    Ros,
    camera_entries,
    small_bag,
    without,
    write_bag,
)
from tests.support.recordings import PERIOD_NS, SMALL, START_NS, read_all, small_frame

RECORDINGS = Path(__file__).resolve().parents[2] / "recordings"
FRAMES = [small_frame(number) for number in range(4)]
_DAMAGE = 16384


@pytest.mark.parametrize("of", FORMATS)
def test_every_format_gives_the_frames_that_were_recorded(of: Format, tmp_path: Path) -> None:
    path = small_bag(tmp_path, of)
    assert is_bag(path)
    replay = BagReplay(path)
    frames = read_all(replay)
    assert [frame.captured_ns for frame in frames] == [frame.captured_ns for frame in FRAMES]
    assert [frame.sequence for frame in frames] == [0, 1, 2, 3]
    for found, recorded in zip(frames, FRAMES, strict=True):
        assert np.array_equal(found.colour, recorded.colour)
        assert np.array_equal(found.depth, recorded.depth)
        assert found.depth_scale_m == 0.001
    assert replay.intrinsics == SMALL
    assert replay.frame_count == 4
    assert replay.fps == pytest.approx(30.0, rel=1e-6)
    assert replay.skipped == ()
    assert replay.notes == (f"colour is {COLOUR}, depth {ALIGNED}",)
    assert replay.odometry is None


def test_the_file_inside_the_folder_is_a_bag_as_well(tmp_path: Path) -> None:
    file = next(small_bag(tmp_path, "mcap").glob("*.mcap"))
    assert is_bag(file)
    assert len(read_all(BagReplay(file))) == 4


@pytest.mark.parametrize("file", ["realsense-2.59.db3", "realsense-2.55.bag"])
def test_recording_of_the_realsense_viewer_is_read(file: str) -> None:
    """Four frames of librealsense's own recorder: depth from a camera of its own, 3 mm further back."""
    replay = BagReplay(RECORDINGS / file)
    frames = read_all(replay)
    assert frames[0].depth_scale_m == 0.001
    assert [frame.colour[0, 0].tolist() for frame in frames] == [[10, 20, 30 + n] for n in range(4)]
    assert [np.unique(frame.depth).tolist() for frame in frames] == [[1003 + n] for n in range(4)]
    assert replay.intrinsics == Intrinsics(64, 48, 60.0, 60.0, 32.0, 24.0)
    assert len(replay.notes) == 1


def test_an_old_realsense_bag_has_nothing_behind_its_images(tmp_path: Path) -> None:
    """The first versions of librealsense did not write the depth unit there."""
    stream = {
        COLOUR: "/device_0/sensor_1/Color_0/image/data",
        COLOUR_INFO: "/device_0/sensor_1/Color_0/info/camera_info",
        ALIGNED: "/device_0/sensor_0/Depth_0/image/data",
        ALIGNED_INFO: "/device_0/sensor_0/Depth_0/info/camera_info",
    }
    path = write_bag(
        tmp_path, "bag", lambda ros: [(stream[topic], t, m) for topic, t, m in camera_entries(ros, FRAMES)]
    )
    replay = BagReplay(path)
    for found, recorded in zip(read_all(replay), FRAMES, strict=True):
        assert np.array_equal(found.depth, recorded.depth)
    assert replay.skipped == ()


def test_a_tum_folder_is_no_bag(tmp_path: Path) -> None:
    assert not is_bag(tmp_path)
    assert not is_bag(tmp_path / "rgb.txt")
    (tmp_path / "metadata.yaml").write_text("room: hall")
    (tmp_path / "rgb.txt").write_text("")
    assert not is_bag(tmp_path)


def test_entering_again_starts_from_the_beginning(tmp_path: Path) -> None:
    replay = BagReplay(small_bag(tmp_path))
    assert [len(read_all(replay)) for _ in range(2)] == [4, 4]


def test_depth_and_colour_of_different_times_are_paired_and_the_rest_is_told(tmp_path: Path) -> None:
    def entries(ros: Ros) -> list[Entry]:
        found = camera_entries(ros, FRAMES)
        late = ros.image(START_NS + 5_000_000, COLOUR_FRAME, "16UC1", FRAMES[0].depth)
        alone = ros.image(START_NS + 20 * PERIOD_NS, COLOUR_FRAME, "bgr8", FRAMES[0].colour)
        again = ros.image(START_NS + PERIOD_NS, COLOUR_FRAME, "bgr8", FRAMES[0].colour)
        found[2] = (ALIGNED, START_NS, late)
        return [
            *found,
            (COLOUR, START_NS + 30 * PERIOD_NS, alone),
            (COLOUR, START_NS + 31 * PERIOD_NS, again),
        ]

    replay = BagReplay(write_bag(tmp_path, "mcap", entries))
    frames = read_all(replay)
    assert [frame.captured_ns for frame in frames] == [frame.captured_ns for frame in FRAMES]
    assert [frame.sequence for frame in frames] == [0, 1, 2, 3]
    assert "1 colour images without depth of the same time" in replay.notes
    assert "1 images not later than the one before, left out" in replay.notes


def test_images_that_are_not_usable_are_told_and_left_out(tmp_path: Path) -> None:
    def entries(ros: Ros) -> list[Entry]:
        found = camera_entries(ros, FRAMES)
        small = ros.image(START_NS + PERIOD_NS, COLOUR_FRAME, "bgr8", np.zeros((24, 32, 3), np.uint8))
        return [
            (topic, t, small if (topic, t) == (COLOUR, START_NS + PERIOD_NS) else m) for topic, t, m in found
        ]

    replay = BagReplay(write_bag(tmp_path, "mcap", entries))
    assert len(read_all(replay)) == 3
    assert [str(one) for one in replay.skipped] == [
        f"{COLOUR} at 1.033333333: is 32x24, its calibration says 64x48"
    ]


def test_a_bag_without_one_usable_frame_is_refused(tmp_path: Path) -> None:
    def entries(ros: Ros) -> list[Entry]:
        late = ros.image(START_NS + 9 * PERIOD_NS, COLOUR_FRAME, "16UC1", FRAMES[0].depth)
        return [*without(camera_entries(ros, FRAMES[:1]), ALIGNED), (ALIGNED, START_NS, late)]

    with pytest.raises(BadRecording, match="not one frame is usable; check the times"):
        read_all(BagReplay(write_bag(tmp_path, "mcap", entries)))


@pytest.mark.parametrize(
    ("of", "told"), [("bag", "is damaged from here on"), ("mcap", "of 40 images cannot be found")]
)
def test_frames_before_a_damage_are_read_and_the_loss_after_it_is_reported(
    of: Format, told: str, tmp_path: Path
) -> None:
    path = small_bag(tmp_path, of, count=20)
    file = path if path.is_file() else next(path.glob("*.mcap"))
    data = bytearray(file.read_bytes())
    middle = len(data) // 2
    data[middle : middle + _DAMAGE] = bytes(_DAMAGE)
    file.write_bytes(data)
    replay = BagReplay(path)
    assert len(read_all(replay)) == pytest.approx(10, abs=1)
    assert told in str(replay.skipped[-1])


def test_a_bag_that_is_damaged_before_its_first_frame_says_what_is_wrong_once(tmp_path: Path) -> None:
    path = small_bag(tmp_path, "bag", count=20)
    replay = BagReplay(path)
    with path.open("r+b") as file:
        file.seek(4300)  # behind the header and its padding
        file.write(bytes(path.stat().st_size // 2))
    with pytest.raises(BadRecording, match=r"frame is usable; (?!the first).*is damaged from here on"):
        read_all(replay)


@pytest.mark.parametrize("of", FORMATS)
def test_a_file_that_is_no_bag_is_refused_in_one_line(of: Format, tmp_path: Path) -> None:
    path = tmp_path / f"notes.{of}"
    path.write_text("not a bag")
    with pytest.raises(BadRecording, match="cannot be read as a ROS bag") as refused:
        BagReplay(path)
    assert "\n" not in str(refused.value)


def test_a_folder_that_was_not_written_to_its_end_is_told_how_to_mend(tmp_path: Path) -> None:
    path = small_bag(tmp_path)
    (path / "metadata.yaml").unlink()
    assert is_bag(path)
    with pytest.raises(
        BadRecording, match=r"metadata file .* does not exist.*mend it with .*ros2 bag reindex"
    ):
        BagReplay(path)


def test_bad_recording_folder_is_reported_in_one_line(tmp_path: Path) -> None:
    path = small_bag(tmp_path)
    (path / "metadata.yaml").write_text("- [")
    with pytest.raises(BadRecording, match="Could not load YAML") as refused:
        BagReplay(path)
    assert "\n" not in str(refused.value)


def test_a_missing_bag_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadRecording, match="there is no such file"):
        BagReplay(tmp_path / "run.mcap")


def test_without_rosbags_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = small_bag(tmp_path)
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    with pytest.raises(DeviceNotFound, match=r"pip install -e '\.\[ros\]'"):
        BagReplay(path)


def test_compressed_images_are_read(tmp_path: Path) -> None:
    def entries(ros: Ros) -> list[Entry]:
        found = without(camera_entries(ros, FRAMES), COLOUR, ALIGNED)
        for frame in FRAMES:
            colour = cv2.imencode(".png", frame.colour)[1].tobytes()
            depth = bytes(12) + cv2.imencode(".png", frame.depth)[1].tobytes()
            t = frame.captured_ns
            found += [
                (
                    f"{COLOUR}/compressed",
                    t,
                    ros.compressed(t, COLOUR_FRAME, "bgr8; png compressed bgr8", colour),
                ),
                (
                    f"{ALIGNED}/compressedDepth",
                    t,
                    ros.compressed(t, COLOUR_FRAME, "16UC1; compressedDepth", depth),
                ),
            ]
        return found

    frames = read_all(BagReplay(write_bag(tmp_path, "mcap", entries)))
    for found, recorded in zip(frames, FRAMES, strict=True):
        assert np.array_equal(found.colour, recorded.colour)
        assert np.array_equal(found.depth, recorded.depth)


def test_how_often_frames_come_is_not_a_matter_of_other_topics(tmp_path: Path) -> None:
    def entries(ros: Ros) -> list[Entry]:
        later = ros.odometry(START_NS, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        return [*camera_entries(ros, FRAMES), ("/odom", START_NS + 9000 * PERIOD_NS, later)]

    assert BagReplay(write_bag(tmp_path, "mcap", entries)).fps == pytest.approx(30.0, rel=1e-6)


def test_rate_of_a_single_image_is_unknown(tmp_path: Path) -> None:
    assert BagReplay(small_bag(tmp_path, count=1)).fps is None
