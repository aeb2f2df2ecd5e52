"""camera_info and transforms of a bag -> the calibration that camera.yaml would give."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import ValidationError

from config.recording import RecordingCamera
from hal.cameras.bag_file import BagFile
from hal.cameras.bag_topics import BagTopics
from hal.cameras.bag_transforms import TF_STATIC, StaticTransforms, frame_name
from hal.errors import BadRecording
from hal.types import Pose

_DEPTH_FACTOR = 1000.0
_BROWN = ("plumb_bob", "rational_polynomial")
_COEFFICIENTS = 5


def read_transforms(bag: BagFile) -> StaticTransforms:
    """All of /tf_static. Raises BadRecording."""
    transforms = StaticTransforms()
    for topic, message in bag.messages((TF_STATIC,)):
        try:
            transforms.add(message)
        except ValueError as error:
            raise BadRecording(f"{bag.path}: {topic}: {error}") from error
    return transforms


def read_calibration(
    bag: BagFile, topics: BagTopics, transforms: StaticTransforms
) -> tuple[RecordingCamera, str, tuple[str, ...]]:
    """(calibration, frame of the colour camera, notes). Raises BadRecording."""
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
        depth_factor=_DEPTH_FACTOR,
        distortion=() if topics.rectified else _distortion(bag, topics.colour_info, colour),
    )
    frame = frame_name(colour.header.frame_id)
    notes: tuple[str, ...] = ()
    depth = None if topics.depth_info is None else bag.first(topics.depth_info)
    if depth is not None and not _registered(topics, colour, depth):
        apart = transforms.find(frame, frame_name(depth.header.frame_id))
        if apart is None:
            notes = (
                f"no transform from {depth.header.frame_id} to {frame} was recorded: depth and colour are "
                "taken as seen from one place",
            )
        values |= _depth_camera(depth, apart or Pose(np.eye(3), np.zeros(3)))
    try:
        return RecordingCamera(**values), frame, notes
    except ValidationError as error:
        told = "; ".join(f"{'.'.join(map(str, one['loc']))}: {one['msg']}" for one in error.errors())
        raise BadRecording(
            f"{bag.path}: the calibration in {topics.colour_info} is impossible ({told})"
        ) from error


def _registered(topics: BagTopics, colour: Any, depth: Any) -> bool:
    return topics.says_registered or frame_name(depth.header.frame_id) == frame_name(colour.header.frame_id)


def _pinhole(info: Any, rectified: bool) -> tuple[float, float, float, float]:
    """fx, fy, cx, cy: of K, or of P where the images are rectified."""
    if rectified:
        p = _matrix(info, "p")
        return float(p[0]), float(p[5]), float(p[2]), float(p[6])
    k = _matrix(info, "k")
    return float(k[0]), float(k[4]), float(k[2]), float(k[5])


def _matrix(info: Any, name: str) -> Any:
    """ROS 1 writes the names of matrices in capitals."""
    return getattr(info, name) if hasattr(info, name) else getattr(info, name.upper())


def _distortion(bag: BagFile, topic: str, info: Any) -> tuple[float, ...]:
    found = tuple(float(value) for value in _matrix(info, "d"))
    if not any(found):
        return ()
    if info.distortion_model in _BROWN and not any(found[_COEFFICIENTS:]):
        return found[:_COEFFICIENTS]
    raise BadRecording(
        f"{bag.path}: {topic}: the lens model {info.distortion_model} with {len(found)} coefficients cannot "
        "be used; rectify the images (image_proc) and choose their topic with --colour-topic"
    )


def _depth_camera(depth: Any, in_colour: Pose) -> dict[str, Any]:
    names = ("depth_fx", "depth_fy", "depth_cx", "depth_cy")
    return dict(
        zip(names, _pinhole(depth, rectified=False), strict=True),
        depth_registered=False,
        depth_width=int(depth.width),
        depth_height=int(depth.height),
        depth_to_colour_translation_m=tuple(in_colour.translation_m.tolist()),
        depth_to_colour_rotation=tuple(in_colour.rotation.ravel().tolist()),
    )
