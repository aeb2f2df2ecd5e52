"""Sends one RoboClaw request at a time over a serial link, without blocking until the answer comes."""

from __future__ import annotations

from dataclasses import dataclass

from hal.api import SerialLink
from hal.chassis.late_answer import late_answer
from hal.chassis.reading import read_all
from hal.chassis.roboclaw_packets import Request
from hal.clocks import NS_PER_MS

# The controller drops a packet after 10 ms of silence inside it, so after that both sides are in step again.
_SILENCE_NS = 10 * NS_PER_MS

# USB adapters hold bytes back for up to 16 ms; the longest answer takes 3 ms at 38400 baud. An answer must
# not come later than this, or it would be taken for the answer to the next request.
_REPLY_TIMEOUT_NS = 30 * NS_PER_MS


@dataclass(frozen=True, slots=True)
class Answer:
    """The result of a request.

    data: None if no valid answer came.
    requested_ns: when the request was written. The controller reads its encoders a few milliseconds later,
    long before the answer is read here.
    """

    request: Request
    data: bytes | None
    requested_ns: int


class RoboclawPort:
    """A port that poll() steps; start() is allowed while idle.

    A query whose answer is garbled is repeated once, at once. An answer that is whole but wrong comes from a
    controller that is in step, and a rest of it would only spoil the repetition, whose checksum decides. A
    missing answer is not repeated: if it came late, it would be taken for the answer to the repetition.

    bytes_received: all bytes that ever arrived.
    late_answer: how late the last answer came; "" if a query has been answered in time since.
    """

    def __init__(self, link: SerialLink, address: int) -> None:
        self._link = link
        self._address = address
        self._request: Request | None = None
        self._sent_ns = 0
        self._received = bytearray()
        self._received_ns = 0
        self._quiet_until_ns = 0
        self._repeatable = False
        self._timed_out: tuple[Request, int] | None = None
        self.bytes_received = 0
        self.late_answer = ""

    def idle(self, now_ns: int) -> bool:
        """Whether no answer is awaited, and no period of silence is being kept."""
        return self._request is None and now_ns >= self._quiet_until_ns

    def start(self, request: Request, now_ns: int) -> None:
        """Write the request. Raises LinkLost."""
        self._write(request, now_ns)
        self._repeatable = bool(request.reply_lengths)

    def abandon(self, now_ns: int) -> None:
        """Forget the current request. If its answer still comes, it falls into a period of silence."""
        if self._request is not None:
            self._request = None
            self._quiet_until_ns = now_ns + _REPLY_TIMEOUT_NS

    def poll(self, now_ns: int) -> Answer | None:
        """Read what has arrived; return the answer if the current request has ended, successfully or not.

        May write the current request once more. Raises LinkLost.
        """
        arrived = read_all(self._link)
        self.bytes_received += len(arrived)
        request = self._request
        if request is None:
            if arrived:  # Not asked for: noise, or an answer that came too late.
                self._note_late(arrived, now_ns)
                self._quiet_until_ns = max(self._quiet_until_ns, now_ns + _SILENCE_NS)
            return None
        if arrived:
            self._received += arrived
            self._received_ns = now_ns
        too_late = now_ns - self._sent_ns >= _REPLY_TIMEOUT_NS
        data = self._complete(request, now_ns, too_late)
        failed = len(self._received) >= request.longest_reply or too_late
        if data is None and not failed:
            return None
        if data is None:
            self._note_late(bytes(self._received), now_ns)
            if self._repeatable and not too_late and not self.late_answer:
                self._repeatable = False
                self._write(request, now_ns)
                return None
            if too_late:
                self._timed_out = request, self._sent_ns
            self._quiet_until_ns = now_ns + _SILENCE_NS
        elif request.reply_lengths:  # Answers come in order: none of an earlier request is still to come.
            self.late_answer, self._timed_out = "", None
        self._request = None
        return Answer(request, data, self._sent_ns)

    def _write(self, request: Request, now_ns: int) -> None:
        self._link.write(request.packet(self._address))
        self._request, self._sent_ns, self._received_ns = request, now_ns, now_ns
        self._received.clear()

    def _note_late(self, received: bytes, now_ns: int) -> None:
        """Keep how late it is if these bytes are the answer to the request that timed out last."""
        if self._timed_out is None:
            return
        request, sent_ns = self._timed_out
        if request.accept(self._address, received) is not None:
            self.late_answer = late_answer(now_ns - sent_ns, _REPLY_TIMEOUT_NS)

    def _complete(self, request: Request, now_ns: int, last_chance: bool) -> bytes | None:
        """The data once the answer is complete, else None.

        A shorter variant is complete when silence follows it: until then it may be the beginning of the
        longer one. At the last poll its checksum decides, because there is no time left to wait for silence.
        """
        received = bytes(self._received)
        silent = now_ns - self._received_ns >= _SILENCE_NS
        if len(received) < request.longest_reply and not silent and not last_chance:
            return None
        return request.accept(self._address, received)
