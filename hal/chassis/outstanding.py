"""The one request whose answer is awaited, for lines on which an answer does not name its request.

It keeps the time limit, the pause after a missing answer, and how late an answer came. What an answer looks
like is up to the port that uses it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

from hal.clocks import NS_PER_MS

RequestT = TypeVar("RequestT")


class OutstandingRequest(Generic[RequestT]):
    """At most one request at a time.

    timeout_ns: an answer must not come later than this, or it would be taken for the next one.
    silence_ns: pause after a missing answer, and after anything that was not asked for.
    request: the one whose answer is awaited; None: none is.
    sent_ns: when it, or the last one, was sent.
    late_answer: how late the last answer came; "" if one has come in time since. What answers late is neither
    silent nor wrongly wired: the line, or this computer, is too slow.
    """

    def __init__(self, timeout_ns: int, silence_ns: int) -> None:
        self._timeout_ns = timeout_ns
        self._silence_ns = silence_ns
        self._quiet_until_ns = 0
        self._timed_out: tuple[RequestT, int] | None = None
        self.request: RequestT | None = None
        self.sent_ns = 0
        self.late_answer = ""

    def idle(self, now_ns: int) -> bool:
        """Whether no answer is awaited, and no pause is being kept."""
        return self.request is None and now_ns >= self._quiet_until_ns

    def begin(self, request: RequestT, now_ns: int) -> None:
        """It has been sent now."""
        self.request, self.sent_ns = request, now_ns

    def expired(self, now_ns: int) -> bool:
        """Whether an answer is awaited, and can no longer come in time."""
        return self.request is not None and now_ns - self.sent_ns >= self._timeout_ns

    def answered(self) -> None:
        """The answer came in time. Answers come in order: none of an earlier request is still to come."""
        self.acknowledged()
        self.late_answer, self._timed_out = "", None

    def acknowledged(self) -> None:
        """The answer came, but may just as well be that of an earlier request."""
        self.request = None

    def fail(self, now_ns: int) -> None:
        """Await the answer no longer. If its time is over, it may still come late."""
        if self.request is not None and self.expired(now_ns):
            self._timed_out = self.request, self.sent_ns
        self.request = None
        self._keep_quiet(now_ns + self._silence_ns)

    def abandon(self, now_ns: int) -> None:
        """Forget the request. If its answer still comes, it falls into a pause."""
        if self.request is not None:
            self.request = None
            self._keep_quiet(now_ns + self._timeout_ns)

    def note_stray(self, answers: Callable[[RequestT], bool], now_ns: int) -> None:
        """Something came that was not asked for. answers: whether it is the answer to a request."""
        self.note_late(answers, now_ns)
        self._keep_quiet(now_ns + self._silence_ns)

    def note_late(self, answers: Callable[[RequestT], bool], now_ns: int) -> None:
        """Keep how late it is if what came is the answer to the request that timed out last."""
        if self._timed_out is None:
            return
        request, sent_ns = self._timed_out
        if answers(request):
            delay_ms, limit_ms = (now_ns - sent_ns) / NS_PER_MS, self._timeout_ns / NS_PER_MS
            self.late_answer = (
                f"the last answer came {delay_ms:.0f} ms after its request, too late: the limit is "
                f"{limit_ms:.0f} ms"
            )

    def _keep_quiet(self, until_ns: int) -> None:
        self._quiet_until_ns = max(self._quiet_until_ns, until_ns)
