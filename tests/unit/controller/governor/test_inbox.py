from __future__ import annotations

import json
from collections import deque
from types import TracebackType
from typing import Self

import pytest

from config.governor import GovernorConfig
from controller.decision.decision import Action, Decision, Reason
from controller.governor.inbox import Inbox, RequestState
from controller.governor.request import Twist
from hal.errors import LinkLost
from hal.types import Sender

MS = 1_000_000
PLANNER, OTHER = ("10.0.0.1", 5000), ("10.0.0.2", 5000)
KEEP = Decision(Action.KEEP, 0.5, Reason("requested", "as asked"))


class Wire:
    """hal.api.DatagramLink of a test: what arrives is put in, what is sent is kept."""

    def __init__(self) -> None:
        self.arriving: deque[tuple[bytes, Sender | None]] = deque()
        self.sent: list[tuple[bytes, Sender]] = []
        self.broken = self.deaf = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        return None

    def receive(self) -> tuple[bytes, Sender | None] | None:
        if self.broken:
            raise LinkLost("the socket broke")
        return self.arriving.popleft() if self.arriving else None

    def send(self, data: bytes, receiver: Sender) -> bool:
        self.sent.append((data, receiver))
        return not self.deaf


class Talk:
    """A planner and its inbox on one made-up clock, in milliseconds."""

    def __init__(self, resume_s: float = 0.0, timeout_s: float = 0.25) -> None:
        self.wire = Wire()
        self.warnings: list[str] = []
        config = GovernorConfig(resume_s=resume_s, timeout_s=timeout_s)
        self.inbox = Inbox(self.wire, config, self.warnings.append)

    def say(
        self, seq: int, t_ms: float, v_mps: float = 0.5, sender: Sender | None = PLANNER, **more: object
    ) -> None:
        content = {"seq": seq, "t_s": t_ms / 1e3, "v_mps": v_mps, "w_radps": 0.1} | more
        self.wire.arriving.append((json.dumps(content).encode(), sender))

    def poll(self, now_ms: int) -> RequestState:
        return self.inbox.poll(now_ms * MS)


def test_nothing_before_the_first_command_then_the_newest_one_holds_until_the_time_out() -> None:
    talk = Talk()
    assert talk.poll(0) == RequestState(None, "no command yet")
    talk.say(1, 1000, 0.3)
    talk.say(2, 1010, 0.4)
    assert talk.poll(20) == RequestState(Twist(0.4, 0.1))
    assert talk.poll(270) == RequestState(Twist(0.4, 0.1))
    assert talk.poll(271) == RequestState(None, "no command for 251 ms")
    assert (talk.inbox.accepted, talk.warnings) == (2, [])


def test_after_silence_commands_must_come_again_for_a_while() -> None:
    talk = Talk(resume_s=0.1)
    for k in range(6):
        talk.say(k, 20 * k)
        asked = talk.poll(20 * k)
        assert (asked.twist is None) == (20 * k < 100)
    assert talk.poll(400) == RequestState(None, "no command for 300 ms")
    talk.say(9, 420)
    assert talk.poll(420) == RequestState(None, "commands have come for only 0.00 s")
    for k in range(1, 6):
        talk.say(9 + k, 420 + 20 * k)
        assert (talk.poll(420 + 20 * k).twist is None) == (k < 5)


@pytest.mark.parametrize("timeout_s", [0.25, 1.0, 2.0])
def test_one_lone_command_is_never_obeyed_while_resume_s_asks_for_more(timeout_s: float) -> None:
    talk = Talk(resume_s=0.2, timeout_s=timeout_s)
    talk.say(1, 0)
    for now_ms in range(0, 2100, 10):
        assert talk.poll(now_ms).twist is None
    assert talk.inbox.accepted == 1


