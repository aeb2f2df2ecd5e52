"""The gyro in a bag: which topic it is, and how it is turned to the colour camera."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from hal.cameras.bag_replay import BagReplay
from hal.cameras.bag_topics import WantedTopics
from hal.errors import BadRecording
from tests.support.bags import COLOUR_FRAME, FORMATS, Entry, Format, Ros, camera_entries, small_bag, write_bag
from tests.support.recordings import PERIOD_NS, START_NS, read_all, small_frame

FRAMES = [small_frame(number) for number in range(3)]
GYRO, GYRO_FRAME = "/camera/gyro/sample", "camera_gyro_frame"
# The axes of a body, x ahead and z up, seen from optical axes, z ahead and y down.
BODY_AXES = (0.5, -0.5, 0.5, 0.5)


def readings(ros: Ros, topic: str = GYRO, frame: str = GYRO_FRAME, x_radps: float = 0.1) -> list[Entry]:
    """Two readings a frame, in the axes of a body: x_radps about x, 0.2 about y, 0.3 about z."""
    stamps_ns = [START_NS + k * PERIOD_NS // 2 for k in range(6)]
    return [(topic, at_ns, ros.imu(at_ns, frame, (x_radps, 0.2, 0.3))) for at_ns in stamps_ns]


def turned(ros: Ros, frame: str = GYRO_FRAME) -> Entry:
    return ("/tf_static", START_NS, ros.transform(COLOUR_FRAME, frame, (0.1, 0.0, 0.0), BODY_AXES))


@pytest.mark.parametrize("of", FORMATS)
def test_the_gyro_comes_with_the_frames_in_the_axes_of_the_camera(of: Format, tmp_path: Path) -> None:
    bag = write_bag(tmp_path, of, lambda ros: [turned(ros), *readings(ros), *camera_entries(ros, FRAMES)])
    replay = BagReplay(bag)
    assert replay.gyro is not None
    assert (replay.gyro.name, len(replay.gyro)) == (GYRO, 6)
    for _ in range(2):  # entering again starts from the beginning
        frames = read_all(replay)
        counts = [0 if frame.gyro is None else len(frame.gyro.stamps_ns) for frame in frames]
        assert counts == [2, 2, 2]
    gyro = frames[1].gyro
    assert gyro is not None
    # About the camera's x axis the body's -y, about its y axis -z, about its z axis x.
    np.testing.assert_allclose(gyro.rates_radps, [[-0.2, -0.3, 0.1]] * 2, atol=1e-12)


def test_a_gyro_that_is_not_wanted_is_left_out(tmp_path: Path) -> None:
    bag = write_bag(tmp_path, "mcap", lambda ros: [turned(ros), *readings(ros), *camera_entries(ros, FRAMES)])
    replay = BagReplay(bag, use_gyro=False)
    assert replay.gyro is None
    assert all(frame.gyro is None for frame in read_all(replay))
    assert BagReplay(small_bag(tmp_path, "db3")).gyro is None


def bag_of(tmp_path: Path, *names: str, with_tf: bool = True) -> Path:
    """A bag with the readings of these topics; those of topic k are k about x."""

    def entries(ros: Ros) -> Sequence[Entry]:
        found = [one for k, name in enumerate(names) for one in readings(ros, name, x_radps=k)]
        return [*([turned(ros)] if with_tf else []), *found, *camera_entries(ros, FRAMES)]

    return write_bag(tmp_path, "mcap", entries)


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (("/imu/data", "/camera/accel/sample", "/camera/gyro/sample"), "/camera/gyro/sample"),
        (("/camera/imu", "/camera/gyro/sample"), "/camera/gyro/sample"),
        (("/imu/gyro", "/camera/imu"), "/camera/imu"),
        (("/imu/data", "/camera/accel/sample"), "/imu/data"),
    ],
)
def test_the_gyro_of_the_camera_is_preferred(names: tuple[str, ...], expected: str, tmp_path: Path) -> None:
    replay = BagReplay(bag_of(tmp_path, *names))
    assert replay.gyro is not None
    assert replay.gyro.name == expected


def test_an_accelerometer_is_no_gyro(tmp_path: Path) -> None:
    assert BagReplay(bag_of(tmp_path, "/camera/accel/sample")).gyro is None


def test_where_several_could_be_meant_none_is_used_unless_one_is_chosen(tmp_path: Path) -> None:
    bag = bag_of(tmp_path, "/imu/data", "/imu/data_raw")
    replay = BagReplay(bag)
    assert replay.gyro is None
    note = "several topics could be the gyro: /imu/data, /imu/data_raw; choose one with --gyro-topic"
    assert note in replay.notes
    chosen = BagReplay(bag, wanted=WantedTopics(gyro="/imu/data_raw")).gyro
    assert chosen is not None
    assert chosen.name == "/imu/data_raw"
    with pytest.raises(
        BadRecording, match=r"gyro topic /imu: there is none; there are /imu/data, /imu/data_"
    ):
        BagReplay(bag, wanted=WantedTopics(gyro="/imu"))


def test_a_gyro_whose_axes_are_not_known_is_not_used(tmp_path: Path) -> None:
    bag = bag_of(tmp_path, GYRO, with_tf=False)
    why = f"how {GYRO_FRAME} is turned to {COLOUR_FRAME} was not recorded"
    replay = BagReplay(bag)
    assert replay.gyro is None
    assert any(note.startswith("the gyro is not used: ") and why in note for note in replay.notes)
    with pytest.raises(BadRecording, match=why):
        BagReplay(bag, wanted=WantedTopics(gyro=GYRO))


@pytest.mark.parametrize(("x_radps", "why"), [(np.nan, "readings that are not finite"), (0.1, "no angular")])
def test_readings_that_are_none_are_not_used(x_radps: float, why: str, tmp_path: Path) -> None:
    def entries(ros: Ros) -> Sequence[Entry]:
        found = readings(ros, x_radps=x_radps)
        if why.startswith("no "):
            for _, _, message in found:
                message.angular_velocity_covariance[0] = -1.0
        return [turned(ros), *found, *camera_entries(ros, FRAMES)]

    replay = BagReplay(write_bag(tmp_path, "mcap", entries))
    assert replay.gyro is None
    assert any(why in note for note in replay.notes)
