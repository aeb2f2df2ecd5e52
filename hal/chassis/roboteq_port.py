"""Sends Roboteq commands, and one query at a time, over a serial link without waiting for the answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hal.api import SerialLink
from hal.chassis.outstanding import OutstandingRequest
from hal.chassis.reading import read_all
from hal.chassis.roboteq_lines import LineReader, Query, Reply, Value
from hal.clocks import NS_PER_MS

# USB adapters hold bytes back for up to 16 ms; the controller answers within a few milliseconds.
_REPLY_TIMEOUT_NS = 40 * NS_PER_MS

# Silence after a lost answer, so that it is not taken for the answer to the next query if it comes late.
_SILENCE_NS = 10 * NS_PER_MS


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to a query. requested_ns: when the query was written."""

    value: Value
    requested_ns: int


class RoboteqPort:
    """A port that poll() steps. bytes_received: all bytes that ever arrived."""

    def __init__(self, link: SerialLink) -> None:
        self._link = link
        self._reader = LineReader()
        self._outstanding = OutstandingRequest[Query](_REPLY_TIMEOUT_NS, _SILENCE_NS)
        self.bytes_received = 0

    @property
    def late_answer(self) -> str:
        """How late the last answer came; "" if a query has been answered in time since."""
        return self._outstanding.late_answer

    def idle(self, now_ns: int) -> bool:
        """Whether a query may be written."""
        return self._outstanding.idle(now_ns)

    def write(self, data: bytes, query: Query | None, now_ns: int) -> None:
        """Write commands, then a query if one is given, in one piece. Raises LinkLost."""
        self._link.write(data if query is None else data + query.line)
        if query is not None:
            self._outstanding.begin(query, now_ns)

    def poll(self, now_ns: int) -> list[Reply | Answer]:
        """What has arrived: replies to commands, and the answer to the query. Raises LinkLost."""
        arrived = read_all(self._link)
        self.bytes_received += len(arrived)
        found: list[Reply | Answer] = []
        for line in self._reader.feed(arrived):
            if isinstance(line, Reply):
                found.append(line)
            elif self._awaits(line):
                found.append(Answer(line, self._outstanding.sent_ns))
                self._outstanding.answered()
            else:
                self._outstanding.note_stray(_answered_by(line), now_ns)
        if self._outstanding.expired(now_ns):
            self._outstanding.fail(now_ns)
            self._reader.forget()
        return found

    def _awaits(self, value: Value) -> bool:
        query = self._outstanding.request
        return query is not None and value.name == query.name


def _answered_by(value: Value) -> Callable[[Query], bool]:
    return lambda query: query.name == value.name