def test_two_commands_far_apart_do_not_keep_coming_and_three_do() -> None:
    """A wait counts for half of resume_s at most: a slow planner is obeyed from its third message on."""
    talk = Talk(resume_s=0.2, timeout_s=2.0)
    talk.say(1, 0)
    talk.poll(0)
    talk.say(2, 1000)
    assert talk.poll(1000) == RequestState(None, "commands have come for only 0.10 s")
    assert talk.poll(1900).twist is None
    talk.say(3, 2000)
    assert talk.poll(2000).twist == Twist(0.5, 0.1)
    assert talk.poll(3990).twist == Twist(0.5, 0.1), "who has kept coming holds until the time-out"


def test_a_burst_that_comes_at_once_has_not_kept_coming() -> None:
    talk = Talk(resume_s=0.2)
    for k in range(20):
        talk.say(k, 20 * k)
    for now_ms in range(0, 300, 20):
        assert talk.poll(now_ms).twist is None
    assert talk.inbox.accepted == 20


@pytest.mark.parametrize(
    ("seq", "t_ms", "kind"),
    [(5, 30, "duplicate"), (4, 30, "out of order"), (6, 10, "clock went back")],
)
def test_datagram_out_of_sequence_is_dropped_and_reported_once(seq: int, t_ms: float, kind: str) -> None:
    talk = Talk()
    talk.say(5, 20, 0.4)
    talk.poll(0)
    for k in range(3):
        talk.say(seq, t_ms, 0.9)
        assert talk.poll(20 + k).twist == Twist(0.4, 0.1)
    assert talk.inbox.dropped == {kind: 3}
    assert len(talk.warnings) == 1
    assert kind in talk.warnings[0]


def test_dropped_datagrams_do_not_keep_the_robot_driving() -> None:
    talk = Talk()
    talk.say(5, 0)
    talk.poll(0)
    for k in range(1, 30):
        talk.say(5, 0)
        talk.wire.arriving.append((b"rubbish", PLANNER))
        asked = talk.poll(10 * k)
    assert asked.twist is None


def test_rubbish_is_dropped_with_its_reason() -> None:
    talk = Talk()
    talk.wire.arriving.append((b"\xff", PLANNER))
    talk.say(1, 0, x=1)
    assert talk.poll(0) == RequestState(None, "no command yet")
    assert talk.inbox.dropped == {"malformed": 2}
    assert len(talk.warnings) == 1
    assert "10.0.0.1:5000 sent not JSON" in talk.warnings[0]


def test_one_planner_at_a_time() -> None:
    talk = Talk()
    talk.say(5, 0, 0.4)
    talk.say(900, 0, 0.9, OTHER)
    assert talk.poll(0).twist == Twist(0.4, 0.1)
    assert talk.inbox.dropped == {"from another sender": 1}
    assert "10.0.0.2:5000 is ignored while 10.0.0.1:5000 has the command" in talk.warnings[0]
    # The first one falls silent: then the other one is heard.
    assert talk.poll(300).twist is None
    talk.say(901, 300, 0.9, OTHER)
    assert talk.poll(301).twist == Twist(0.9, 0.1)


def test_a_planner_that_restarts_is_heard_after_the_time_out() -> None:
    talk = Talk()
    talk.say(500, 90_000)
    talk.poll(0)
    talk.say(1, 0, 0.9)
    assert talk.poll(100).twist == Twist(0.5, 0.1)
    talk.say(2, 400, 0.9)
    assert talk.poll(400).twist == Twist(0.9, 0.1)


def test_messages_that_were_held_up_are_not_obeyed() -> None:
    talk = Talk()
    talk.say(1, 1000)
    talk.poll(0)
    # Sent 210 ms after the first one, arrived 420 ms after it: 210 ms late, of which 200 are allowed.
    talk.say(2, 1030)
    talk.poll(30)
    talk.say(3, 1030, 0.9)
    asked = talk.poll(245)
    assert talk.inbox.dropped == {"late": 1}
    assert talk.warnings[0].endswith("seq 3 came 0.21 s late; more of the kind are only counted")
    assert asked.twist == Twist(0.5, 0.1)
    talk.say(4, 1250, 0.7)
    assert talk.poll(260).twist == Twist(0.7, 0.1)


