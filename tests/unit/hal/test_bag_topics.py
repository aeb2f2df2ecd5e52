"""Which topics of a bag are taken, as robots name them."""

from __future__ import annotations

from pathlib import Path

import pytest

from hal.cameras.bag_file import Topic
from hal.cameras.bag_topics import BagTopics, WantedTopics, choose_topics
from hal.errors import BadRecording

IMAGE, COMPRESSED, INFO = (f"sensor_msgs/msg/{kind}" for kind in ("Image", "CompressedImage", "CameraInfo"))


def chosen(*names: str, wanted: WantedTopics | None = None) -> BagTopics:
    """By its last part each name is of an image, a compressed one or a camera_info."""
    kinds = {"compressed": COMPRESSED, "compressedDepth": COMPRESSED, "camera_info": INFO}
    topics = [Topic(name, kinds.get(name.rsplit("/", 1)[-1], IMAGE), 1) for name in sorted(names)]
    return choose_topics(Path("run.mcap"), topics, wanted or WantedTopics())


DEPTH = "/camera/depth/image_rect_raw"


@pytest.mark.parametrize(
    ("colour", "others"),
    [
        ("/camera/color/image_raw", ("/camera/infra1/image_rect_raw", "/camera/ir/image_raw")),
        ("/camera/rgb/image_rect_color", ("/camera/rgb/image_raw",)),
        ("/camera/rgb/image_raw", ("/camera/rgb/image_raw/compressed",)),
        ("/camera/rgb/image_raw/compressed", ()),
        ("/camera/colour/image_raw", ("/rear/image_raw",)),
        ("/image_raw", ("/segmentation/label", "/people/mask", "/stereo/disparity")),
    ],
)
def test_colour_is_found_by_its_name(colour: str, others: tuple[str, ...]) -> None:
    assert chosen(colour, DEPTH, *others).colour.name == colour


@pytest.mark.parametrize(
    ("depth", "others"),
    [
        ("/camera/aligned_depth_to_color/image_raw", (DEPTH,)),
        ("/camera/depth_registered/image_raw", ("/camera/depth/image_raw",)),
        ("/camera/depth/image_raw/compressedDepth", ("/camera/depth/image_raw/compressed",)),
        (DEPTH, ("/camera/infra1/image_rect_raw",)),
    ],
)
def test_depth_is_found_by_its_name(depth: str, others: tuple[str, ...]) -> None:
    assert chosen("/camera/color/image_raw", depth, *others).depth.name == depth


def test_depth_that_a_codec_for_pictures_has_spoilt_is_none() -> None:
    with pytest.raises(BadRecording, match="no topic with depth images was found"):
        chosen("/camera/color/image_raw", "/camera/depth/image_raw/compressed")


def test_the_calibration_is_beside_the_images_without_their_transport() -> None:
    found = chosen(
        "/camera/rgb/image_raw/compressed",
        "/camera/rgb/camera_info",
        "/camera/depth/image_raw/compressedDepth",
        "/camera/depth/camera_info",
        "/other/camera_info",
    )
    assert (found.colour_info, found.depth_info) == ("/camera/rgb/camera_info", "/camera/depth/camera_info")


def test_rectified_and_registered_topics_are_known_by_name() -> None:
    found = chosen("/rectangle/rgb/image_rect_color", "/rectangle/depth/image_raw")
    assert (found.rectified, found.depth_rectified, found.says_registered) == (True, False, False)
    assert chosen("/rgb/image_raw", "/depth_registered/image_raw").says_registered


def test_user_must_choose_between_equal_cameras() -> None:
    names = ("/front/color/image_raw", "/front/depth/image_raw", "/rear/color/image_raw")
    with pytest.raises(BadRecording, match=r"colour: /front/.*, /rear/.*; choose one with --colour-topic"):
        chosen(*names)
    rear = WantedTopics(colour="/rear/color/image_raw")
    assert chosen(*names, wanted=rear).colour.name == rear.colour
