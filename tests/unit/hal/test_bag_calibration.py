"""Which topics of a bag are meant, and what its camera_info and transforms say of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hal.cameras.bag_calibration import read_transforms
from hal.cameras.bag_file import BagFile
from hal.cameras.bag_replay import BagReplay
from hal.cameras.bag_topics import WantedTopics
from hal.errors import BadRecording
from hal.types import Intrinsics
from tests.support.bags import (
    ALIGNED,
    ALIGNED_INFO,
    COLOUR,
    COLOUR_FRAME,
    COLOUR_INFO,
    DEPTH,
    DEPTH_FRAME,
    DEPTH_INFO,
    Entry,
    Ros,
    camera_entries,
    without,
    write_bag,
)
from tests.support.recordings import SMALL, START_NS, read_all, small_frame

RECORDINGS = Path(__file__).resolve().parents[2] / "recordings"
FRAMES = [small_frame(number) for number in range(4)]


TOP_LEFT = np.zeros((SMALL.height, SMALL.width), np.uint16)
TOP_LEFT[:8, :8] = 1000
WIDE = Intrinsics(SMALL.width, SMALL.height, 0.5 * SMALL.fx, 0.5 * SMALL.fy, SMALL.cx, SMALL.cy)


def other_depth(ros: Ros, info: Any, pixels: np.ndarray[Any, Any] = TOP_LEFT) -> list[Entry]:
    """Depth of a camera that is not colour's. info: its camera_info."""
    image = ros.image(START_NS, info.header.frame_id, "16UC1", pixels)
    return [
        *without(camera_entries(ros, FRAMES[:1]), ALIGNED, ALIGNED_INFO),
        (DEPTH_INFO, START_NS, info),
        (DEPTH, START_NS, image),
    ]


def test_depth_of_its_own_camera_is_registered_with_the_transforms(tmp_path: Path) -> None:
    """The depth camera sits 60 mm right of colour's: at 1 m and 60 px that is 3.6 px."""

    def entries(ros: Ros) -> list[Entry]:
        depth = np.full((SMALL.height, SMALL.width), 1000, np.uint16)
        depth[:, :20] = 0
        image = ros.image(START_NS, DEPTH_FRAME, "16UC1", depth)
        level = (0.0, 0.0, 0.0, 1.0)
        return [
            ("/tf_static", START_NS, ros.transform("camera_link", COLOUR_FRAME, (0.0, 0.01, 0.0), level)),
            ("/tf_static", START_NS, ros.transform("camera_link", DEPTH_FRAME, (0.06, 0.01, 0.0), level)),
            *without(camera_entries(ros, FRAMES[:1]), ALIGNED, ALIGNED_INFO),
            (DEPTH_INFO, START_NS, ros.info(DEPTH_FRAME, SMALL)),
            (DEPTH, START_NS, image),
        ]

    (frame,) = read_all(BagReplay(write_bag(tmp_path, "db3", entries)))
    measured = np.flatnonzero(frame.depth[24])
    assert measured[0] == pytest.approx(20 + 3.6, abs=1.0)
    assert (frame.depth[24, measured] == 1000).all()


def test_names_of_frames_of_ros_1_may_begin_with_a_slash(tmp_path: Path) -> None:
    def entries(ros: Ros) -> list[Entry]:
        still = ros.transform(f"/{COLOUR_FRAME}", f"/{DEPTH_FRAME}", (0.0, 0.0, 0.5), (0.0, 0.0, 0.0, 1.0))
        return [("/tf_static", START_NS, still), *other_depth(ros, ros.info(DEPTH_FRAME, SMALL))]

    (frame,) = read_all(BagReplay(write_bag(tmp_path, "bag", entries)))
    assert set(np.unique(frame.depth)) == {0, 1500}


def test_depth_from_an_unknown_place_is_told(tmp_path: Path) -> None:
    def entries(ros: Ros) -> list[Entry]:
        image = ros.image(START_NS, DEPTH_FRAME, "16UC1", FRAMES[0].depth)
        return [
            *without(camera_entries(ros, FRAMES[:1]), ALIGNED, ALIGNED_INFO),
            (DEPTH_INFO, START_NS, ros.info(DEPTH_FRAME, SMALL)),
            (DEPTH, START_NS, image),
        ]

    replay = BagReplay(write_bag(tmp_path, "mcap", entries))
    assert len(read_all(replay)) == 1
    assert f"no transform from {DEPTH_FRAME} to {COLOUR_FRAME} was recorded" in " ".join(replay.notes)


def test_depth_beyond_the_view_of_colour_is_not_registered(tmp_path: Path) -> None:
    """Simulators name one frame for both: what is in the corner of the wider one is beyond colour's."""
    path = write_bag(tmp_path, "mcap", lambda ros: other_depth(ros, ros.info(COLOUR_FRAME, WIDE)))
    replay = BagReplay(path)
    (frame,) = read_all(replay)
    assert not frame.depth.any()
    assert len(replay.notes) == 1


