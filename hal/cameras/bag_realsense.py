"""What is special in bags that librealsense writes, of ROS 1 (.bag, until 2.55) and ROS 2 (.db3, 2.59).

Streams are named /device_0/sensor_1/Color_0, with images below /image/data. In a .bag, four bytes follow each
image (its depth unit, a float; not in an old one), the calibration is in /info/camera_info of the stream, and
/tf/1 of a stream holds where the reference stream stands in it. In both, the sensor has its depth unit among
its options.
"""

from __future__ import annotations

import struct

_DEVICE, _IMAGES = "/device_", "/image/data"
_IMAGE = "sensor_msgs/msg/Image"
_LENGTH = struct.Struct("<I")
# Before the name of the frame, between it and that of the encoding, and from there to the length of the data.
_NUMBER_AND_STAMP, _SIZE, _ORDER_AND_STEP = 12, 8, 5
TRANSFORM = "geometry_msgs/msg/Transform"


def stream_of(topic: str) -> str | None:
    """The stream that an image topic belongs to; None where librealsense did not write it."""
    stream, found, _ = topic.partition(_IMAGES)
    return stream if found and topic.startswith(_DEVICE) else None


def message_of(topic: str, kind: str, data: bytes) -> bytes:
    """The part of a ROS 1 record that is the message. Raises struct.error for one that is too short."""
    if kind != _IMAGE or not stream_of(topic):
        return data
    end = _NUMBER_AND_STAMP
    for then in (_SIZE, _ORDER_AND_STEP, 0):
        end += _LENGTH.size + _LENGTH.unpack_from(data, end)[0] + then
    return data[:end]


def info_topic(stream: str) -> str:
    """The calibration of a .bag's stream."""
    return f"{stream}/info/camera_info"


def depth_unit_topic(stream: str) -> str:
    """The option of a stream's sensor: metres a unit, as a number or as text."""
    return f"{stream.rsplit('/', 1)[0]}/option/Depth_Units/value"


def reference_of(topic: str) -> tuple[str, str] | None:
    """(stream, reference) of a .bag's transform; None for another topic."""
    stream, found, reference = topic.partition("/tf/")
    return (stream, f"reference {reference}") if found and topic.startswith(_DEVICE) else None
