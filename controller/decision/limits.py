"""Speed limits, each with its reason, and what they are made of; the decision takes the least limit.

The advisers (controller/decision/speed_limits.py) and controller/decision/decide.py make Limits;
stop_before() makes the most frequent one.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from config.decision import Release
from controller import braking
from controller.braking import BrakeLimits
from controller.decision.decision import Reason, Rule
from hal.records import record

# An obstacle still counts as ahead while the robot's front is past its near side by no more than this.
ALONGSIDE_M = 0.1
STANDING_MPS = 0.01  # the decision counts a slower robot as standing, by command and by measurement
# Nothing corrects the expected place of a body out of view: while it is not seen, an error of this many
# standard deviations of its velocity may add up.
UNSEEN_ERROR_SIGMAS = 2.0
LEAST_TOLD_MPS = 0.005  # a lower speed would read as 0.00 m/s; a reason says "stop" instead
# From this time on, that a body is out of view is told in a reason.
_WORTH_TELLING_S = 1.0

# Rules of a Reason that mean: something stands or moves in the way.
BLOCKING_RULES: frozenset[Rule] = frozenset(
    {"static", "oncoming", "leader", "crossing", "depth", "unseen", "worst case"}
)
# Those among them that mean: it does not move.
STANDING_RULES: frozenset[Rule] = frozenset({"static", "depth"})


@record(frozen=True, slots=True)
class Limit:
    """A speed that must not be exceeded now.

    why: makes the Reason; called only for the least of all limits.
    urgent: comfort braking no longer suffices.
    """

    speed_mps: float
    why: Callable[[], Reason]
    urgent: bool = False

    @property
    def reason(self) -> Reason:
        """The reason; made anew each time."""
        return self.why()


@record(frozen=True, slots=True)
class Motion:
    """The robot now: speed and acceleration as commanded, and the latency until a new command acts."""

    v_mps: float
    a_mps2: float
    latency_s: float


@record(frozen=True, slots=True)
class Gap:
    """The free distance from the robot's front to something ahead.

    distance_m: the free distance along the path.
    closing_mps: its own speed towards the robot; negative if it drives away.
    leader_stop_m: how far it still goes ahead even if it brakes now.
    obstacle_id: None if it is not a tracked obstacle.
    unseen_s: for how long it has not been seen.
    """

    distance_m: float
    closing_mps: float = 0.0
    leader_stop_m: float = 0.0
    obstacle_id: int | None = None
    unseen_s: float = 0.0

    @property
    def name(self) -> str:
        """What it is called in sentences. Out of view it is told for how long: it may have gone."""
        if self.obstacle_id is None:
            return "a surface"
        unseen = f" (not seen for {self.unseen_s:.0f} s)" if self.unseen_s >= _WORTH_TELLING_S else ""
        return f"obstacle {self.obstacle_id}{unseen}"


@record(frozen=True, slots=True)
class StoppingRoom:
    """The room for a comfortable stop a margin before the end of a gap.

    speed_mps: greatest speed from which that stop still fits.
    required_m: what it takes at the present motion, the margin included.
    spare_m: what it leaves of the gap; negative if it takes more.
    """

    speed_mps: float
    required_m: float
    spare_m: float


def stopping_room(gap: Gap, motion: Motion, comfort: BrakeLimits, margin_m: float) -> StoppingRoom:
    """The room for a comfortable stop margin_m before the end of the gap."""
    room_m = gap.distance_m + gap.leader_stop_m
    speed_mps = braking.speed_for_distance(
        room_m,
        comfort,
        latency_s=motion.latency_s,
        closing_mps=gap.closing_mps,
        margin_m=margin_m,
        # A present acceleration lowers the limit; a present deceleration must not raise it.
        a_mps2=max(motion.a_mps2, 0.0),
    )
    required_m = braking.required_distance(
        motion.v_mps, motion.a_mps2, gap.closing_mps, motion.latency_s, comfort, margin_m
    )
    return StoppingRoom(speed_mps, required_m, room_m - required_m)


def reason_before(gap: Gap, room: StoppingRoom, rule: Rule, what: str) -> Reason:
    """The reason to stop before the end of the gap. what: completes "obstacle 3 ... 2.0 m ahead"."""
    ahead = f"{gap.name} {what} {max(gap.distance_m, 0.0):.1f} m ahead: "
    return Reason(
        rule,
        ahead + allowed_text(room.speed_mps),
        gap.obstacle_id,
        gap.distance_m,
        gap.closing_mps,
        room.required_m,
        room.spare_m,
    )


def too_little_left(room: StoppingRoom, motion: Motion, margin_m: float, min_left_m: float) -> bool:
    """Whether a stop with this margin would leave less than min_left_m, so that it has to be a harder one."""
    return motion.v_mps > 0.0 and room.spare_m < min_left_m - margin_m


def stop_before(
    gap: Gap,
    motion: Motion,
    comfort: BrakeLimits,
    margin_m: float,
    min_left_m: float,
    rule: Rule,
    what: str,
) -> Limit:
    """The limit for a comfortable stop margin_m before the end of the gap, with a reason_before() it.

    It is urgent if that stop would leave less than min_left_m.
    """
    room = stopping_room(gap, motion, comfort, margin_m)
    urgent = too_little_left(room, motion, margin_m, min_left_m)
    return Limit(room.speed_mps, lambda: reason_before(gap, room, rule, what), urgent)


def standing_text(clearance_m: float, needed_m: float) -> str:
    """What a standing obstacle does, for a reason: beside the swept width, the clearance that it leaves.

    clearance_m: free floor between it and the swept width. needed_m: minimum clearance for passing it.
    """
    if not 0.0 < clearance_m < math.inf:
        return "stands on the path"
    return f"leaves {clearance_m:.2f} m beside the swept width ({needed_m:.2f} m needed),"


def min_start_mps(release: Release, comfort: BrakeLimits) -> float:
    """The least allowed speed at which the robot starts from rest while something blocks the way."""
    return max(release.creep_mps, braking.speed_for_distance(release.go_m, comfort))


def allowed_text(speed_mps: float) -> str:
    """The end of a reason's sentence: what speed is allowed."""
    return "stop" if speed_mps < LEAST_TOLD_MPS else f"at most {speed_mps:.2f} m/s"
