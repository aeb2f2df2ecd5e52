"""sensor_msgs images to arrays: every encoding, padded rows, foreign byte order, and what is refused."""

from __future__ import annotations

import struct
from typing import Any

import cv2
import numpy as np
import pytest

from hal.cameras.bag_images import colour_image, depth_image
from hal.cameras.image_file import ImageError
from tests.support.bags import Ros

ROS = Ros("mcap")
BGR = np.array([[[10, 20, 30], [40, 50, 60]], [[70, 80, 90], [100, 110, 120]]], np.uint8)
MM = np.array([[0, 1, 1000], [2500, 65535, 300]], np.uint16)


def image(encoding: str, pixels: np.ndarray[Any, Any], padding: int = 0) -> Any:
    return ROS.image(0, "camera", encoding, pixels, padding)


@pytest.mark.parametrize("padding", [0, 5])
@pytest.mark.parametrize(
    ("encoding", "pixels"),
    [
        ("bgr8", BGR),
        ("8UC3", BGR),
        ("rgb8", BGR[..., ::-1]),
        ("bgra8", np.dstack((BGR, np.full((2, 2), 7, np.uint8)))),
        ("rgba8", np.dstack((BGR[..., ::-1], np.full((2, 2), 7, np.uint8)))),
    ],
)
def test_colour_in_any_order_becomes_bgr(encoding: str, pixels: np.ndarray[Any, Any], padding: int) -> None:
    message = image(encoding, pixels, padding)
    found = colour_image(message, 2, 2)
    assert found.tolist() == BGR.tolist()
    assert not np.shares_memory(found, message.data)
    assert found.flags.c_contiguous
    assert found.flags.writeable


def test_grey_becomes_three_equal_channels() -> None:
    assert colour_image(image("mono8", BGR[..., 0]), 2, 2).tolist() == BGR[..., [0, 0, 0]].tolist()


@pytest.mark.parametrize(
    ("encoding", "bytes_of_a_pair"), [("yuv422", (128, 200, 128, 100)), ("yuv422_yuy2", (200, 128, 100, 128))]
)
def test_yuv_is_read_in_the_order_of_its_name(
    encoding: str, bytes_of_a_pair: tuple[int, int, int, int]
) -> None:
    found = colour_image(image(encoding, np.array(bytes_of_a_pair, np.uint8).reshape(1, 2, 2)), 2, 1)
    bright, dark = found[0].astype(int)
    assert np.ptp(bright) <= 2
    assert np.ptp(dark) <= 2
    assert bright[0] > dark[0] + 90


def test_a_row_that_is_shorter_than_its_pixels_is_refused() -> None:
    short = image("bgr8", BGR)
    short.step = 5
    with pytest.raises(ImageError, match="12 bytes in rows of 5, too few for 2x2"):
        colour_image(short, 2, 2)


def test_two_neighbours_that_share_a_colour_are_not_three() -> None:
    with pytest.raises(ImageError, match="is 3 pixels wide, as yuv422 no image can be"):
        colour_image(image("yuv422", np.zeros((2, 3, 2), np.uint8)), 3, 2)


@pytest.mark.parametrize("padding", [0, 2])
@pytest.mark.parametrize("order", ["<", ">"])
def test_depth_in_millimetres_is_taken_as_it_is(order: str, padding: int) -> None:
    message = image("16UC1", MM.astype(f"{order}u2"), padding)
    message.is_bigendian = int(order == ">")
    found = depth_image(message, 3, 2)
    assert found.tolist() == MM.tolist()
    assert found.dtype == np.uint16


def test_depth_in_metres_becomes_millimetres_and_what_is_not_known_zero() -> None:
    metres = np.array([[np.nan, np.inf, -1.0], [1.2344, 70.0, 0.0]], np.float32)
    assert depth_image(image("32FC1", metres), 3, 2).tolist() == [[0, 0, 0], [1234, 0, 0]]


def test_compressed_depth_in_metres_is_unfolded_with_its_quantisation() -> None:
    """compressed_depth writes q = A / z + B, and 0 for what is not known."""
    a, b = 1000.0, 2.0
    folded = np.array([[0, 502], [1002, 252]], np.uint16)
    data = struct.pack("<iff", 0, a, b) + cv2.imencode(".png", folded)[1].tobytes()
    message = ROS.compressed(0, "camera", "32FC1; compressedDepth png", data)
    assert depth_image(message, 2, 2).tolist() == [[0, 2000], [1000, 4000]]


def test_a_jpeg_is_read() -> None:
    data = cv2.imencode(".jpg", np.full((8, 8, 3), 200, np.uint8))[1].tobytes()
    found = colour_image(ROS.compressed(0, "camera", "bgr8; jpeg compressed bgr8", data), 8, 8)
    assert found.astype(int) == pytest.approx(np.full((8, 8, 3), 200), abs=3)


def short(message: Any) -> Any:
    message.data = message.data[:-1]
    return message


@pytest.mark.parametrize(
    ("message", "why"),
    [
        (image("bayer_rggb8", BGR[..., 0]), "has the encoding bayer_rggb8"),
        (image("bgr8", BGR[:1]), "is 2x1, its calibration says 2x2"),
        (short(image("bgr8", BGR)), "holds 11 bytes in rows of 6, too few for 2x2"),
        (ROS.compressed(0, "camera", "bgr8; theora", b"\0\1\2"), "is neither a PNG nor a JPEG"),
    ],
)
def test_a_colour_image_that_cannot_be_used_says_why(message: Any, why: str) -> None:
    with pytest.raises(ImageError, match=why):
        colour_image(message, 2, 2)


@pytest.mark.parametrize(
    ("message", "why"),
    [
        (image("bgr8", BGR), "has the encoding bgr8, a depth image has 16UC1 or 32FC1"),
        (image("16UC1", MM), "is 3x2, its calibration says 2x2"),
        (
            ROS.compressed(0, "camera", "16UC1; compressedDepth rvl", bytes(20)),
            "is compressed as .*rvl",
        ),
        (
            ROS.compressed(
                0, "camera", "32FC1; compressedDepth", cv2.imencode(".png", MM[:, :2])[1].tobytes()
            ),
            "without its quantisation",
        ),
    ],
)
def test_a_depth_image_that_cannot_be_used_says_why(message: Any, why: str) -> None:
    with pytest.raises(ImageError, match=why):
        depth_image(message, 2, 2)
