"""What a driver's arming is told of its base, step by step (hal/chassis/arming.py)."""

from __future__ import annotations

from dataclasses import replace

from hal.chassis.arming import ArmingLimits, Evidence

MS = 1_000_000
LIMITS = ArmingLimits(
    feedback_timeout_ns=200 * MS,
    status_timeout_ns=700 * MS,
    arming_timeout_ns=2000 * MS,
    max_step_gap_ns=500 * MS,
)
GOOD = Evidence(
    now_ns=0,
    link_error="",
    feedback_ns=0,
    status_ns=0,
    command_refusal="",
    stop_cause="",
    standing=True,
    command_is_zero=True,
)


def at(now_ms: int, **changes: object) -> Evidence:
    """All is well at this time, but for the changes; feedback and status are fresh."""
    fresh = replace(GOOD, now_ns=now_ms * MS, feedback_ns=now_ms * MS, status_ns=now_ms * MS)
    return replace(fresh, **changes)  # type: ignore[arg-type]  # field names of Evidence
