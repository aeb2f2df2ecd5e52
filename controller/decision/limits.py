"""Speed limits, each with its reason: what the decision takes the least of."""

from __future__ import annotations

import math
from collections.abc import Callable

from config.decision import Release
from controller import braking
from controller.braking import BrakeLimits
from controller.decision.decision import Reason, Rule
from hal.records import record

# So far the front may be past the near side of something that still counts as ahead.
ALONGSIDE_M = 0.1
STANDING_MPS = 0.01
BACKWARDS_MPS = -0.05  # slower is noise of the odometry
# Who moves away from the path at more than one in so much leaves it: that is not going the robot's way.
LEAVES_ASLANT = 2.0
# Where somebody out of sight is reckoned to be, no further look corrects: so many standard deviations of its
# velocity may add up.
UNSEEN_SIGMAS = 2.0

# Rules of a Reason that mean: something stands or moves in the way.
BLOCKING_RULES: frozenset[Rule] = frozenset(
    {"static", "oncoming", "leader", "crossing", "depth", "unseen", "worst case"}
)


@record(frozen=True, slots=True)
class Limit:
    """A speed that must not be exceeded now. why: puts it into words, which only the least of all limits is
    asked for. urgent: comfort braking no longer suffices."""

    speed_mps: float
    why: Callable[[], Reason]
    urgent: bool = False

    @property
    def reason(self) -> Reason:
        """In words; made anew each time."""
        return self.why()


@record(frozen=True, slots=True)
class Motion:
    """The robot now: speed and acceleration as commanded, and the latency until a new command acts."""

    v_mps: float
    a_mps2: float
    latency_s: float


@record(frozen=True, slots=True)
class Gap:
    """Free way of the robot's front to something ahead.

    closing_mps: its own speed towards the robot, below 0 when it drives away; runs_m: how far it still runs
    ahead even if it brakes now. obstacle_id: None for what no tracked obstacle is.
    """

    distance_m: float
    closing_mps: float = 0.0
    runs_m: float = 0.0
    obstacle_id: int | None = None

    @property
    def name(self) -> str:
        """For sentences."""
        return "a surface" if self.obstacle_id is None else f"obstacle {self.obstacle_id}"


def stop_before(
    gap: Gap,
    motion: Motion,
    comfort: BrakeLimits,
    margin_m: float,
    least_m: float,
    rule: Rule,
    what: str,
) -> Limit:
    """Stand margin_m before it, comfortably; urgent when comfort would leave less than least_m."""
    room_m = gap.distance_m + gap.runs_m
    speed = braking.speed_for_distance(
        room_m,
        comfort,
        latency_s=motion.latency_s,
        closing_mps=gap.closing_mps,
        margin_m=margin_m,
        # A deceleration that is under way is no reason to go faster; an acceleration is one to stop it now.
        a_mps2=max(motion.a_mps2, 0.0),
    )
    required = braking.required_distance(
        motion.v_mps, motion.a_mps2, gap.closing_mps, motion.latency_s, comfort, margin_m
    )
    spare = room_m - required

    def why() -> Reason:
        sentence = f"{gap.name} {what} {max(gap.distance_m, 0.0):.1f} m ahead: {allowed(speed)}"
        return Reason(rule, sentence, gap.obstacle_id, gap.distance_m, gap.closing_mps, required, spare)

    return Limit(speed, why, urgent=motion.v_mps > 0.0 and spare < least_m - margin_m)


def speed_to_decide_by(commanded_mps: float, measured_mps: float) -> float:
    """The greater of commanded and measured: rather brake for speed that is not there than miss some.

    Of a base that goes backwards the decision has to know that. measured_mps: not finite where not known.
    """
    if not math.isfinite(measured_mps):
        return commanded_mps
    return measured_mps if measured_mps < BACKWARDS_MPS else max(commanded_mps, measured_mps)


def starts_at_mps(release: Release, comfort: BrakeLimits) -> float:
    """No start from rest, where something blocks the way, for a way that allows less than this."""
    return max(release.creep_mps, braking.speed_for_distance(release.go_m, comfort))


def allowed(speed_mps: float) -> str:
    """The end of a sentence."""
    return "stop" if speed_mps <= 0.0 else f"at most {speed_mps:.2f} m/s"
