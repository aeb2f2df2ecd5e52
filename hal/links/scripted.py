"""Links in memory that fail on demand, for tests and for emulators in the same process.

``can_pair()`` and ``serial_pair()`` make the two ends of one wire. Each end can be unplugged, can refuse to
write, can be parted from the other one, and can be made to receive noise, wrong bytes, a few bytes at a time
or nothing.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from types import TracebackType
from typing import Self

from hal.errors import LinkLost
from hal.types import CanFrame


class _ScriptedLink:
    """What both kinds of link share: unplugging, and writes that fail."""

    def __init__(self) -> None:
        self._plugged = True
        self._failing_writes = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        return None

    def unplug(self) -> None:
        """Make every use raise LinkLost until plug()."""
        self._plugged = False

    def plug(self) -> None:
        """Plug the adapter in again."""
        self._plugged = True

    def fail_writes(self, count: int) -> None:
        """Make the next count writes raise LinkLost, while reading still works."""
        self._failing_writes = count

    def _check(self) -> None:
        if not self._plugged:
            raise LinkLost("scripted link: unplugged")

    def _check_write(self) -> None:
        self._check()
        if self._failing_writes > 0:
            self._failing_writes -= 1
            raise LinkLost("scripted link: write failed")


# Frames that SocketCAN keeps by default while no node acknowledges them.
_TX_QUEUE_LEN = 10


class ScriptedCanLink(_ScriptedLink):
    """One end of a CAN wire. sent: the frames that were sent, in order.

    waiting: frames that were sent while the cable is out.
    """

    def __init__(self) -> None:
        super().__init__()
        self.sent: list[CanFrame] = []
        self.waiting: deque[CanFrame] = deque()
        self.peer: ScriptedCanLink | None = None
        self._cable_out = False
        self._arrived: deque[CanFrame] = deque()
        self._filter: Callable[[CanFrame], CanFrame | None] = lambda frame: frame

    def send(self, frame: CanFrame) -> None:
        """See hal.api.CanLink."""
        self._check_write()
        if self._cable_out:
            if len(self.waiting) >= _TX_QUEUE_LEN:
                raise LinkLost("scripted link: transmit buffer full")
            self.waiting.append(frame)
            return
        self.sent.append(frame)
        if self.peer is not None:
            self.peer.deliver(frame)

    def receive(self) -> CanFrame | None:
        """See hal.api.CanLink."""
        self._check()
        return self._arrived.popleft() if self._arrived else None

    def deliver(self, *frames: CanFrame) -> None:
        """Make these frames arrive here, through the filter. Nothing arrives at an unplugged end."""
        for frame in frames:
            passed = self._filter(frame) if self._plugged and not self._cable_out else None
            if passed is not None:
                self._arrived.append(passed)

    def pull_cable(self) -> None:
        """Part the adapter from the bus: nothing arrives, and what is sent waits as in SocketCAN's queue."""
        self._cable_out = True

    def connect_cable(self) -> None:
        """Join the adapter and the bus again: what waits goes out first."""
        self._cable_out = False
        while self.waiting:
            self.send(self.waiting.popleft())

    def set_filter(self, transform: Callable[[CanFrame], CanFrame | None]) -> None:
        """Change (or, with None, drop) every frame before it arrives here."""
        self._filter = transform

    def cut_wire(self) -> None:
        """The wire to here is cut: silence without an error."""
        self._filter = lambda frame: None

    def restore_wire(self) -> None:
        """The wire is whole again."""
        self._filter = lambda frame: frame


class ScriptedSerialLink(_ScriptedLink):
    """One end of a serial wire. sent: all bytes that were sent. written: the same, one item per write."""

    def __init__(self) -> None:
        super().__init__()
        self.sent = bytearray()
        self.written: list[bytes] = []
        self.peer: ScriptedSerialLink | None = None
        self._arrived = bytearray()
        self._cable_out = False
        self._filter: Callable[[bytes], bytes] = lambda data: data
        self._max_read: int | None = None

    def write(self, data: bytes) -> None:
        """See hal.api.SerialLink."""
        self._check_write()
        if self._cable_out:
            return
        self.sent += data
        self.written.append(data)
        if self.peer is not None:
            self.peer.deliver(data)

    def read(self) -> bytes:
        """See hal.api.SerialLink."""
        self._check()
        count = len(self._arrived) if self._max_read is None else self._max_read
        data = bytes(self._arrived[:count])
        del self._arrived[:count]
        return data

    def deliver(self, data: bytes) -> None:
        """Make these bytes arrive here, through the filter. Nothing arrives at an unplugged end."""
        if self._plugged and not self._cable_out:
            self._arrived += self._filter(data)

    def pull_cable(self) -> None:
        """Part the port from the other end: what either sends is lost, without an error."""
        self._cable_out = True

    def connect_cable(self) -> None:
        """Join both ends again."""
        self._cable_out = False

    def limit_reads(self, count: int | None) -> None:
        """Let each read give at most count bytes; None: all that is there (several messages merged)."""
        self._max_read = count

    def set_filter(self, transform: Callable[[bytes], bytes]) -> None:
        """Change every write of the peer before it arrives here: noise, wrong bytes, nothing."""
        self._filter = transform

    def cut_wire(self) -> None:
        """The wire to here is cut: silence without an error."""
        self._filter = lambda data: b""

    def restore_wire(self) -> None:
        """The wire is whole again."""
        self._filter = lambda data: data


def can_pair() -> tuple[ScriptedCanLink, ScriptedCanLink]:
    """Two ends of one CAN wire."""
    one, other = ScriptedCanLink(), ScriptedCanLink()
    one.peer, other.peer = other, one
    return one, other


def serial_pair() -> tuple[ScriptedSerialLink, ScriptedSerialLink]:
    """Two ends of one serial wire."""
    one, other = ScriptedSerialLink(), ScriptedSerialLink()
    one.peer, other.peer = other, one
    return one, other
