import json

import pytest

from controller.decision.decision import Action, Decision, Reason
from controller.governor.request import MessageError, Request, Twist, encode_reply, parse_request

GOOD = {"seq": 7, "t_s": 1.5, "v_mps": 0.5, "w_radps": -0.1}


def test_a_request_is_read_with_its_numbers_as_they_are() -> None:
    assert parse_request(json.dumps(GOOD).encode()) == Request(7, 1.5, Twist(0.5, -0.1))
    # One that sends whole numbers means them as they are.
    assert parse_request(b'{"w_radps": 0, "v_mps": 1, "t_s": 3, "seq": 0}\n').twist == Twist(1.0, 0.0)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"seq": -1}, "seq"),
        ({"seq": 1.0}, "seq"),
        ({"seq": True}, "seq"),
        ({"seq": 2**53}, "seq"),
        ({"t_s": "now"}, "t_s: must be a number"),
        ({"v_mps": None}, "v_mps: must be a number"),
        ({"v_mps": True}, "v_mps: must be a number"),
        ({"v_mps": 10.1}, "v_mps: 10.1 is out of range"),
        ({"v_mps": 10**400}, "v_mps: must be finite"),
        ({"w_radps": -11}, "w_radps: -11 is out of range"),
        ({"w": 0.1}, "unknown ['w']"),
    ],
)
def test_a_value_that_is_no_wish(change: dict[str, object], complaint: str) -> None:
    with pytest.raises(MessageError) as error:
        parse_request(json.dumps(GOOD | change).encode())
    assert complaint in str(error.value)


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\x00\x01\x02",
        b"\xff\xfe",
        b"[1, 2]",
        b"7",
        b'{"seq": 7, "t_s": 1.5, "v_mps": 0.5}',
        b'{"seq": 7, "t_s": 1.5, "v_mps": NaN, "w_radps": 0}',
        b'{"seq": 7, "t_s": 1.5, "v_mps": 1e999, "w_radps": 0}',
        b'{"seq": 7, "t_s": -Infinity, "v_mps": 0.1, "w_radps": 0}',
        b'{"seq": 7, "t_s": 1.5, "v_mps": 0.5, "w_radps": 0, "v_mps": 9}',
        b"[" * 500,
        b" " * 500 + b'{"seq": 7, "t_s": 1.5, "v_mps": 0.5, "w_radps": 0}',
    ],
)
def test_a_datagram_that_is_no_request(data: bytes) -> None:
    with pytest.raises(MessageError):
        parse_request(data)


def test_the_answer_says_what_is_commanded_and_why() -> None:
    decision = Decision(Action.DECREASE, 0.2, Reason("static", "obstacle 3 stands on the path", 3))
    told = json.loads(encode_reply(Request(7, 1.5, Twist(0.5, -0.1)), 0.25, -0.05, decision, "armed", 2))
    assert told == {
        "seq": 7,
        "v_mps": 0.25,
        "w_radps": -0.05,
        "action": "decrease",
        "rule": "static",
        "reason": "obstacle 3 stands on the path",
        "obstacle": 3,
        "chassis": "armed",
        "dropped": 2,
    }
