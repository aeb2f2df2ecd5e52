"""Decodes sensor_msgs Image and CompressedImage into the arrays of an RgbdFrame.

Encodings as in sensor_msgs/image_encodings.hpp; compressed depth as image_transport's compressed_depth
writes it (REP 118: 16UC1 in millimetres, 32FC1 in metres, 0 or NaN = no data).
"""

from __future__ import annotations

import struct
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from hal.cameras.image_file import ImageError, decode_colour, decode_depth, require_size
from hal.types import ColourImage, DepthImage

# Encoding -> (number of channels, conversion to BGR; None: it is BGR already).
_COLOURS: dict[str, tuple[int, int | None]] = {
    "bgr8": (3, None),
    "8UC3": (3, None),
    "rgb8": (3, cv2.COLOR_RGB2BGR),
    "bgra8": (4, cv2.COLOR_BGRA2BGR),
    "8UC4": (4, cv2.COLOR_BGRA2BGR),
    "rgba8": (4, cv2.COLOR_RGBA2BGR),
    "mono8": (1, cv2.COLOR_GRAY2BGR),
    "8UC1": (1, cv2.COLOR_GRAY2BGR),
    "yuv422": (2, cv2.COLOR_YUV2BGR_UYVY),
    "uyvy": (2, cv2.COLOR_YUV2BGR_UYVY),
    "yuv422_yuy2": (2, cv2.COLOR_YUV2BGR_YUY2),
    "yuyv": (2, cv2.COLOR_YUV2BGR_YUY2),
}
# With this many bytes per pixel, two neighbouring pixels share their chrominance.
_YUV422_CHANNELS = 2
_MILLIMETRES, _METRES = ("16UC1", "mono16"), "32FC1"
_MM_PER_M = 1000.0
_PNG_START = b"\x89PNG"
# compressed_depth writes this before its PNG: an enumeration, and the quantisation of 32FC1 (A, B).
_QUANTISATION = struct.Struct("<iff")


def colour_image(message: Any, width: int, height: int) -> ColourImage:
    """Decode colour: (height, width, 3) uint8, BGR, in its own memory. Raises ImageError."""
    if not hasattr(message, "encoding"):
        return decode_colour(bytes(message.data), width, height)
    require_size(message.width, message.height, width, height)
    if message.encoding not in _COLOURS:
        raise ImageError(f"has the encoding {message.encoding}, none of {', '.join(_COLOURS)}")
    channels, to_bgr = _COLOURS[message.encoding]
    pixels = _pixel_array(message, np.dtype(np.uint8), channels)
    if to_bgr is None:
        return pixels.copy()
    if channels == _YUV422_CHANNELS and width % 2:
        raise ImageError(f"is {width} pixels wide, as {message.encoding} no image can be")
    return np.asarray(cv2.cvtColor(np.ascontiguousarray(pixels), to_bgr), np.uint8)


def depth_image(message: Any, width: int, height: int) -> DepthImage:
    """Decode depth: (height, width) uint16, in millimetres (REP 118) or the camera's own unit, in its own
    memory. Raises ImageError."""
    if not hasattr(message, "encoding"):
        return _compressed_depth(message, width, height)
    require_size(message.width, message.height, width, height)
    order = ">" if message.is_bigendian else "<"
    if message.encoding in _MILLIMETRES:
        return _pixel_array(message, np.dtype(f"{order}u2"), 1)[..., 0].astype(np.uint16)
    if message.encoding == _METRES:
        return _in_millimetres(_pixel_array(message, np.dtype(f"{order}f4"), 1)[..., 0])
    raise ImageError(f"has the encoding {message.encoding}, a depth image has 16UC1 or 32FC1")


def _pixel_array(message: Any, pixel_dtype: np.dtype[Any], channels: int) -> NDArray[Any]:
    """The pixels (height, width, channels) of a message, whose rows may be padded. May share its memory."""
    data = np.asarray(message.data, np.uint8)
    row = message.width * channels * pixel_dtype.itemsize
    if message.step < row or data.size < message.step * message.height:
        raise ImageError(
            f"holds {data.size} bytes in rows of {message.step}, too few for {message.width}x{message.height}"
        )
    rows = data[: message.step * message.height].reshape(message.height, message.step)[:, :row]
    return np.ascontiguousarray(rows).view(pixel_dtype).reshape(message.height, message.width, channels)


def _in_millimetres(metres: NDArray[Any]) -> DepthImage:
    """Convert metres to millimetres. Not finite, negative or too far for 16 bits: no data."""
    with np.errstate(invalid="ignore"):
        mm = np.rint(metres.astype(np.float32) * np.float32(_MM_PER_M))
        known = (mm > 0.0) & (mm <= np.iinfo(np.uint16).max)
    return np.where(known, mm, 0.0).astype(np.uint16)


def _compressed_depth(message: Any, width: int, height: int) -> DepthImage:
    data = bytes(message.data)
    start = data.find(_PNG_START, 0, _QUANTISATION.size + len(_PNG_START))
    if start < 0:
        raise ImageError(f"is compressed as {message.format!r}; of compressed depth, PNG can be read")
    image = decode_depth(data[start:], width, height)
    if not message.format.startswith(_METRES):
        return image
    if start != _QUANTISATION.size:
        raise ImageError("is compressed depth in metres without its quantisation")
    _, a, b = _QUANTISATION.unpack_from(data)
    with np.errstate(divide="ignore", invalid="ignore"):
        return _in_millimetres(np.where(image > 0, a / (image - np.float32(b)), 0.0))
