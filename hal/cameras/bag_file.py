"""The topics and messages of a ROS bag: ROS 1 (.bag) or ROS 2 (.db3, .mcap).

The only module that imports rosbags (Apache-2.0, extra "ros"), and only when a bag is opened.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self, TypeVar

from hal.cameras.bag_realsense import message_of
from hal.errors import BadRecording, DeviceNotFound

_Item = TypeVar("_Item")
_ROS_2 = (".db3", ".mcap")
_SUFFIXES = (".bag", *_ROS_2)
_METADATA = "metadata.yaml"


def is_bag(path: Path) -> bool:
    """Whether a path is a bag: a file with a suffix of bags, or a folder that ROS 2 has written, even if
    incomplete (ROS 2 writes metadata.yaml last)."""
    # os.path, not Path: a path without permission is not a bag, and must not raise.
    if os.path.isdir(path):
        has_bag_files = os.path.isfile(path / _METADATA) or any(
            file.suffix in _ROS_2 for file in path.glob("*")
        )
        return has_bag_files and not os.path.exists(path / "rgb.txt")
    return path.suffix in _SUFFIXES


class Topic(NamedTuple):
    """A topic with its number of messages. kind: the message type as in ROS 2, such as
    sensor_msgs/msg/Image."""

    name: str
    kind: str
    messages: int


class BagFile:
    """A bag that is open between __enter__ and __exit__. Messages are the objects that rosbags makes."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._reader: Any = None
        self._closing = ExitStack()

    def __enter__(self) -> Self:
        """Open the bag. Raises BadRecording, and DeviceNotFound if rosbags is not installed."""
        any_reader, known_types = _load_vendor()
        if not os.path.exists(self.path):
            raise BadRecording(f"{self.path}: there is no such file, or it may not be read")
        try:
            # Bags of RealSense viewers do not contain the definitions of their message types. Each storage
            # format raises its own errors for a damaged bag, hence Exception.
            reader = any_reader([self.path], default_typestore=known_types)
            self._reader = self._closing.enter_context(reader)
        except Exception as error:
            raise BadRecording(
                f"{self.path}: cannot be read as a ROS bag ({_one_line(error)}); check it with `rosbag info` "
                "or `ros2 bag info`, and mend it with `rosbag reindex`, `ros2 bag reindex` or `mcap recover`"
            ) from error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._closing.close()

    @property
    def topics(self) -> tuple[Topic, ...]:
        """The topics that have messages, sorted by name."""
        counts: dict[tuple[str, str], int] = {}
        for connection in self._reader.connections:
            key = (connection.topic, connection.msgtype)
            counts[key] = counts.get(key, 0) + connection.msgcount
        return tuple(Topic(*key, count) for key, count in sorted(counts.items()) if count)

    def messages(self, names: Collection[str]) -> Iterator[tuple[str, Any]]:
        """(topic, message) of these topics, in the order of the recording. Raises BadRecording where the bag
        is damaged; all messages before that are valid."""
        return ((topic, message) for topic, _, message in self.stamped_messages(names))

    def stamped_messages(self, names: Collection[str]) -> Iterator[tuple[str, int, Any]]:
        """The same, with the time at which each was written, in nanoseconds: (topic, time, message)."""
        selected = [connection for connection in self._reader.connections if connection.topic in names]
        if not selected:
            return
        records = self._reader.messages(connections=selected)
        while True:
            try:
                connection, written_ns, data = next(records)
                if not self._reader.is2:
                    data = message_of(connection.topic, connection.msgtype, data)
                message = self._reader.deserialize(data, connection.msgtype)
            except StopIteration:
                return
            except Exception as error:
                raise BadRecording(f"{self.path}: is damaged from here on ({_one_line(error)})") from error
            yield connection.topic, int(written_ns), message

    def first(self, name: str) -> Any:
        """The first message of a topic; None if it has none."""
        return next((message for _, message in self.messages((name,))), None)


def until_damage(messages: Iterator[_Item]) -> Iterator[_Item]:
    """Those before the first damage, which is reported when the images are read."""
    with suppress(BadRecording):
        yield from messages


def _one_line(error: Exception) -> str:
    """The error's message in one line."""
    return " ".join(str(error).split()) or type(error).__name__


def _load_vendor() -> tuple[Any, Any]:
    """(AnyReader, the message types of ROS 2). Raises DeviceNotFound."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise DeviceNotFound(
            f"ROS bags: rosbags cannot be imported ({error}); install it with pip install -e '.[ros]'"
        ) from error
    return AnyReader, get_typestore(Stores.ROS2_HUMBLE)
