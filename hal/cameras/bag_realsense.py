"""The peculiarities of bags that librealsense writes: ROS 1 (.bag, until 2.55) and ROS 2 (.db3, 2.59).

Streams are named like /device_0/sensor_1/Color_0; their images are in the topic /image/data below that, the
readings of a gyro in /imu/data. The depth unit is an option of the sensor. In a .bag, four more bytes follow
each image (its depth unit, a float; not in old bags), the calibration is in /info/camera_info of the stream,
and /tf/1 of a stream holds the pose of the reference stream in it. In a .db3, /metadata beside the images or
readings holds a text such as "Frame number=1;timestamp_domain=Hardware Clock;timestamp=33.333333;".
"""

from __future__ import annotations

import math
import struct

from hal.clocks import NS_PER_MS

_DEVICE = "/device_"
_DATA = ("/image/data", "/imu/data")
_IMAGE = "sensor_msgs/msg/Image"
_LENGTH = struct.Struct("<I")
# Bytes of a serialised Image before the name of the frame, between that and the name of the encoding, and
# from there to the length of the data.
_BYTES_BEFORE_FRAME_NAME, _BYTES_BEFORE_ENCODING, _BYTES_BEFORE_DATA = 12, 8, 5
TRANSFORM = "geometry_msgs/msg/Transform"
METADATA = "std_msgs/msg/String"


def stream_of(topic: str) -> str | None:
    """The stream that a topic of images or readings belongs to; None if librealsense did not write it."""
    named = _stream_and_data(topic)
    return None if named is None else named[0]


def message_of(topic: str, kind: str, data: bytes) -> bytes:
    """The message in a ROS 1 record, without the bytes that follow an image. Raises struct.error if the
    record is too short."""
    if kind != _IMAGE or not stream_of(topic):
        return data
    end = _BYTES_BEFORE_FRAME_NAME
    for gap_bytes in (_BYTES_BEFORE_ENCODING, _BYTES_BEFORE_DATA, 0):
        end += _LENGTH.size + _LENGTH.unpack_from(data, end)[0] + gap_bytes
    return data[:end]


def info_topic(stream: str) -> str:
    """The topic with the calibration of a stream in a .bag."""
    return f"{stream}/info/camera_info"


def depth_unit_topic(stream: str) -> str:
    """The topic with the depth unit of a stream's sensor: metres per unit, as a number or as text."""
    return f"{stream.rsplit('/', 1)[0]}/option/Depth_Units/value"


def reference_of(topic: str) -> tuple[str, str] | None:
    """(stream, reference) of a topic with a transform in a .bag; None for another topic."""
    stream, found, reference = topic.partition("/tf/")
    return (stream, f"reference {reference}") if found and topic.startswith(_DEVICE) else None


def metadata_topic(topic: str) -> str | None:
    """The topic with the metadata of images or readings; None if librealsense did not write them."""
    named = _stream_and_data(topic)
    return None if named is None else f"{named[0]}{named[1].removesuffix('/data')}/metadata"


def time_in_metadata(text: str) -> tuple[int, str] | None:
    """(time in nanoseconds, the clock that it is of) in the metadata of a .db3; None if there is none."""
    values = dict(pair.split("=", 1) for pair in text.split(";") if "=" in pair)
    try:
        time_ms = float(values["timestamp"])
    except (KeyError, ValueError):
        return None
    return (
        (round(time_ms * NS_PER_MS), values.get("timestamp_domain", "")) if math.isfinite(time_ms) else None
    )


def _stream_and_data(topic: str) -> tuple[str, str] | None:
    for data in _DATA:
        stream, found, _ = topic.partition(data)
        if found and topic.startswith(_DEVICE):
            return stream, data
    return None
