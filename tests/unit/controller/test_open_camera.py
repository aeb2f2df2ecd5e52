"""A recording in place of the robot's camera, as the YAML names it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from config.app import load_app
from config.loader import CONFIG_DIR
from controller.build import open_camera
from hal.api import FrameSource
from hal.clocks import NS_PER_S, SimulatedClock
from hal.errors import BadRecording
from tests.support.bags import ALIGNED, COLOUR, Entry, Ros, camera_entries, small_bag, write_bag
from tests.support.recordings import small_frame, write_recording

TOPICS = {"colour_topic": COLOUR, "depth_topic": ALIGNED}


def recorded_camera(
    record: Callable[[Path], Path], folder: Path, clock: SimulatedClock, **keys: str
) -> FrameSource:
    (folder / "recorded").mkdir()
    recording = record(folder / "recorded")
    app = yaml.safe_load((CONFIG_DIR / "robot-roboclaw.yaml").read_text())
    app["camera"] = {"kind": "replay", "folder": str(recording.relative_to(folder)), **keys}
    file = folder / "robot.yaml"
    file.write_text(yaml.safe_dump(app))
    return open_camera(load_app(file), clock, lambda _: None, 0)


@pytest.mark.parametrize("record", [write_recording, small_bag])
def test_a_recorded_camera_gives_frames_of_now(record: Callable[[Path], Path], tmp_path: Path) -> None:
    clock = SimulatedClock(7000 * NS_PER_S)
    with recorded_camera(record, tmp_path, clock) as camera:
        frames = [camera.read(1.0) for _ in range(4)]
    assert frames[0].captured_ns == 7000 * NS_PER_S
    assert frames[3].captured_ns == clock.now_ns()
    assert clock.now_ns() == pytest.approx(7000.1 * NS_PER_S, abs=1e6)


def two_cameras(folder: Path) -> Path:
    def entries(ros: Ros) -> list[Entry]:
        front = camera_entries(ros, [small_frame(number) for number in range(4)])
        return [*front, *((topic.replace("/camera/", "/rear/"), t, one) for topic, t, one in front)]

    return write_bag(folder, "mcap", entries)


def test_one_of_two_recorded_cameras_is_chosen(tmp_path: Path) -> None:
    rear = {key: topic.replace("/camera/", "/rear/") for key, topic in TOPICS.items()}
    with recorded_camera(two_cameras, tmp_path, SimulatedClock(), **rear) as camera:
        assert camera.read(1.0).sequence == 0


def test_which_of_two_recorded_cameras_is_asked_for(tmp_path: Path) -> None:
    with pytest.raises(BadRecording, match=r"choose one with --colour-topic \(or camera.colour_topic\)"):
        recorded_camera(two_cameras, tmp_path, SimulatedClock())


def test_a_folder_has_no_topics(tmp_path: Path) -> None:
    with pytest.raises(BadRecording, match="is no ROS bag, so it has no topics"):
        recorded_camera(write_recording, tmp_path, SimulatedClock(), **TOPICS)