def test_registered_depth_may_have_fewer_pixels(tmp_path: Path) -> None:
    half = Intrinsics(32, 24, 0.5 * SMALL.fx, 0.5 * SMALL.fy, 0.5 * SMALL.cx, 0.5 * SMALL.cy)
    pixels = np.full((24, 32), 1000, np.uint16)
    path = write_bag(tmp_path, "mcap", lambda ros: other_depth(ros, ros.info(COLOUR_FRAME, half), pixels))
    (frame,) = read_all(BagReplay(path))
    assert np.mean(frame.depth == 1000) > 0.9


def test_rectified_depth_is_of_the_pinhole_that_it_was_rectified_to(tmp_path: Path) -> None:
    def entries(ros: Ros) -> list[Entry]:
        info = ros.info(DEPTH_FRAME, WIDE, (0.1, 0.0, 0.0, 0.0, 0.0))
        info.p[:] = ros.info(DEPTH_FRAME, SMALL).p
        return other_depth(ros, info)

    replay = BagReplay(write_bag(tmp_path, "mcap", entries))
    (frame,) = read_all(replay)
    assert np.flatnonzero(frame.depth[0]).max() == pytest.approx(7, abs=1)
    assert not any("distortion" in note for note in replay.notes)


def test_depth_of_which_nothing_is_known_is_told(tmp_path: Path) -> None:
    path = write_bag(
        tmp_path,
        "mcap",
        lambda ros: without(other_depth(ros, ros.info(DEPTH_FRAME, SMALL)), DEPTH_INFO),
    )
    notes = " ".join(BagReplay(path).notes)
    assert f"no camera_info was recorded beside {DEPTH}: depth is taken as registered" in notes


def test_the_lens_of_depth_that_is_not_straightened_is_told(tmp_path: Path) -> None:
    raw = DEPTH.replace("image_rect_raw", "image_raw")

    def entries(ros: Ros) -> list[Entry]:
        found = other_depth(ros, ros.info(DEPTH_FRAME, SMALL, (-0.3, 0.0, 0.0, 0.0, 0.0)))
        return [(raw if topic == DEPTH else topic, t, one) for topic, t, one in found]

    assert "the lens distortion in" in " ".join(BagReplay(write_bag(tmp_path, "mcap", entries)).notes)


def test_the_lens_is_straightened(tmp_path: Path) -> None:
    """A barrel distortion has pressed a line inwards, and its end more than its middle."""

    def entries(ros: Ros) -> list[Entry]:
        found = camera_entries(ros, [small_frame(n) for n in range(1)])
        painted = np.zeros((SMALL.height, SMALL.width, 3), np.uint8)
        painted[:, 8] = 255
        found[0] = (COLOUR_INFO, START_NS, ros.info(COLOUR_FRAME, SMALL, (-0.3, 0.0, 0.0, 0.0, 0.0)))
        return [*found[:-1], (COLOUR, START_NS, ros.image(START_NS, COLOUR_FRAME, "bgr8", painted))]

    (frame,) = read_all(BagReplay(write_bag(tmp_path, "bag", entries)))
    middle, top = frame.colour[24, :, 0].argmax(), frame.colour[2, :, 0].argmax()
    assert 0 < top < middle < 8


def test_a_lens_with_more_coefficients_than_can_be_straightened_is_refused(tmp_path: Path) -> None:
    def entries(ros: Ros, last: float) -> list[Entry]:
        lens = (0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, last)
        info = ros.info(COLOUR_FRAME, SMALL, lens, "rational_polynomial")
        return [(COLOUR_INFO, START_NS, info), *without(camera_entries(ros, FRAMES[:1]), COLOUR_INFO)]

    with pytest.raises(BadRecording, match="rational_polynomial with 8 coefficients"):
        BagReplay(write_bag(tmp_path, "mcap", lambda ros: entries(ros, 0.3)))
    (tmp_path / "without").mkdir()
    assert read_all(BagReplay(write_bag(tmp_path / "without", "mcap", lambda ros: entries(ros, 0.0))))


def test_rectified_image_is_not_rectified_again(tmp_path: Path) -> None:
    """And it is of the pinhole that it was rectified to."""
    striped = np.zeros((SMALL.height, SMALL.width, 3), np.uint8)
    striped[:, ::4] = 255

    def entries(ros: Ros) -> list[Entry]:
        info = ros.info(COLOUR_FRAME, WIDE, (-0.3, 0.0, 0.0, 0.0, 0.0))
        info.p[:] = ros.info(COLOUR_FRAME, SMALL).p
        rectified = COLOUR.replace("image_raw", "image_rect_color")
        found = without(camera_entries(ros, FRAMES[:1]), COLOUR_INFO, COLOUR)
        image = ros.image(START_NS, COLOUR_FRAME, "bgr8", striped)
        return [(COLOUR_INFO, START_NS, info), *found, (rectified, START_NS, image)]

    replay = BagReplay(write_bag(tmp_path, "mcap", entries))
    (frame,) = read_all(replay)
    assert np.array_equal(frame.colour, striped)
    assert replay.intrinsics == SMALL


