"""Common parts of the policies that ours is compared with."""

from __future__ import annotations

from config.robot import Limits
from controller import braking
from controller.decision.decision import Action, Decision, Reason, RivalRule
from controller.path.path import OnPath, Path

# A target within this of the present speed means keep; the default of release.dead_band_mps.
_DEAD_BAND_MPS = 0.03
# The shaper brakes for the target point exactly; this slack keeps the limit from braking earlier than it, as
# in controller/decision/path_limit.py.
_END_SLACK_M = 0.02


def decision(
    rule: RivalRule, sentence: str, target_mps: float, v_mps: float, *, hard: bool = False
) -> Decision:
    """A decision for the target, with the action that follows. hard: emergency braking is allowed for it."""
    if target_mps > v_mps + _DEAD_BAND_MPS:
        action = Action.INCREASE
    elif target_mps < v_mps - _DEAD_BAND_MPS:
        action = Action.DECREASE
    else:
        action = Action.KEEP
    emergency = hard and action is Action.DECREASE
    return Decision(action, target_mps, Reason(rule, sentence), emergency)


def free_speed(path: Path, on_path: OnPath, limits: Limits) -> float:
    """The speed that the path and its end allow without obstacles: the same for all policies."""
    remaining_m = max(path.length_m - on_path.s_m, 0.0) + _END_SLACK_M
    end_mps = braking.speed_for_distance(remaining_m, braking.comfort(limits))
    return min(path.speed_limit(on_path.s_m), limits.max_speed_mps, end_mps)
