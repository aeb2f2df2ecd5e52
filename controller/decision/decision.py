"""The output of one control step: what is decided, and why."""

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
# Rules of the other policies with which a campaign compares this one.
RivalRule = Literal["paper", "field", "zones"]


class Action(Enum):
    """The three choices of the paper (Daeef 2020): the target speed compared with the present one."""

    INCREASE = "increase"
    KEEP = "keep"
    DECREASE = "decrease"


@record(frozen=True, slots=True)
class Reason:
    """Why the target is what it is: the limit that won. Numbers that have no meaning here are NaN.

    rule: short name of the limit.
    sentence: the reason in words.
    obstacle_id: None if no tracked obstacle is the reason.
    distance_m: free distance from the robot's front along the path.
    closing_mps: the obstacle's own speed towards the robot.
    required_m: what a stop from the present speed and acceleration needs, latency and margin included.
    margin_m: what required_m leaves of distance_m; negative: too late for a comfortable stop.
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
    """What the shaper is to do.

    action: increase, keep or decrease.
    target_speed_mps: the speed to reach.
    reason: why.
    emergency: brake harder than comfort.
    stuck_since_ns: since when the robot has been standing before something that blocks its path; None: it is
    not.
    """

    action: Action
    target_speed_mps: float
    reason: Reason
    emergency: bool = False
    stuck_since_ns: int | None = None
