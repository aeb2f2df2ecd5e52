"""Colour and depth that arrive one after the other -> pairs of the same time."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Generic, NamedTuple, TypeVar

from hal.clocks import NS_PER_S

Item = TypeVar("Item")

_PATIENCE_NS = 2 * NS_PER_S


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

    As hal/cameras/tum_index.associate, but while they arrive: a colour image waits until depth is as late.
    """

    def __init__(self, max_gap_ns: int) -> None:
        self._max_gap_ns = max_gap_ns
        self.colour: Stream[Item] = Stream()
        self.depth: Stream[Item] = Stream()

    def pairs(self, ended: bool) -> Iterator[tuple[Stamped[Item], Stamped[Item]]]:
        """Those that are certain by now. ended: nothing more will come."""
        colours, depths = self.colour.waiting, self.depth.waiting
        while colours:
            stamp_ns = colours[0].stamp_ns
            certain = ended or _waited(colours) or (depths and depths[-1].stamp_ns >= stamp_ns)
            if not certain:
                return
            while len(depths) > 1 and abs(depths[1].stamp_ns - stamp_ns) < abs(depths[0].stamp_ns - stamp_ns):
                self.depth.drop()
            if depths and abs(depths[0].stamp_ns - stamp_ns) <= self._max_gap_ns:
                yield colours.popleft(), depths.popleft()
            else:
                self.colour.drop()
        while depths and (ended or _waited(depths)):
            self.depth.drop()


def _waited(stream: deque[Stamped[Item]]) -> bool:
    """Whether the oldest one need not be waited with any longer: the other stream may have ended."""
    return stream[-1].stamp_ns - stream[0].stamp_ns > _PATIENCE_NS
