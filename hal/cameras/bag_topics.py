"""Chooses the topics of a bag for colour, depth, their calibration and the odometry (gyro: bag_gyro.py)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from hal.cameras.bag_file import Topic
from hal.cameras.bag_realsense import info_topic, stream_of
from hal.errors import BadRecording

_IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
_CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
_ODOMETRY = "nav_msgs/msg/Odometry"
_TRANSPORTS = ("/compressed", "/compressedDepth")
_COLOUR_WORDS = ("color", "colour", "rgb")
_NO_COLOUR_WORDS = ("depth", "infra", "/ir", "mask", "label", "disparity", "confidence")
_REGISTERED_WORDS = ("aligned", "registered")
_RECTIFIED = "rect"


@dataclass(frozen=True, slots=True)
class WantedTopics:
    """The topics that the user chose; None: to be found."""

    colour: str | None = None
    depth: str | None = None
    odometry: str | None = None
    gyro: str | None = None


@dataclass(frozen=True, slots=True)
class BagTopics:
    """The chosen topics. colour_info, depth_info and odometry are None if there are none."""

    colour: Topic
    depth: Topic
    colour_info: str | None
    depth_info: str | None
    odometry: str | None

    @property
    def says_registered(self) -> bool:
        """Whether the name of the depth topic says that it is registered to colour."""
        return is_registered(self.depth.name)

    @property
    def rectified(self) -> bool:
        """Whether the colour images are rectified, so that they have no lens distortion."""
        return _is_rectified(self.colour.name)

    @property
    def depth_rectified(self) -> bool:
        """Whether the depth images are rectified."""
        return _is_rectified(self.depth.name)


def choose_topics(
    path: Path, topics: Sequence[Topic], wanted: WantedTopics, with_odometry: bool = True
) -> BagTopics:
    """Choose the topics. Raises BadRecording if there is none, or if several are equally good, with their
    names."""
    images = [topic for topic in topics if topic.kind in _IMAGES]
    colour = _choose(path, images, wanted.colour, "colour", _colour_rank)
    depth = _choose(path, images, wanted.depth, "depth", _depth_rank)
    if colour == depth:
        raise BadRecording(f"{path}: {colour.name} cannot be both colour and depth; choose another topic")
    infos = {topic.name for topic in topics if topic.kind == _CAMERA_INFO}
    odometry_topics = [topic for topic in topics if topic.kind == _ODOMETRY]
    odometry = None
    if with_odometry and (odometry_topics or wanted.odometry is not None):
        odometry = _choose(path, odometry_topics, wanted.odometry, "odometry", lambda _: 0).name
    return BagTopics(colour, depth, _info_of(colour, infos), _info_of(depth, infos), odometry)


def base_name(topic: str) -> str:
    """The name of a topic without its image transport."""
    for transport in _TRANSPORTS:
        topic = topic.removesuffix(transport)
    return topic


def is_registered(topic: str) -> bool:
    """Whether the name of a depth topic says that it is registered to colour."""
    return any(word in topic.lower() for word in _REGISTERED_WORDS)


def named_topic(path: Path, topics: Sequence[Topic], wanted: str, kind: str) -> Topic:
    """The topic that the user chose for kind. Raises BadRecording if it is none of the topics."""
    named = [topic for topic in topics if topic.name == wanted]
    if named:
        return named[0]
    raise BadRecording(f"{path}: {kind} topic {wanted}: there is none; there are {list_names(topics)}")


def list_names(topics: Sequence[Topic]) -> str:
    """Their names, for a sentence."""
    return ", ".join(topic.name for topic in topics) or "none of that kind"


def _is_rectified(topic: str) -> bool:
    return _RECTIFIED in base_name(topic).rsplit("/", 1)[-1]


def _choose(
    path: Path, topics: Sequence[Topic], wanted: str | None, kind: str, rank: Callable[[Topic], int | None]
) -> Topic:
    """The wanted topic, or the one with the lowest rank. A rank of None excludes a topic."""
    if wanted is not None:
        return named_topic(path, topics, wanted, kind)
    ranked = {topic: rank_value for topic in topics if (rank_value := rank(topic)) is not None}
    if not ranked:
        raise BadRecording(
            f"{path}: no topic with {kind} images was found; choose one with {_option(kind)}; "
            f"there are {list_names(topics)}"
        )
    best = [topic for topic in topics if ranked.get(topic) == min(ranked.values())]
    # The same images in several transports: uncompressed ones sort first, by their shorter name.
    if len({base_name(topic.name) for topic in best}) > 1:
        raise BadRecording(
            f"{path}: several topics could be the {kind}: {list_names(best)}; choose one with {_option(kind)}"
        )
    return min(best, key=lambda topic: len(topic.name))


def _colour_rank(topic: Topic) -> int | None:
    name = topic.name.lower()
    if any(word in name for word in _NO_COLOUR_WORDS):
        return None
    named = any(word in name for word in _COLOUR_WORDS)
    return (0 if named else 2) + (0 if _RECTIFIED in name else 1)


def _depth_rank(topic: Topic) -> int | None:
    name = topic.name.lower()
    # A codec for pictures destroys depth.
    if "depth" not in name or topic.name.endswith("/compressed"):
        return None
    return 0 if is_registered(topic.name) else 1


def _info_of(topic: Topic, infos: set[str]) -> str | None:
    """The topic with the camera_info of images, where image_transport looks for it: beside the images."""
    beside = base_name(topic.name).rsplit("/", 1)[0] + "/camera_info"
    stream = stream_of(topic.name)
    candidates = [beside] if stream is None else [beside, info_topic(stream)]
    return next((candidate for candidate in candidates if candidate in infos), None)


def _option(what: str) -> str:
    """The option with which the user chooses a topic, on the command line or in YAML."""
    in_yaml = "" if what == "odometry" else f" (or camera.{what}_topic)"
    return f"--{what}-topic{in_yaml}"
