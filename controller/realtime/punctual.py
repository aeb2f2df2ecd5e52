"""Commands that leave at the same moment of every period, however long the decision before them took, and
whoever looks at them last knows when they leave.
"""

from __future__ import annotations

from hal.api import Chassis, Clock
from hal.device_wrapper import DeviceWrapper
from hal.types import ChassisState, Setpoint

# Of the period, after its beginning: later than nearly every decision takes, and only this much older.
_HOLD_SHARE = 0.2


class PunctualChassis(DeviceWrapper):
    """hal.api.Chassis around another one, for a loop that steps at a fixed rate on absolute deadlines.

    The first exchange sets the beat; each later one is held until a fifth of its period is over. A step
    that took longer goes out at once.

    A step has one time, that of its beginning, which its setpoint is stamped with. What is behind this object
    is told the time that it is: else a setpoint were never old, however long the step took, and neither the
    output guard nor the driver could refuse it. The state says by its stamp_ns for when it holds.
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
        # The nearest beat: the first step may itself have been a little late.
        beats = (now_ns - self._first_ns + self._period_ns // 2) // self._period_ns
        began_ns = self._first_ns + beats * self._period_ns
        self._clock.sleep_until_ns(began_ns + self._hold_ns)
        return self._chassis.exchange(setpoint, self._clock.now_ns())

    def arm(self, now_ns: int) -> None:
        """See hal.api.Chassis."""
        self._chassis.arm(self._clock.now_ns())

    def stop(self, now_ns: int) -> None:
        """See hal.api.Chassis."""
        self._chassis.stop(self._clock.now_ns())
