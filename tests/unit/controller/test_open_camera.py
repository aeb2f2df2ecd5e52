"""A recording in place of the robot's camera, as the YAML names it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from config.app import load_app
from config.loader import CONFIG_DIR, ConfigError
from controller.build import open_camera
from hal.api import FrameSource
from hal.cameras.tum_writer import TumWriter
from hal.clocks import NS_PER_S, SimulatedClock
from hal.errors import BadRecording
from hal.types import GyroSamples
from tests.support.bags import ALIGNED, COLOUR, COLOUR_FRAME, Entry, Ros, camera_entries, small_bag, write_bag
from tests.support.recordings import small_frame, write_recording

GYROS = (("base", 1.0), ("arm", 2.0))
TOPICS = {"colour_topic": COLOUR, "depth_topic": ALIGNED}


def recorded_camera(
    record: Callable[[Path], Path], folder: Path, clock: SimulatedClock, **keys: str | bool
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


def with_two_gyros(folder: Path) -> Path:
    """Readings of the base turn about x at 1 rad/s, of its arm at 2; both have the axes of the camera."""

    def entries(ros: Ros) -> list[Entry]:
        frames = [small_frame(number) for number in range(4)]
        first_ns = frames[0].captured_ns
        return [
            *(
                (f"/{name}/imu", first_ns, ros.imu(first_ns, COLOUR_FRAME, (rate, 0.0, 0.0)))
                for name, rate in GYROS
            ),
            *camera_entries(ros, frames),
        ]

    return write_bag(folder, "mcap", entries)


def with_gyro(folder: Path) -> Path:
    readings = GyroSamples(np.array([small_frame(0).captured_ns]), np.ones((1, 3)))
    with TumWriter(folder) as writer:
        writer.write(replace(small_frame(0), gyro=readings))
    return folder


@pytest.mark.parametrize(("name", "rate"), GYROS)
def test_the_gyro_of_a_recorded_camera_is_chosen(name: str, rate: float, tmp_path: Path) -> None:
    keys = {"gyro_topic": f"/{name}/imu"}
    with recorded_camera(with_two_gyros, tmp_path, SimulatedClock(), **keys) as camera:
        gyro = camera.read(1.0).gyro
    assert gyro is not None
    assert gyro.rates_radps[:, 0].tolist() == [rate]


@pytest.mark.parametrize("record", [with_gyro, with_two_gyros])
def test_a_recorded_gyro_that_is_not_wanted_is_left_out(
    record: Callable[[Path], Path], tmp_path: Path
) -> None:
    with recorded_camera(record, tmp_path, SimulatedClock(), gyro=False) as camera:
        assert camera.read(1.0).gyro is None


def test_a_recorded_gyro_is_used(tmp_path: Path) -> None:
    with recorded_camera(with_gyro, tmp_path, SimulatedClock()) as camera:
        gyro = camera.read(1.0).gyro
    assert gyro is not None
    assert gyro.rates_radps.tolist() == [[1.0, 1.0, 1.0]]


def test_a_topic_of_a_gyro_that_is_not_wanted_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="gyro_topic has no effect with gyro: false"):
        recorded_camera(with_two_gyros, tmp_path, SimulatedClock(), gyro=False, gyro_topic="/base/imu")
