"""The speed limit by the path alone: top speed, sections, bends and the target at its end."""

from __future__ import annotations

from controller import braking
from controller.braking import BrakeLimits
from controller.decision.decision import Reason, Rule
from controller.decision.limits import Limit, Motion, allowed_text
from controller.path.path import OnPath, Path

# The shaper brakes for the target point exactly; this slack keeps the limit from braking earlier than it.
_END_SLACK_M = 0.02


def path_limit(path: Path, on_path: OnPath, motion: Motion, top_mps: float, comfort: BrakeLimits) -> Limit:
    """The limit for a robot at on_path whose top speed is top_mps and that brakes by comfort."""
    left_m = path.length_m - on_path.s_m
    section_mps = _section_mps(path, on_path, motion, comfort)
    end_mps = braking.speed_for_distance(left_m + _END_SLACK_M, comfort)
    if section_mps > end_mps:
        return _before_target(left_m, end_mps, motion, comfort)
    rule: Rule = "free" if section_mps >= top_mps else "section"
    return Limit(section_mps, lambda: Reason(rule, f"{left_m:.1f} m to go: {allowed_text(section_mps)}"))


def _section_mps(path: Path, on_path: OnPath, motion: Motion, comfort: BrakeLimits) -> float:
    """The speed that the sections and bends ahead allow."""
    ahead_s = on_path.s_m + motion.v_mps * motion.latency_s
    section_mps = path.speed_limit(ahead_s)
    if motion.a_mps2 <= 0.0:
        return section_mps
    # Braking begins only once a present acceleration has ended, so look that much farther ahead. But the
    # limit of the present section holds until it is left, hence the minimum.
    steady_s = ahead_s + braking.letting_go_distance(motion.v_mps, motion.a_mps2, comfort)
    return min(section_mps, path.speed_limit(steady_s))


def _before_target(left_m: float, speed_mps: float, motion: Motion, comfort: BrakeLimits) -> Limit:
    """The limit by the target, left_m ahead of the robot."""

    def why() -> Reason:
        required_m = braking.required_distance(motion.v_mps, motion.a_mps2, 0.0, 0.0, comfort)
        return Reason(
            "target",
            f"the target is {max(left_m, 0.0):.2f} m ahead: {allowed_text(speed_mps)}",
            distance_m=left_m,
            closing_mps=0.0,
            required_m=required_m,
            margin_m=left_m - required_m,
        )

    return Limit(speed_mps, why)
