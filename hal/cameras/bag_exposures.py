"""When the images and readings of a bag were taken.

The header of a message tells it, except in the .db3 of a RealSense viewer: there, the header holds the time
at which the recorder wrote the message. The camera's own time is in a text with metadata beside it, which has
the same time of writing.
"""

from __future__ import annotations

from collections.abc import Iterable
from statistics import median
from typing import Any

from hal.cameras.bag_file import BagFile, until_damage
from hal.cameras.bag_realsense import METADATA, metadata_topic, time_in_metadata
from hal.clocks import NS_PER_S


def header_ns(message: Any) -> int:
    """The time in a message's header."""
    stamp = message.header.stamp
    return int(stamp.sec) * NS_PER_S + int(stamp.nanosec)


class Exposures:
    """The times of the messages of some topics.

    clock: whose times they are, as librealsense calls it ("Hardware Clock"); None: those of the headers.
    """

    def __init__(self, bag: BagFile, topics: Iterable[str]) -> None:
        self.clock: str | None = None
        self._taken_ns: dict[str, dict[int, int]] = {}
        self._late_ns: dict[str, int] = {}
        clocks: set[str | None] = set()
        kinds = {topic.name: topic.kind for topic in bag.topics}
        taken_ns: dict[str, dict[int, int]] = {}
        for topic in topics:
            metadata = metadata_topic(topic)
            if metadata is None or kinds.get(metadata) != METADATA:
                return
            taken_ns[topic], found = _read(bag, metadata)
            clocks |= found
        if len(clocks) == 1 and all(taken_ns.values()):
            self.clock = clocks.pop()
            self._taken_ns = taken_ns
            self._late_ns = {
                topic: round(median(written - taken for written, taken in times.items()))
                for topic, times in taken_ns.items()
            }

    def stamp_ns(self, topic: str, message: Any) -> int:
        """When a message was taken; estimated from when it was written if it has no metadata."""
        written_ns = header_ns(message)
        if self.clock is None:
            return written_ns
        return self._taken_ns[topic].get(written_ns, written_ns - self._late_ns[topic])


def _read(bag: BagFile, metadata: str) -> tuple[dict[int, int], set[str | None]]:
    """(time of writing -> time of the camera, the clocks that those are of; None: a text tells no time)."""
    times_ns: dict[int, int] = {}
    clocks: set[str | None] = set()
    for _, written_ns, message in until_damage(bag.stamped_messages((metadata,))):
        taken = time_in_metadata(message.data)
        clocks.add(None if taken is None else taken[1])
        if taken is not None:
            times_ns[written_ns] = taken[0]
    return times_ns, clocks