def test_without_a_calibration_it_is_refused(tmp_path: Path) -> None:
    path = write_bag(tmp_path, "mcap", lambda ros: without(camera_entries(ros, FRAMES), COLOUR_INFO))
    with pytest.raises(BadRecording, match=f"no camera_info was recorded beside {COLOUR}"):
        BagReplay(path)


def test_an_impossible_calibration_is_refused(tmp_path: Path) -> None:
    def entries(ros: Ros) -> list[Entry]:
        info = ros.info(COLOUR_FRAME, SMALL)
        matrix = info.K if ros.is1 else info.k
        matrix[0] = 0.0
        return [(COLOUR_INFO, START_NS, info), *without(camera_entries(ros, FRAMES), COLOUR_INFO)]

    with pytest.raises(BadRecording, match=r"impossible \(fx: Input should be greater than 0\)"):
        BagReplay(write_bag(tmp_path, "bag", entries))


def test_a_lens_that_cannot_be_straightened_is_refused(tmp_path: Path) -> None:
    def entries(ros: Ros) -> list[Entry]:
        info = ros.info(COLOUR_FRAME, SMALL, (0.1, 0.0, 0.0, 0.0), "equidistant")
        return [(COLOUR_INFO, START_NS, info), *without(camera_entries(ros, FRAMES), COLOUR_INFO)]

    with pytest.raises(BadRecording, match="the lens model equidistant"):
        BagReplay(write_bag(tmp_path, "mcap", entries))


def test_an_impossible_transform_is_refused(tmp_path: Path) -> None:
    def entries(ros: Ros) -> list[Entry]:
        bad = ros.transform("base_link", "camera_link", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))
        return [("/tf_static", START_NS, bad), *camera_entries(ros, FRAMES)]

    with pytest.raises(BadRecording, match="the transform from base_link to camera_link is impossible"):
        BagReplay(write_bag(tmp_path, "mcap", entries))


def test_the_topics_that_are_asked_for_are_taken(tmp_path: Path) -> None:
    def entries(ros: Ros) -> list[Entry]:
        found = camera_entries(ros, FRAMES)
        second = [(topic.replace("/camera/", "/rear/"), t, m) for topic, t, m in found]
        return [*found, *second]

    path = write_bag(tmp_path, "mcap", entries)
    with pytest.raises(BadRecording, match=r"several topics could be the colour: .*--colour-topic"):
        BagReplay(path)
    rear = WantedTopics(COLOUR.replace("/camera/", "/rear/"), ALIGNED.replace("/camera/", "/rear/"))
    replay = BagReplay(path, wanted=rear)
    assert len(read_all(replay)) == 4
    assert replay.notes[0] == f"colour is {rear.colour}, depth {rear.depth}"
    with pytest.raises(BadRecording, match="depth topic /left: there is none"):
        BagReplay(path, wanted=WantedTopics(rear.colour, "/left"))
    with pytest.raises(BadRecording, match="cannot be both colour and depth"):
        BagReplay(path, wanted=WantedTopics(rear.depth, rear.depth))


@pytest.mark.parametrize(
    ("file", "depth", "colour"),
    [
        ("realsense-2.59.db3", "Depth", "Color"),
        ("realsense-2.55.bag", "/device_0/sensor_0/Depth_0", "/device_0/sensor_1/Color_0"),
    ],
)
def test_realsense_bags_say_where_depth_stands_in_colour(file: str, depth: str, colour: str) -> None:
    """As it was given to the recorder: turned by 0.02 rad, moved by (15, 2, 3) mm."""
    with BagFile(RECORDINGS / file) as bag:
        pose = read_transforms(bag).find(colour, depth)
    assert pose is not None
    assert pose.translation_m == pytest.approx([0.015, 0.002, 0.003], abs=1e-6)
    turned = [[0.9998, -0.02, 0.0], [0.02, 0.9998, 0.0], [0.0, 0.0, 1.0]]
    assert pose.rotation == pytest.approx(np.array(turned), abs=1e-5)


def realsense_with(depth_unit: str, folder: Path) -> BagReplay:
    def entries(ros: Ros) -> list[Entry]:
        renamed = {
            ALIGNED: "/device_0/sensor_0/Depth_0/image/data",
            ALIGNED_INFO: "/device_0/sensor_0/Depth_0/image/camera_info",
        }
        unit = ros.make("std_msgs/msg/String", data=depth_unit)
        return [
            ("/device_0/sensor_0/option/Depth_Units/value", START_NS, unit),
            *((renamed.get(topic, topic), t, one) for topic, t, one in camera_entries(ros, FRAMES)),
        ]

    return BagReplay(write_bag(folder, "mcap", entries))


def test_a_realsense_with_a_finer_depth_unit_is_believed(tmp_path: Path) -> None:
    assert read_all(realsense_with("0.000100", tmp_path))[0].depth_scale_m == 0.0001


@pytest.mark.parametrize("unit", ["0.0", "nan", "fine"])
def test_a_depth_unit_that_is_none_is_refused(unit: str, tmp_path: Path) -> None:
    with pytest.raises(BadRecording, match=r"its depth unit is|depth_factor"):
        realsense_with(unit, tmp_path)
