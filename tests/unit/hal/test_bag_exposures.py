"""When images were taken: by their header, or by the metadata of a RealSense viewer."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hal.cameras.bag_exposures import Exposures
from hal.cameras.bag_file import BagFile
from hal.cameras.bag_realsense import metadata_topic, time_in_metadata
from hal.cameras.bag_replay import BagReplay
from hal.errors import BadRecording
from tests.support.bags import (
    ALIGNED,
    ALIGNED_INFO,
    COLOUR,
    COLOUR_INFO,
    Entry,
    Ros,
    camera_entries,
    write_bag,
)
from tests.support.recordings import PERIOD_NS, read_all, small_frame

RECORDINGS = Path(__file__).resolve().parents[2] / "recordings"
COLOUR_STREAM, DEPTH_STREAM = "/device_0/sensor_1/Color_0", "/device_0/sensor_0/Depth_0"
GYRO_STREAM = "/device_0/sensor_2/Gyro_0"
CLOCK = "Hardware Clock"
# The recorder wrote the frames so much later than they were taken, by its own clock.
LATE_NS = [30_000_000, 41_000_000, 33_000_000]


def text(taken_ns: int, clock: str = CLOCK) -> str:
    return f"Frame number=7;timestamp_domain={clock};system_time=0.0;timestamp={taken_ns / 1e6:.6f};Fps=30;"


def viewer_entries(ros: Ros, texts: dict[str, list[str]]) -> list[Entry]:
    """Three frames and six readings of a gyro. texts: of the metadata of a stream, in place of the right
    ones; "" leaves one out."""
    names = {
        COLOUR: f"{COLOUR_STREAM}/image/data",
        COLOUR_INFO: f"{COLOUR_STREAM}/image/camera_info",
        ALIGNED: f"{DEPTH_STREAM}/image/data",
        ALIGNED_INFO: f"{DEPTH_STREAM}/image/camera_info",
    }
    written = [replace(small_frame(n), captured_ns=(n + 5) * PERIOD_NS + LATE_NS[n]) for n in range(3)]
    entries = [(names[topic], at_ns, one) for topic, at_ns, one in camera_entries(ros, written)]
    for k in range(6):
        at_ns = 5 * PERIOD_NS + k * 10_000_000
        entries.append(
            (f"{GYRO_STREAM}/imu/data", at_ns + 1_000_000, ros.imu(at_ns + 1_000_000, "Gyro", (k, 0, 0)))
        )
        about = texts.get(GYRO_STREAM, [text(at_ns)] * 6)
        entries.append((f"{GYRO_STREAM}/imu/metadata", at_ns + 1_000_000, ros.text(about[k])))
    for stream in (COLOUR_STREAM, DEPTH_STREAM):
        about = texts.get(stream, [text((n + 5) * PERIOD_NS) for n in range(3)])
        for n, frame in enumerate(written):
            if about[n]:
                entries.append((f"{stream}/image/metadata", frame.captured_ns, ros.text(about[n])))
    return entries


def viewer_bag(tmp_path: Path, **texts: list[str]) -> Path:
    streams = {"colour": COLOUR_STREAM, "depth": DEPTH_STREAM, "gyro": GYRO_STREAM}
    given = {streams[name]: one for name, one in texts.items()}

    def entries(ros: Ros) -> Sequence[Entry]:
        return viewer_entries(ros, given)

    return write_bag(tmp_path, "db3", entries)


def times_ms(path: Path) -> list[float]:
    return [round((frame.captured_ns - 5 * PERIOD_NS) / 1e6, 3) for frame in read_all(BagReplay(path))]


def test_a_viewer_tells_when_images_were_taken_and_not_only_when_they_were_written(tmp_path: Path) -> None:
    path = viewer_bag(tmp_path)
    assert times_ms(path) == [0.0, 33.333, 66.667]
    assert BagReplay(path).fps == pytest.approx(30.0, rel=1e-3)


def test_the_gyro_of_a_viewer_has_the_time_of_the_camera_and_its_axes(tmp_path: Path) -> None:
    replay = BagReplay(viewer_bag(tmp_path))
    assert replay.gyro is not None
    assert (replay.gyro.name, len(replay.gyro)) == (f"{GYRO_STREAM}/imu/data", 6)
    frames = read_all(replay)
    assert frames[1].gyro is not None
    # Of 20, 30 and 40 ms.
    np.testing.assert_array_equal(frames[1].gyro.rates_radps, [[2, 0, 0], [3, 0, 0], [4, 0, 0]])


def test_an_image_without_metadata_gets_the_time_that_others_took_to_be_written(tmp_path: Path) -> None:
    some = [text(5 * PERIOD_NS), "", text(7 * PERIOD_NS)]
    path = viewer_bag(tmp_path, colour=some, depth=some)
    # It was written 41 ms after it was taken; the others 30 and 33 ms.
    assert times_ms(path) == [0.0, pytest.approx(33.333 + 41.0 - 31.5, abs=1e-3), 66.667]


@pytest.mark.parametrize(
    "odd",
    [
        [text(n * PERIOD_NS, "System Time") for n in range(3)],
        ["timestamp=soon;"] * 3,
        ["timestamp=nan;"] * 3,
        ["Frame number=1;"] * 3,
        [text(5 * PERIOD_NS), text(6 * PERIOD_NS), "?"],
    ],
)
def test_where_streams_have_different_clocks_or_none_the_headers_count(
    odd: list[str], tmp_path: Path
) -> None:
    path = viewer_bag(tmp_path, depth=odd)
    assert times_ms(path) == [30.0, 74.333, 99.667]
    replay = BagReplay(path)
    assert replay.gyro is None
    assert any(
        "another clock than those of the images (Hardware Clock, headers)" in note for note in replay.notes
    )


def test_a_gyro_of_another_clock_is_not_used(tmp_path: Path) -> None:
    replay = BagReplay(viewer_bag(tmp_path, gyro=[text(k, "System Time") for k in range(6)]))
    assert replay.gyro is None
    assert any("(System Time, Hardware Clock)" in note for note in replay.notes)


def damaged(monkeypatch: pytest.MonkeyPatch, stream: str) -> None:
    """Nothing of this stream but its images can be read."""
    read = BagFile.stamped_messages

    def messages(bag: BagFile, names: Collection[str]) -> Iterator[tuple[str, int, Any]]:
        if any(name.startswith(stream) and "image/data" not in name for name in names):
            raise BadRecording("is damaged from here on")
        yield from read(bag, names)

    monkeypatch.setattr(BagFile, "stamped_messages", messages)


def test_where_the_metadata_of_a_stream_are_lost_the_headers_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = viewer_bag(tmp_path)
    damaged(monkeypatch, f"{DEPTH_STREAM}/image/metadata")
    assert times_ms(path) == [30.0, 74.333, 99.667]


def test_a_gyro_of_which_nothing_can_be_read_gives_no_readings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = viewer_bag(tmp_path, gyro=["timestamp=1;"] * 6, colour=["?"] * 3)
    damaged(monkeypatch, GYRO_STREAM)
    replay = BagReplay(path)
    assert replay.gyro is not None
    assert (len(replay.gyro), len(read_all(replay)), replay.gyro.missed) == (0, 3, 3)


def test_the_viewer_s_own_recording(tmp_path: Path) -> None:
    """Its recorder was handed frames of 1000 ms, 1033.33 ms and so on."""
    frames = read_all(BagReplay(RECORDINGS / "realsense-2.59.db3"))
    assert [frame.captured_ns / 1e6 for frame in frames] == pytest.approx([1000.0, 1033.33, 1066.66, 1099.99])


def test_other_bags_have_the_times_of_their_headers() -> None:
    with BagFile(RECORDINGS / "realsense-2.55.bag") as bag:
        times = Exposures(bag, (f"{COLOUR_STREAM}/image/data", f"{DEPTH_STREAM}/image/data"))
    assert times.clock is None
    assert metadata_topic("/camera/color/image_raw") is None


def test_metadata_as_the_viewer_writes_it() -> None:
    assert metadata_topic(f"{COLOUR_STREAM}/image/data/compressed") == f"{COLOUR_STREAM}/image/metadata"
    assert metadata_topic(f"{GYRO_STREAM}/imu/data") == f"{GYRO_STREAM}/imu/metadata"
    line = "Frame number=1;timestamp_domain=System Time;system_time=0.0;timestamp=1033.330000;Actual Fps=30;"
    assert time_in_metadata(line) == (1_033_330_000, "System Time")
    assert time_in_metadata("timestamp=2.5") == (2_500_000, "")
