"""A ROS bag as a file: its topics and its messages, of ROS 1 (.bag) and ROS 2 (.db3, .mcap) alike.

The one module that imports rosbags (Apache-2.0, extra "ros"), and only when a bag is opened.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

from hal.cameras.bag_realsense import message_of
from hal.errors import BadRecording, DeviceNotFound

_ROS_2 = (".db3", ".mcap")
_SUFFIXES = (".bag", *_ROS_2)
_METADATA = "metadata.yaml"


def is_bag(path: Path) -> bool:
    """Whether a path names a bag: a file with one of its suffixes, or a folder that ROS 2 has written, if not
    to its end: only then it writes metadata.yaml."""
    # os.path and not Path: what may not be looked at is simply none.
    if os.path.isdir(path):
        written = os.path.isfile(path / _METADATA) or any(one.suffix in _ROS_2 for one in path.glob("*"))
        return written and not os.path.exists(path / "rgb.txt")
    return path.suffix in _SUFFIXES


class Topic(NamedTuple):
    """kind: the message type as ROS 2 spells it, such as sensor_msgs/msg/Image."""

    name: str
    kind: str
    messages: int


class BagFile:
    """Open between __enter__ and __exit__. Messages are the records that rosbags makes of them."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._reader: Any = None
        self._closing = ExitStack()

    def __enter__(self) -> Self:
        """Raises BadRecording, and DeviceNotFound where rosbags is not installed."""
        any_reader, known_types = _load_vendor()
        if not os.path.exists(self.path):
            raise BadRecording(f"{self.path}: there is no such file, or it may not be read")
        try:
            # Bags of RealSense viewers do not say what their messages are made of. Of a damaged bag, each
            # storage has errors of its own.
            reader = any_reader([self.path], default_typestore=known_types)
            self._reader = self._closing.enter_context(reader)
        except Exception as error:
            raise BadRecording(
                f"{self.path}: cannot be read as a ROS bag ({_told(error)}); check it with `rosbag info` or "
                "`ros2 bag info`, and mend it with `rosbag reindex`, `ros2 bag reindex` or `mcap recover`"
            ) from error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._closing.close()

    @property
    def topics(self) -> tuple[Topic, ...]:
        """Those with messages, by name."""
        counts: dict[tuple[str, str], int] = {}
        for one in self._reader.connections:
            key = (one.topic, one.msgtype)
            counts[key] = counts.get(key, 0) + one.msgcount
        return tuple(Topic(*key, count) for key, count in sorted(counts.items()) if count)

    def messages(self, names: Collection[str]) -> Iterator[tuple[str, Any]]:
        """(topic, message) of these topics in the order of the recording. Raises BadRecording where the bag
        is damaged: what came before was whole."""
        wanted = [one for one in self._reader.connections if one.topic in names]
        if not wanted:
            return
        found = self._reader.messages(connections=wanted)
        while True:
            try:
                connection, _, data = next(found)
                if not self._reader.is2:
                    data = message_of(connection.topic, connection.msgtype, data)
                message = self._reader.deserialize(data, connection.msgtype)
            except StopIteration:
                return
            except Exception as error:
                raise BadRecording(f"{self.path}: is damaged from here on ({_told(error)})") from error
            yield connection.topic, message

    def first(self, name: str) -> Any:
        """The first message of a topic; None if it has none."""
        return next((message for _, message in self.messages((name,))), None)


def _told(error: Exception) -> str:
    """In one line."""
    return " ".join(str(error).split()) or type(error).__name__


def _load_vendor() -> tuple[Any, Any]:
    """(AnyReader, the types of ROS 2)."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise DeviceNotFound(
            f"ROS bags: rosbags cannot be imported ({error}); install it with pip install -e '.[ros]'"
        ) from error
    return AnyReader, get_typestore(Stores.ROS2_HUMBLE)
