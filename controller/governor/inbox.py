"""Which request holds now: that of the newest valid message of one planner, until it falls silent.

A message that is not obeyed is dropped and counted, with a warning for the first of each kind. The planner
that is heard first has the command until it has been silent for timeout_s. After that a planner that has
restarted is heard again, whatever sequence number it begins with.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

from config.governor import GovernorConfig
from controller.decision.decision import Decision
from controller.governor.request import MessageError, Request, Twist, encode_reply, parse_request
from hal.api import DatagramLink
from hal.clocks import NS_PER_MS, NS_PER_S
from hal.errors import LinkLost
from hal.types import Sender

# Messages read per control step, so that a flood does not hold it up; the rest waits for the next step.
_MOST_A_POLL = 64
# Two clocks drift apart by less than this share, so the offset of the fastest message grows at this rate.
_DRIFT = 1e-3
# If the message before a late one was late by this share of late_s, too, lateness grows: a clock runs slow.
_GROWN = 0.5
# The time between two messages counts for at most this share of resume_s: two messages alone are no stream.
_ONE_WAIT = 0.5
_ROUNDING_S = 1e-6


@dataclass(frozen=True, slots=True)
class RequestState:
    """What is asked for now.

    twist: None if nothing is.
    silence: why nothing is asked for.
    """

    twist: Twist | None
    silence: str = ""


@dataclass(slots=True)
class _Session:
    """One planner while it has the command.

    last, last_ns: its last message, and when it arrived.
    least_offset_s: the clock here minus the planner's, for its fastest message.
    late_s: by how much later than that one its last message arrived.
    steady_s: for how long its messages have kept coming, up to the last one.
    """

    sender: Sender | None
    last: Request
    last_ns: int
    least_offset_s: float
    late_s: float = 0.0
    steady_s: float = 0.0

    def lateness_s(self, offset_s: float, now_ns: int) -> float:
        """How late a message with this offset is that arrives now."""
        return offset_s - self.least_offset_s - _DRIFT * (now_ns - self.last_ns) / NS_PER_S


class Inbox:
    """Polled once a control step. warn: called for the first dropped message of each kind."""

    def __init__(self, link: DatagramLink, config: GovernorConfig, warn: Callable[[str], None]) -> None:
        self._link, self._config, self._warn = link, config, warn
        self._session: _Session | None = None
        self._heard: tuple[Sender | None, Request] | None = None
        self._heard_ns: int | None = None
        self._reply_to: Request | None = None
        self._lost = ""
        self.dropped: Counter[str] = Counter()
        self.accepted = 0

    def poll(self, now_ns: int) -> RequestState:
        """Read what has arrived; what is asked for at now_ns."""
        self._end_if_silent(now_ns)
        if not self._lost:
            self._read(now_ns)
        if self._lost:
            return RequestState(None, self._lost)
        session = self._session
        if session is None:
            if self._heard_ns is None:
                return RequestState(None, "no command yet")
            return RequestState(None, f"no command for {(now_ns - self._heard_ns) // NS_PER_MS} ms")
        if session.steady_s < self._config.resume_s - _ROUNDING_S:
            return RequestState(None, f"commands have come for only {session.steady_s:.2f} s")
        return RequestState(session.last.twist)

    def tell(self, v_mps: float, w_radps: float, decision: Decision, chassis: str) -> None:
        """Answer the newest message, once."""
        request, self._reply_to = self._reply_to, None
        session = self._session
        if request is None or session is None or session.sender is None:
            return
        message = encode_reply(request, v_mps, w_radps, decision, chassis, self.dropped.total())
        if not self._link.send(message, session.sender):
            self.dropped["answers that could not be delivered"] += 1

    def _end_if_silent(self, now_ns: int) -> None:
        session = self._session
        if session is not None and now_ns - session.last_ns > self._config.timeout_s * NS_PER_S:
            self._session, self._reply_to = None, None

    def _read(self, now_ns: int) -> None:
        try:
            for _ in range(_MOST_A_POLL):
                arrived = self._link.receive()
                if arrived is None:
                    return
                self._take(*arrived, now_ns)
        except LinkLost as error:
            self._lost = str(error)
            self._warn(self._lost)

    def _take(self, data: bytes, sender: Sender | None, now_ns: int) -> None:
        try:
            request = parse_request(data)
        except MessageError as error:
            self._drop("malformed", f"{_name(sender)} sent {error}")
            return
        session = self._session
        offset_s = now_ns / NS_PER_S - request.t_s
        if session is None:
            if (sender, request) == self._heard:
                self._drop("duplicate", f"seq {request.seq} came again after silence")
                return
            session = self._session = _Session(sender, request, now_ns, offset_s)
        elif not self._in_order(session, request, sender, offset_s, now_ns):
            return
        session.late_s = max(session.lateness_s(offset_s, now_ns), 0.0)
        session.least_offset_s = offset_s - session.late_s
        waited_s = (now_ns - session.last_ns) / NS_PER_S
        session.steady_s += min(waited_s, _ONE_WAIT * self._config.resume_s)
        session.last, session.last_ns = request, now_ns
        self._heard, self._heard_ns = (sender, request), now_ns
        self._reply_to = request
        self.accepted += 1

    def _in_order(
        self, session: _Session, request: Request, sender: Sender | None, offset_s: float, now_ns: int
    ) -> bool:
        if sender != session.sender:
            has = f"{_name(session.sender)} has the command"
            return self._drop("from another sender", f"{_name(sender)} is ignored while {has}")
        if request.seq == session.last.seq:
            return self._drop("duplicate", f"seq {request.seq} came twice")
        if request.seq < session.last.seq:
            return self._drop("out of order", f"seq {request.seq} came after {session.last.seq}")
        if request.t_s < session.last.t_s:
            back_s = session.last.t_s - request.t_s
            return self._drop("clock went back", f"t_s of seq {request.seq} went back by {back_s:.3f} s")
        late_s = session.lateness_s(offset_s, now_ns)
        if late_s > self._config.late_s:
            # A single message that was held up follows one that was in time. If every message is later than
            # the one before, the sender's clock runs slow.
            grows = session.late_s > _GROWN * self._config.late_s
            slow = ", each later than the one before: does its clock run slow?" if grows else ""
            return self._drop("late", f"seq {request.seq} came {late_s:.2f} s late{slow}")
        return True

    def _drop(self, kind: str, why: str) -> bool:
        self.dropped[kind] += 1
        if self.dropped[kind] == 1:
            self._warn(f"message dropped ({kind}): {why}; more of the kind are only counted")
        return False


def _name(sender: Sender | None) -> str:
    """For one line of a terminal: a socket file may have any name, line breaks and escape codes too."""
    match sender:
        case None:
            return "a sender without address"
        case (host, port, *_):
            return f"{host}:{port}"
        case bytes():  # an abstract socket; @ is how ss and systemd write its first byte
            return repr("@" + sender[1:].decode(errors="backslashreplace"))
        case _:
            return repr(sender)
