"""Pairs colour and depth images of the same time while they arrive one after the other."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Generic, NamedTuple, TypeVar

from hal.cameras.tum_index import associate
from hal.clocks import NS_PER_S

Item = TypeVar("Item")

_MAX_WAIT_NS = 2 * NS_PER_S
# How far to look ahead, in multiples of the maximum gap. A depth image may fit a rival colour image better,
# and that rival may fit another depth image with a rival of its own; three gaps are enough to settle this.
_LOOK_AHEAD_GAPS = 3


class Stamped(NamedTuple, Generic[Item]):
    """An item with its time. number: counted from 0 in its stream."""

    stamp_ns: int
    number: int
    item: Item


class Stream(Generic[Item]):
    """Colour or depth, in the order of time.

    waiting: items without a partner so far. unpaired: number of items dropped without a partner.
    out_of_order: number of items with a time that was not later than that of the item before.
    """

    def __init__(self) -> None:
        self.waiting: deque[Stamped[Item]] = deque()
        self.unpaired = self.out_of_order = self._count = 0
        self._last_ns: int | None = None

    def add(self, stamp_ns: int, item: Item) -> None:
        """Take in the next item."""
        number, self._count = self._count, self._count + 1
        if self._last_ns is not None and stamp_ns <= self._last_ns:
            self.out_of_order += 1
            return
        self._last_ns = stamp_ns
        self.waiting.append(Stamped(stamp_ns, number, item))

    def drop(self) -> None:
        """Drop the oldest item, which has no partner."""
        self.waiting.popleft()
        self.unpaired += 1


class StampPairing(Generic[Item]):
    """Pairs each colour image with the nearest depth image in time, each of them once.

    The pairs are those of hal/cameras/tum_index.associate, but found while the images arrive. A colour image
    waits until all later images are too late to be its partner, or the partner of a rival for the same depth.
    """

    def __init__(self, max_gap_ns: int) -> None:
        self._max_gap_ns, self._look_ahead_ns = max_gap_ns, _LOOK_AHEAD_GAPS * max_gap_ns
        self.colour: Stream[Item] = Stream()
        self.depth: Stream[Item] = Stream()

    def pairs(self, ended: bool) -> Iterator[tuple[Stamped[Item], Stamped[Item]]]:
        """The pairs that are certain by now. ended: no more images will come."""
        colours, depths = self.colour.waiting, self.depth.waiting
        while colours:
            # Of the depth images earlier than the first colour image, only the last can be its partner.
            while len(depths) > 1 and depths[1].stamp_ns <= colours[0].stamp_ns:
                self.depth.drop()
            if not (ended or self._partner_is_certain()):
                return
            partner = self._first_partner()
            if partner is None:
                self.colour.drop()
                continue
            for _ in range(partner):
                self.depth.drop()
            yield colours.popleft(), depths.popleft()
        while depths and (ended or self._has_waited(depths)):
            self.depth.drop()

    def _partner_is_certain(self) -> bool:
        """Whether the partner of the first colour image is certain: both streams reach far enough ahead, or
        one of them seems to have ended."""
        colours, depths = self.colour.waiting, self.depth.waiting
        needed_until_ns = colours[0].stamp_ns + self._look_ahead_ns
        known = bool(depths) and min(colours[-1].stamp_ns, depths[-1].stamp_ns) >= needed_until_ns
        return known or self._has_waited(colours) or self._has_waited(depths)

    def _has_waited(self, stream: deque[Stamped[Item]]) -> bool:
        """Whether the oldest item has waited long enough: the other stream seems to have ended."""
        return bool(stream) and stream[-1].stamp_ns - stream[0].stamp_ns > _MAX_WAIT_NS + self._look_ahead_ns

    def _first_partner(self) -> int | None:
        """Index of the waiting depth image that is paired with the first colour image; None if there is
        none."""
        colour_ns = [frame.stamp_ns for frame in self.colour.waiting]
        depth_ns = [frame.stamp_ns for frame in self.depth.waiting]
        return dict(associate(colour_ns, depth_ns, self._max_gap_ns)).get(0)
