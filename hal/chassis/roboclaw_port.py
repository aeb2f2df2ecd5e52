"""Sends one RoboClaw request at a time over a serial link, without blocking until the answer comes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hal.api import SerialLink
from hal.chassis.outstanding import OutstandingRequest
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
    """

    def __init__(self, link: SerialLink, address: int) -> None:
        self._link = link
        self._address = address
        self._outstanding = OutstandingRequest[Request](_REPLY_TIMEOUT_NS, _SILENCE_NS)
        self._received = bytearray()
        self._received_ns = 0
        self._repeatable = False
        self.bytes_received = 0

    @property
    def late_answer(self) -> str:
        """How late the last answer came; "" if a query has been answered in time since."""
        return self._outstanding.late_answer

    def idle(self, now_ns: int) -> bool:
        """Whether a request may be started."""
        return self._outstanding.idle(now_ns)

    def start(self, request: Request, now_ns: int) -> None:
        """Write the request. Raises LinkLost."""
        self._write(request, now_ns)
        self._repeatable = bool(request.reply_lengths)

    def abandon(self, now_ns: int) -> None:
        """Forget the current request. If its answer still comes, it falls into a period of silence."""
        self._outstanding.abandon(now_ns)

    def poll(self, now_ns: int) -> Answer | None:
        """Read what has arrived; return the answer if the current request has ended, successfully or not.

        May write the current request once more. Raises LinkLost.
        """
        arrived = read_all(self._link)
        self.bytes_received += len(arrived)
        request, sent_ns = self._outstanding.request, self._outstanding.sent_ns
        if request is None:
            if arrived:  # Not asked for: noise, or an answer that came too late.
                self._outstanding.note_stray(self._answered_by(arrived), now_ns)
            return None
        if arrived:
            self._received += arrived
            self._received_ns = now_ns
        too_late = self._outstanding.expired(now_ns)
        data = self._complete(request, now_ns, too_late)
        if data is None:
            if len(self._received) < request.longest_reply and not too_late:
                return None
            self._outstanding.note_late(self._answered_by(bytes(self._received)), now_ns)
            if self._repeatable and not too_late and not self.late_answer:
                self._repeatable = False
                self._write(request, now_ns)
                return None
            self._outstanding.fail(now_ns)
        elif request.reply_lengths:
            self._outstanding.answered()
        else:  # The same byte acknowledges every command.
            self._outstanding.acknowledged()
        return Answer(request, data, sent_ns)

    def _write(self, request: Request, now_ns: int) -> None:
        self._link.write(request.packet(self._address))
        self._outstanding.begin(request, now_ns)
        self._received_ns = now_ns
        self._received.clear()

    def _answered_by(self, received: bytes) -> Callable[[Request], bool]:
        return lambda request: request.accept(self._address, received) is not None

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
