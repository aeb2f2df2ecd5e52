"""Punctual commands: each leaves at the same time within its period, however long the decision takes.

The chassis behind it gets the time at which a command leaves, so that it can refuse an old one.
"""

from __future__ import annotations

from hal.api import Chassis, Clock
from hal.device_wrapper import DeviceWrapper
from hal.types import ChassisState, Setpoint

# Commands are held until this share of the period is over: longer than nearly every decision takes, and a
# command gets older by no more than that.
_HOLD_SHARE = 0.2


class PunctualChassis(DeviceWrapper):
    """hal.api.Chassis around another one, for a loop that steps at a fixed rate on absolute deadlines.

    The first exchange defines when periods begin. Each later one is held until _HOLD_SHARE of its period is
    over. If a step took longer, its command leaves at once.

    A step has one time: its setpoint is stamped with the time at which the step began. The chassis behind
    this object gets the present time instead. Otherwise no setpoint would ever be old, however long the step
    took, and neither the output guard nor the driver could refuse it. The state that it returns says by its
    stamp_ns for when it holds.
    """

    def __init__(self, chassis: Chassis, clock: Clock, period_ns: int) -> None:
        super().__init__(chassis)
        self._chassis = chassis
        self._clock = clock
        self._period_ns = period_ns
        self._hold_ns = round(_HOLD_SHARE * period_ns)
        self._first_ns: int | None = None

    def exchange(self, setpoint: Setpoint | None, now_ns: int) -> ChassisState:
        """See hal.api.Chassis. now_ns: when the step began, within the period to which it belongs."""
        if self._first_ns is None:
            self._first_ns = now_ns
        # The nearest period, because the first step may itself have been a little late.
        periods = (now_ns - self._first_ns + self._period_ns // 2) // self._period_ns
        began_ns = self._first_ns + periods * self._period_ns
        self._clock.sleep_until_ns(began_ns + self._hold_ns)
        return self._chassis.exchange(setpoint, self._clock.now_ns())

    def arm(self, now_ns: int) -> None:
        """See hal.api.Chassis."""
        self._chassis.arm(self._clock.now_ns())

    def stop(self, now_ns: int) -> None:
        """See hal.api.Chassis."""
        self._chassis.stop(self._clock.now_ns())
