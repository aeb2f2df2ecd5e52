"""A shaper on a chassis that lags, for tests."""

from __future__ import annotations

import math

from config.robot import Limits
from controller.shape import ShapedSpeed, SpeedShaper

PERIOD_S = 0.02


class Run:
    """Drives a shaper on a chassis that lags by a first-order delay, with odometry of it."""

    def __init__(self, length_m: float, lag_s: float = 0.0, delay_s: float = 0.0, gain: float = 1.0) -> None:
        self.shaper = SpeedShaper(Limits(), PERIOD_S, delay_s)
        self.length_m, self.lag_s, self.gain = length_m, lag_s, gain
        self.x_m = self.v_mps = self.time_s = 0.0
        self.commands: list[ShapedSpeed] = []

    def step(self, target: float = 1.5, emergency: bool = False) -> ShapedSpeed:
        command = self.shaper.step(target, emergency=emergency, distance_to_end_m=self.length_m - self.x_m)
        gain = 1.0 - math.exp(-PERIOD_S / self.lag_s) if self.lag_s else 1.0
        next_mps = self.v_mps + gain * (self.gain * command.v_mps - self.v_mps)
        self.x_m += 0.5 * (self.v_mps + next_mps) * PERIOD_S
        self.v_mps = next_mps
        self.time_s += PERIOD_S
        self.commands.append(command)
        return command

    def until_rest(self, limit_s: float = 120.0) -> None:
        while self.time_s < limit_s:
            command = self.step()
            if self.time_s > 1.0 and command.v_mps == 0.0 and self.v_mps < 1e-4:
                return
        raise AssertionError("never came to rest")
