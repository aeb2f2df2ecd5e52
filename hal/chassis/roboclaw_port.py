"""One RoboClaw request at a time over a serial link, without ever waiting for the answer."""

from __future__ import annotations

from dataclasses import dataclass

from hal.api import SerialLink
from hal.chassis.reading import read_all
from hal.chassis.roboclaw_packets import Request
from hal.clocks import NS_PER_MS

# The controller drops a packet after 10 ms of silence inside it, so both sides agree again after that.
_SILENCE_NS = 10 * NS_PER_MS

# USB adapters keep bytes back for up to 16 ms; the longest answer takes 3 ms at 38400 baud. An answer must
# not come after this, or it would be taken for the answer to the next request.
_REPLY_TIMEOUT_NS = 30 * NS_PER_MS


@dataclass(frozen=True, slots=True)
class Answer:
    """What became of a request. data: None when no valid answer came. asked_ns: when it was written;
    the controller looks at its encoders a few milliseconds later, long before the answer is read."""

    request: Request
    data: bytes | None
    asked_ns: int


class RoboclawPort:
    """Stepped by poll(); start() is allowed while idle. bytes_heard counts all that ever arrived."""

    def __init__(self, link: SerialLink, address: int) -> None:
        self._link = link
        self._address = address
        self._request: Request | None = None
        self._sent_ns = 0
        self._received = bytearray()
        self._heard_ns = 0
        self._quiet_until_ns = 0
        self.bytes_heard = 0

    def idle(self, now_ns: int) -> bool:
        """No answer is awaited and the line is not being left quiet."""
        return self._request is None and now_ns >= self._quiet_until_ns

    def start(self, request: Request, now_ns: int) -> None:
        """Write the request. Raises LinkLost."""
        self._link.write(request.packet(self._address))
        self._request, self._sent_ns, self._heard_ns = request, now_ns, now_ns
        self._received.clear()

    def abandon(self, now_ns: int) -> None:
        """Forget the request under way; its answer, should it come, falls into the silence."""
        if self._request is not None:
            self._request = None
            self._quiet_until_ns = now_ns + _REPLY_TIMEOUT_NS

    def poll(self, now_ns: int) -> Answer | None:
        """Read what has arrived; the answer if the request under way has ended, well or not.

        Raises LinkLost.
        """
        arrived = read_all(self._link)
        self.bytes_heard += len(arrived)
        request = self._request
        if request is None:
            if arrived:  # Nobody asked: noise, or an answer that came too late.
                self._quiet_until_ns = max(self._quiet_until_ns, now_ns + _SILENCE_NS)
            return None
        if arrived:
            self._received += arrived
            self._heard_ns = now_ns
        too_late = now_ns - self._sent_ns >= _REPLY_TIMEOUT_NS
        data = self._complete(request, now_ns, too_late)
        failed = len(self._received) >= request.longest_reply or too_late
        if data is None and not failed:
            return None
        self._request = None
        if data is None:
            self._quiet_until_ns = now_ns + _SILENCE_NS
        return Answer(request, data, self._sent_ns)

    def _complete(self, request: Request, now_ns: int, last_chance: bool) -> bytes | None:
        """The data once the answer is whole. A shorter variant is whole when silence follows it:
        until then it may be the beginning of the longer one. Polled for the last time, its checksum decides:
        what came since the poll before has not had its silence yet."""
        received = bytes(self._received)
        silent = now_ns - self._heard_ns >= _SILENCE_NS
        if len(received) < request.longest_reply and not silent and not last_chance:
            return None
        return request.accept(self._address, received)
