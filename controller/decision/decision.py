"""What is decided in one control step, and why."""

from __future__ import annotations

import math
from enum import Enum
from typing import Literal

from hal.records import record

# What limits the speed; docs/design.md ("Observations") says what each of them means.
Rule = Literal[
    "free", "section", "target",
    "static", "depth",
    "leader", "oncoming", "crossing",
    "worst case",
    "corner", "unseen", "range",
    "release",
    "camera", "fault",
    "robot", "requested", "turn", "refused", "no command",
]  # fmt: skip
# Of the policies that a campaign compares ours with.
RivalRule = Literal["paper", "field", "zones"]


class Action(Enum):
    """The paper's three choices, by comparing the target with the present speed."""

    INCREASE = "increase"
    KEEP = "keep"
    DECREASE = "decrease"


@record(frozen=True, slots=True)
class Reason:
    """Why the target is what it is: the limit that won.

    rule: its short name. sentence: the same for people. obstacle_id: None where no tracked obstacle is the
    reason. distance_m: free way of the front along the path; closing_mps: the obstacle's own speed towards
    the robot; required_m: what a stop from the present speed and acceleration needs, latency and margin
    included; margin_m: what of distance_m that leaves (negative: too late for a comfortable stop). NaN where
    it has no meaning.
    """

    rule: Rule | RivalRule
    sentence: str
    obstacle_id: int | None = None
    distance_m: float = math.nan
    closing_mps: float = math.nan
    required_m: float = math.nan
    margin_m: float = math.nan


@record(frozen=True, slots=True)
class Decision:
    """emergency: brake harder than comfort. stuck_since_ns: since when the robot has been standing before
    something that blocks its path; None while it is not."""

    action: Action
    target_speed_mps: float
    reason: Reason
    emergency: bool = False
    stuck_since_ns: int | None = None
