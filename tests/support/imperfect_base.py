"""A chassis that lags, drops commands and sticks, for tests of what drives it."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

from hal.geometry import advance_pose
from hal.types import ChassisMode, ChassisState, Setpoint
from tests.support.obedient_chassis import PERIOD_S
from tests.support.scenes import ORIGIN, chassis_state


@dataclass
class ImperfectBase:
    """hal.api.Chassis: with a lag and a dead time; it stops 0.5 s after the last command it received.

    unresponsive_s: (from, to) after the first command to move, during which it ignores commands. gain: true
    over commanded speed. report_every: control periods per report. stiction_s: how long it stands still after
    the first command to move. speeds: its true speeds.
    """

    lag_s: float = 0.08
    dead_time_s: float = 0.0
    unresponsive_s: tuple[float, float] = (math.inf, math.inf)
    gain: float = 1.0
    report_every: int = 1
    stiction_s: float = 0.0
    speeds: list[float] = field(default_factory=list)
    sent: list[Setpoint] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._pose = ORIGIN
        self._v = self._target = 0.0
        self._last_command_s = -math.inf
        self._first_motion_s: float | None = None
        self._in_transit: deque[tuple[float, float]] = deque()
        self._last_report: tuple[float, int] = (0.0, 0)

    def __enter__(self) -> ImperfectBase:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def arm(self, now_ns: int) -> None:
        """Nothing to do."""

    def stop(self, now_ns: int) -> None:
        """Nothing to do."""

    def exchange(self, setpoint: Setpoint | None, now_ns: int) -> ChassisState:
        """Drive for a control period."""
        setpoint = setpoint or Setpoint(now_ns, 0.0, 0.0, 0.0)
        self.sent.append(setpoint)
        now_s = now_ns / 1e9
        if setpoint.v_mps > 0.0 and self._first_motion_s is None:
            self._first_motion_s = now_s
        self._receive(setpoint.v_mps, now_s)
        for _ in range(20):
            self._v += (self.gain * self._target - self._v) * -math.expm1(-PERIOD_S / 20 / self.lag_s)
            self._pose = advance_pose(self._pose, self._v, 0.0, PERIOD_S / 20)
        self.speeds.append(self._v)
        if len(self.sent) % self.report_every == 0:
            self._last_report = self._v, now_ns
        mode = ChassisMode.ARMED if len(self.sent) > 3 else ChassisMode.ARMING
        state = chassis_state(now_ns, mode, self._last_report[0], self._pose, "", setpoint)
        return ChassisState(
            state.stamp_ns, mode, "", self._last_report[1], state.v_mps, 0.0, self._pose, 48.0, (), setpoint
        )

    def _receive(self, v_mps: float, now_s: float) -> None:
        moving_s = 0.0 if self._first_motion_s is None else now_s - self._first_motion_s
        self._in_transit.append((now_s, v_mps))
        unresponsive = self.unresponsive_s[0] <= moving_s < self.unresponsive_s[1]
        while self._in_transit and self._in_transit[0][0] <= now_s - self.dead_time_s + 1e-9:
            _, command_mps = self._in_transit.popleft()
            if not unresponsive:
                self._target, self._last_command_s = command_mps, now_s
        if now_s - self._last_command_s > 0.5 or moving_s < self.stiction_s:
            self._target = 0.0