@pytest.mark.parametrize("rate", [0.0, 0.5])
def test_a_clock_that_stands_still_or_runs_slow_is_asked_about(rate: float) -> None:
    talk = Talk()
    for k in range(12):
        talk.say(k, rate * 50 * k)
        talk.poll(50 * k)
    assert talk.inbox.dropped["late"] > 0
    assert "late, each later than the one before: does its clock run slow?" in talk.warnings[0]


def test_clocks_that_drift_apart_do_not_become_late() -> None:
    talk = Talk()
    for k in range(20_000):
        # Its clock loses 500 ppm: a second in 33 minutes.
        talk.say(k, 100 * k * (1.0 - 5e-4))
        assert talk.poll(100 * k).twist is not None
    assert talk.inbox.dropped == {}


@pytest.mark.parametrize(
    ("sender", "name"),
    [
        (b"\0planner", "'@planner'"),
        ("/run/planner", "'/run/planner'"),
        ("/run/two\nlines \x1b[2J", r"'/run/two\nlines \x1b[2J'"),
        ("/run/not-utf8-\udcff", r"'/run/not-utf8-\udcff'"),
        (b"\0\xff\x07", r"'@\\xff\x07'"),
    ],
)
def test_whatever_a_socket_is_called_its_name_is_one_printable_word(sender: Sender, name: str) -> None:
    talk = Talk()
    talk.wire.arriving.append((b"{", sender))
    talk.inbox.poll(0)
    assert talk.warnings[0].startswith(f"message dropped (malformed): {name} sent not JSON")
    assert talk.warnings[0].isprintable()


def test_each_command_is_answered_once_to_its_sender() -> None:
    talk = Talk()
    talk.inbox.tell(0.0, 0.0, KEEP, "armed")
    talk.say(3, 0)
    talk.poll(0)
    talk.inbox.tell(0.25, 0.05, KEEP, "armed")
    talk.inbox.tell(0.26, 0.05, KEEP, "armed")
    assert len(talk.wire.sent) == 1
    data, receiver = talk.wire.sent[0]
    assert receiver == PLANNER
    assert (json.loads(data)["seq"], json.loads(data)["v_mps"]) == (3, 0.25)


def test_a_sender_without_address_is_obeyed_and_not_answered() -> None:
    talk = Talk()
    talk.say(3, 0, sender=None)
    assert talk.poll(0).twist is not None
    talk.inbox.tell(0.25, 0.05, KEEP, "armed")
    assert talk.wire.sent == []


def test_answers_that_nobody_reads_are_counted() -> None:
    talk = Talk()
    talk.wire.deaf = True
    talk.say(3, 0)
    talk.poll(0)
    talk.inbox.tell(0.25, 0.05, KEEP, "armed")
    assert talk.inbox.dropped == {"answers that could not be delivered": 1}


def test_a_flood_is_read_in_portions_and_the_newest_wins_in_the_end() -> None:
    talk = Talk()
    for k in range(1000):
        talk.say(k, k / 100, k / 1000)
    talk.poll(0)
    assert 0 < len(talk.wire.arriving) < 1000
    for now_ms in range(1, 40):
        asked = talk.poll(now_ms)
    assert asked.twist == Twist(0.999, 0.1)


def test_a_socket_that_breaks_is_silence_for_good() -> None:
    talk = Talk()
    talk.say(3, 0)
    assert talk.poll(0).twist is not None
    talk.wire.broken = True
    assert talk.poll(20) == RequestState(None, "the socket broke")
    talk.wire.broken = False
    talk.say(4, 40)
    assert talk.poll(40) == RequestState(None, "the socket broke")
    assert talk.warnings == ["the socket broke"]
