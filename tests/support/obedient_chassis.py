"""A chassis for tests of what drives it: does at once what it is told and notes it."""

from __future__ import annotations

from typing import Self

from hal.geometry import advance_pose
from hal.types import ChassisMode, ChassisState, Setpoint
from tests.support.scenes import ORIGIN, chassis_state

PERIOD_S = 0.02


class ObedientChassis:
    """hal.api.Chassis; arms after a few exchanges. Set ``fault`` and it is in that mode from then on.

    stamp_offset_ns: how long after the time of an exchange its state is stamped, as in real time.
    """

    def __init__(self, arms_after: int = 3, stamp_offset_ns: int = 0) -> None:
        self._arms_after = arms_after
        self._stamp_offset_ns = stamp_offset_ns
        self._pose = ORIGIN
        self.fault: ChassisMode | None = None
        self.armed_at_ns: list[int] = []
        self.stopped_at_ns: list[int] = []
        self.sent: list[Setpoint] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def arm(self, now_ns: int) -> None:
        """Note when."""
        self.armed_at_ns.append(now_ns)

    def stop(self, now_ns: int) -> None:
        """Note when."""
        self.stopped_at_ns.append(now_ns)

    def exchange(self, setpoint: Setpoint | None, now_ns: int) -> ChassisState:
        """Drive exactly so for a control period."""
        setpoint = setpoint or Setpoint(now_ns, 0.0, 0.0, 0.0)
        self.sent.append(setpoint)
        mode = ChassisMode.ARMED if len(self.sent) > self._arms_after else ChassisMode.ARMING
        mode = self.fault or mode
        if mode is ChassisMode.ARMED:
            self._pose = advance_pose(self._pose, setpoint.v_mps, setpoint.w_radps, PERIOD_S)
        reason = "e-stop pressed" if self.fault else ""
        return chassis_state(
            now_ns + self._stamp_offset_ns, mode, setpoint.v_mps, self._pose, reason, setpoint
        )
