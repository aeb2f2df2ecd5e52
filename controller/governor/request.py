"""The governor's messages: one JSON object a datagram, in both directions.

JSON rather than a packed struct: any language and `nc` can send it, and people can read it. A missing or
misspelt key is noticed; in a struct it would shift every number behind it. At 50 messages of about 80 bytes
per second there is no need to save bytes.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import NoReturn

from controller.decision.decision import Decision

MOST_BYTES = 512  # a request has some 80
# Requests above these are rejected as mistakes; nothing that drives on a floor is faster.
MOST_MPS = 10.0
MOST_RADPS = 10.0
MOST_SEQ = 2**53 - 1
_KEYS = frozenset({"seq", "t_s", "v_mps", "w_radps"})


class MessageError(Exception):
    """Raised for a datagram that is no request; its text says in one line what is wrong."""


@dataclass(frozen=True, slots=True)
class Twist:
    """Speed ahead v_mps and yaw rate w_radps, positive to the left (REP 103)."""

    v_mps: float
    w_radps: float


@dataclass(frozen=True, slots=True)
class Request:
    """A planner's request.

    seq: must grow from message to message.
    t_s: time of the planner's own clock, with any zero. It must not go back and must run at the rate of real
    time.
    """

    seq: int
    t_s: float
    twist: Twist


def parse_request(data: bytes) -> Request:
    """The request in one datagram. Raises MessageError and nothing else, for any bytes."""
    if len(data) > MOST_BYTES:
        raise MessageError(f"{len(data)} bytes, at most {MOST_BYTES}")
    try:
        content = json.loads(data, parse_constant=_not_a_number, object_pairs_hook=_once_each)
    except (ValueError, RecursionError) as error:
        raise MessageError(f"not JSON: {' '.join(str(error).split())[:120]}") from error
    if not isinstance(content, dict):
        raise MessageError("not a JSON object")
    if content.keys() != _KEYS:
        missing, unknown = sorted(_KEYS - content.keys()), sorted(content.keys() - _KEYS)
        raise MessageError(f"keys: missing {missing}, unknown {[key[:20] for key in unknown[:3]]}")
    seq = content["seq"]
    if isinstance(seq, bool) or not isinstance(seq, int) or not 0 <= seq <= MOST_SEQ:
        raise MessageError("seq: must be a whole number in 0..2^53 - 1")
    t_s = _number(content, "t_s", math.inf)
    return Request(
        seq, t_s, Twist(_number(content, "v_mps", MOST_MPS), _number(content, "w_radps", MOST_RADPS))
    )


def encode_reply(
    request: Request, v_mps: float, w_radps: float, decision: Decision, chassis: str, dropped: int
) -> bytes:
    """The reply as a datagram: what is commanded, and why. dropped: number of messages dropped so far."""
    content = {
        "seq": request.seq,
        "v_mps": round(v_mps, 6),
        "w_radps": round(w_radps, 6),
        "action": decision.action.value,
        "rule": decision.reason.rule,
        "reason": decision.reason.sentence,
        "obstacle": decision.reason.obstacle_id,
        "chassis": chassis,
        "dropped": dropped,
    }
    return json.dumps(content, allow_nan=False).encode()


def _number(content: dict[str, object], key: str, most: float) -> float:
    value = content[key]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise MessageError(f"{key}: must be a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise MessageError(f"{key}: must be finite")
    if not abs(number) <= most:
        raise MessageError(f"{key}: {number:g} is out of range, at most {most:g}")
    return number


def _not_a_number(constant: str) -> NoReturn:
    raise ValueError(f"{constant} is not a number")


def _once_each(pairs: list[tuple[str, object]]) -> dict[str, object]:
    content = dict(pairs)
    if len(content) != len(pairs):
        raise ValueError("a key is given twice")
    return content
