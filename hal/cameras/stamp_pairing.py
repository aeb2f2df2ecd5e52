"""Colour and depth that arrive one after the other -> pairs of the same time."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Generic, NamedTuple, TypeVar

from hal.cameras.tum_index import associate
from hal.clocks import NS_PER_S

Item = TypeVar("Item")

_PATIENCE_NS = 2 * NS_PER_S
# An image has a rival, the rival another choice with a rival of its own: after three, all is settled.
_LOOK_AHEAD_GAPS = 3


class Stamped(NamedTuple, Generic[Item]):
    """number: counted from 0 in its stream."""

    stamp_ns: int
    number: int
    item: Item


class Stream(Generic[Item]):
    """One of the two, in the order of its times. out_of_order: what came with a time that was not later."""

    def __init__(self) -> None:
        self.waiting: deque[Stamped[Item]] = deque()
        self.unpaired = self.out_of_order = self._count = 0
        self._last_ns: int | None = None

    def add(self, stamp_ns: int, item: Item) -> None:
        """Take in the next one."""
        number, self._count = self._count, self._count + 1
        if self._last_ns is not None and stamp_ns <= self._last_ns:
            self.out_of_order += 1
            return
        self._last_ns = stamp_ns
        self.waiting.append(Stamped(stamp_ns, number, item))

    def drop(self) -> None:
        """The oldest one finds no partner."""
        self.waiting.popleft()
        self.unpaired += 1


class StampPairing(Generic[Item]):
    """Each colour image with the depth image nearest to it in time, each of them once.

    By hal/cameras/tum_index.associate, but while they arrive: a colour image waits until whatever comes later
    is too late to be of its time, or of that of an image which would rather have the same depth.
    """

    def __init__(self, max_gap_ns: int) -> None:
        self._max_gap_ns, self._ahead_ns = max_gap_ns, _LOOK_AHEAD_GAPS * max_gap_ns
        self.colour: Stream[Item] = Stream()
        self.depth: Stream[Item] = Stream()

    def pairs(self, ended: bool) -> Iterator[tuple[Stamped[Item], Stamped[Item]]]:
        """Those that are certain by now. ended: nothing more will come."""
        colours, depths = self.colour.waiting, self.depth.waiting
        while colours:
            # Of what is earlier than the first colour image, the last alone may be of its time.
            while len(depths) > 1 and depths[1].stamp_ns <= colours[0].stamp_ns:
                self.depth.drop()
            if not (ended or self._certain()):
                return
            partner = self._first_partner()
            if partner is None:
                self.colour.drop()
                continue
            for _ in range(partner):
                self.depth.drop()
            yield colours.popleft(), depths.popleft()
        while depths and (ended or self._waited(depths)):
            self.depth.drop()

    def _certain(self) -> bool:
        """Whether enough is known of both for the first colour image, or the other stream may have ended."""
        colours, depths = self.colour.waiting, self.depth.waiting
        late_ns = colours[0].stamp_ns + self._ahead_ns
        known = bool(depths) and min(colours[-1].stamp_ns, depths[-1].stamp_ns) >= late_ns
        return known or self._waited(colours) or self._waited(depths)

    def _waited(self, stream: deque[Stamped[Item]]) -> bool:
        """Whether the oldest one need not be waited with any longer: the other stream may have ended."""
        return bool(stream) and stream[-1].stamp_ns - stream[0].stamp_ns > _PATIENCE_NS + self._ahead_ns

    def _first_partner(self) -> int | None:
        """Which of depth goes with the first colour image, if any does."""
        colour_ns = [one.stamp_ns for one in self.colour.waiting]
        depth_ns = [one.stamp_ns for one in self.depth.waiting]
        return dict(associate(colour_ns, depth_ns, self._max_gap_ns)).get(0)
