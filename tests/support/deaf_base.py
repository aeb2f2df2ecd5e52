"""A chassis for tests of what drives it: does not always do what it is told."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

from hal.geometry import advance_pose
from hal.types import ChassisMode, ChassisState, Setpoint
from tests.support.obedient_chassis import PERIOD_S
from tests.support.scenes import ORIGIN, chassis_state


@dataclass
class DeafBase:
    """hal.api.Chassis: with a lag and a dead time, and 0.5 s after the last command that it heard it stops.

    deaf_s: between these times, after the first command to move, it hears nothing. gain: what it makes of a
    command. report_every: in how many control periods it reports once. sticks_s: how long it stands when it
    is told to move. speeds: its true ones.
    """

    lag_s: float = 0.08
    dead_s: float = 0.0
    deaf_s: tuple[float, float] = (math.inf, math.inf)
    gain: float = 1.0
    report_every: int = 1
    sticks_s: float = 0.0
    speeds: list[float] = field(default_factory=list)
    sent: list[Setpoint] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._pose = ORIGIN
        self._v = self._target = 0.0
        self._heard_s = -math.inf
        self._moves_s: float | None = None
        self._on_its_way: deque[tuple[float, float]] = deque()
        self._reported: tuple[float, int] = (0.0, 0)

    def __enter__(self) -> DeafBase:
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
        if setpoint.v_mps > 0.0 and self._moves_s is None:
            self._moves_s = now_s
        self._hear(setpoint.v_mps, now_s)
        for _ in range(20):
            self._v += (self.gain * self._target - self._v) * -math.expm1(-PERIOD_S / 20 / self.lag_s)
            self._pose = advance_pose(self._pose, self._v, 0.0, PERIOD_S / 20)
        self.speeds.append(self._v)
        if len(self.sent) % self.report_every == 0:
            self._reported = self._v, now_ns
        mode = ChassisMode.ARMED if len(self.sent) > 3 else ChassisMode.ARMING
        state = chassis_state(now_ns, mode, self._reported[0], self._pose, "", setpoint)
        return ChassisState(
            state.stamp_ns, mode, "", self._reported[1], state.v_mps, 0.0, self._pose, 48.0, (), setpoint
        )

    def _hear(self, v_mps: float, now_s: float) -> None:
        moving_s = 0.0 if self._moves_s is None else now_s - self._moves_s
        self._on_its_way.append((now_s, v_mps))
        deaf = self.deaf_s[0] <= moving_s < self.deaf_s[1]
        while self._on_its_way and self._on_its_way[0][0] <= now_s - self.dead_s + 1e-9:
            _, told_mps = self._on_its_way.popleft()
            if not deaf:
                self._target, self._heard_s = told_mps, now_s
        if now_s - self._heard_s > 0.5 or moving_s < self.sticks_s:
            self._target = 0.0
