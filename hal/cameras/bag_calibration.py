"""Turns camera_info and transforms of a bag into the calibration that camera.yaml gives for a folder."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import ValidationError

from config.recording import RecordingCamera
from hal.cameras.bag_file import BagFile, Topic
from hal.cameras.bag_realsense import TRANSFORM, depth_unit_topic, reference_of, stream_of
from hal.cameras.bag_topics import BagTopics
from hal.cameras.bag_transforms import StaticTransforms, frame_name
from hal.errors import BadRecording
from hal.types import Pose

_TF_STATIC = "/tf_static"
_DEFAULT_UNITS_PER_M = 1000.0
_BROWN_MODELS = ("plumb_bob", "rational_polynomial", "Brown Conrady")
_MAX_COEFFICIENTS = 5


def read_transforms(bag: BagFile) -> StaticTransforms:
    """The transforms of /tf_static and of RealSense streams. Raises BadRecording."""
    transforms = StaticTransforms()
    stream_topics = [
        topic.name for topic in bag.topics if topic.kind == TRANSFORM and reference_of(topic.name)
    ]
    for topic, message in bag.messages((_TF_STATIC, *stream_topics)):
        try:
            if (streams := reference_of(topic)) is not None:
                transforms.add(*streams, message)
                continue
            for transform in message.transforms:
                transforms.add(
                    frame_name(transform.header.frame_id),
                    frame_name(transform.child_frame_id),
                    transform.transform,
                )
        except ValueError as error:
            raise BadRecording(f"{bag.path}: {topic}: {error}") from error
    return transforms


def read_calibration(
    bag: BagFile, topics: BagTopics, transforms: StaticTransforms
) -> tuple[RecordingCamera, str, tuple[str, ...]]:
    """(calibration, name of the colour camera's frame, notes). Raises BadRecording."""
    if topics.colour_info is None:
        raise BadRecording(
            f"{bag.path}: no camera_info was recorded beside {topics.colour.name}, so its focal length is "
            "not known; record that topic too"
        )
    colour = bag.first(topics.colour_info)
    values: dict[str, Any] = dict(
        zip(("fx", "fy", "cx", "cy"), _pinhole(colour, topics.rectified), strict=True),
        width=int(colour.width),
        height=int(colour.height),
        depth_factor=_depth_factor(bag, topics),
        distortion=() if topics.rectified else _distortion(bag, topics.colour_info, colour),
    )
    frame = _frame_of(colour, topics.colour)
    depth_values, notes = _depth_camera(bag, topics, transforms, colour)
    values |= depth_values
    try:
        return RecordingCamera(**values), frame, notes
    except ValidationError as error:
        details = "; ".join(
            f"{'.'.join(map(str, problem['loc']))}: {problem['msg']}" for problem in error.errors()
        )
        raise BadRecording(
            f"{bag.path}: the calibration in {topics.colour_info} is impossible ({details})"
        ) from error


def _frame_of(info: Any, images: Topic) -> str:
    """The name of the frame in camera_info; for RealSense streams of a .bag, the stream's own name."""
    return frame_name(info.header.frame_id) or stream_of(images.name) or images.name


def _depth_factor(bag: BagFile, topics: BagTopics) -> float:
    """Depth units per metre: millimetres (REP 118), unless a RealSense says otherwise."""
    stream = stream_of(topics.depth.name)
    option = None if stream is None else bag.first(depth_unit_topic(stream))
    if option is None:
        return _DEFAULT_UNITS_PER_M
    try:
        # Rounded, because a float32 of 0.001 reads as 0.0010000000475.
        return round(1.0 / float(option.data), 3)
    except (ValueError, ZeroDivisionError) as error:
        raise BadRecording(f"{bag.path}: {topics.depth.name}: its depth unit is {option.data!r}") from error


def _pinhole(info: Any, rectified: bool) -> tuple[float, float, float, float]:
    """fx, fy, cx, cy: from K, or from P if the images are rectified."""
    if rectified:
        p = _matrix(info, "p")
        return float(p[0]), float(p[5]), float(p[2]), float(p[6])
    k = _matrix(info, "k")
    return float(k[0]), float(k[4]), float(k[2]), float(k[5])


def _matrix(info: Any, name: str) -> Any:
    """A matrix of camera_info; ROS 1 writes its name in capitals."""
    return getattr(info, name) if hasattr(info, name) else getattr(info, name.upper())


def _distortion(bag: BagFile, topic: str, info: Any) -> tuple[float, ...]:
    found = tuple(float(value) for value in _matrix(info, "d"))
    if not any(found):
        return ()
    if info.distortion_model in _BROWN_MODELS and not any(found[_MAX_COEFFICIENTS:]):
        return found[:_MAX_COEFFICIENTS]
    raise BadRecording(
        f"{bag.path}: {topic}: the lens model {info.distortion_model} with {len(found)} coefficients cannot "
        "be used; rectify the images (image_proc) and choose their topic with --colour-topic"
    )


def _depth_camera(
    bag: BagFile, topics: BagTopics, transforms: StaticTransforms, colour: Any
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """(values as in camera.yaml, notes) for depth that is not registered to colour. colour: its
    camera_info."""
    depth = None if topics.depth_info is None else bag.first(topics.depth_info)
    if depth is None:
        if topics.says_registered:
            return {}, ()
        name = topics.depth.name
        return {}, (f"no camera_info was recorded beside {name}: depth is taken as registered to colour",)
    frame, depth_frame = _frame_of(colour, topics.colour), _frame_of(depth, topics.depth)
    if topics.says_registered or depth_frame == frame:
        # Same viewpoint; but the lens or the number of pixels may differ.
        same_size = (depth.width, depth.height) == (colour.width, colour.height)
        if same_size and (topics.says_registered or _same_lens(depth, colour)):
            return {}, ()
        depth_frame = frame
    notes = []
    if any(_matrix(depth, "d")) and not topics.depth_rectified:
        notes.append(f"the lens distortion in {topics.depth_info} is left out: depth lies a little beside")
    in_colour = transforms.find(frame, depth_frame)
    if in_colour is None:
        in_colour = Pose(np.eye(3), np.zeros(3))
        notes.append(
            f"no transform from {depth_frame} to {frame} was recorded: depth and colour are taken as "
            "seen from one place"
        )
    # Some drivers leave P empty.
    rectified = topics.depth_rectified and float(_matrix(depth, "p")[0]) > 0.0
    return _depth_values(depth, _pinhole(depth, rectified), in_colour), tuple(notes)


def _same_lens(depth: Any, colour: Any) -> bool:
    return _pinhole(depth, rectified=False) == _pinhole(colour, rectified=False)


def _depth_values(depth: Any, pinhole: tuple[float, float, float, float], in_colour: Pose) -> dict[str, Any]:
    names = ("depth_fx", "depth_fy", "depth_cx", "depth_cy")
    return dict(
        zip(names, pinhole, strict=True),
        depth_registered=False,
        depth_width=int(depth.width),
        depth_height=int(depth.height),
        depth_to_colour_translation_m=tuple(in_colour.translation_m.tolist()),
        depth_to_colour_rotation=tuple(in_colour.rotation.ravel().tolist()),
    )
