"""The state of a base that is only listened to."""

from __future__ import annotations

import pytest

from hal.chassis.arming import listen
from hal.types import ChassisMode
from tests.support.arming_evidence import LIMITS, at


@pytest.mark.parametrize(
    ("changes", "mode", "reason"),
    [
        ({}, ChassisMode.STANDBY, "it answers"),
        ({"command_refusal": "standby"}, ChassisMode.STANDBY, "it answers"),
        ({"stop_cause": "button"}, ChassisMode.ESTOP, "button"),
        ({"link_error": "unplugged", "stop_cause": "button"}, ChassisMode.LOST, "unplugged"),
        ({"feedback_ns": 0}, ChassisMode.LOST, "no motion feedback for 1000 ms"),
        (
            {"status_ns": None, "silence_hint": "check power"},
            ChassisMode.STANDBY,
            "no status heard from the base: check power",
        ),
        ({"feedback_ns": None}, ChassisMode.STANDBY, "no motion feedback heard from the base"),
    ],
)
def test_a_base_that_is_only_listened_to_latches_nothing(
    changes: dict[str, object], mode: ChassisMode, reason: str
) -> None:
    state = listen(at(1000, **changes), LIMITS)
    assert (state.mode, state.reason) == (mode, reason)
