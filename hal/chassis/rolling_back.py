"""Detects a base that rolls backwards without being told to: a slope is too steep for it, or a motor turns
the wrong way. No camera looks behind the robot."""

from __future__ import annotations

import math

from hal.clocks import NS_PER_S
from hal.types import PlanarPose

# Length of one measurement; two in a row must show rolling back.
_WINDOW_NS = NS_PER_S // 2
# Minimum mean speed that counts as rolling back: tracks spring back when a stop ends, but more slowly.
_MIN_MPS = 0.05


class RollingBack:
    """sentence: "" until a base that should stand or go forward has rolled back for a second."""

    def __init__(self) -> None:
        self.sentence = ""
        self._pose: PlanarPose | None = None
        self._since_ns, self._back_m, self._rolled_before = 0, 0.0, False

    def step(self, pose: PlanarPose, now_ns: int, *, expected: bool) -> None:
        """Take in the reported pose. expected: the base may go back, because it is commanded or pushed."""
        last, self._pose = self._pose, pose
        if last is None or expected:
            self.sentence = ""
            self._since_ns, self._back_m, self._rolled_before = now_ns, 0.0, False
            return
        cos, sin = math.cos(last.heading_rad), math.sin(last.heading_rad)
        self._back_m -= (pose.x_m - last.x_m) * cos + (pose.y_m - last.y_m) * sin
        if now_ns - self._since_ns < _WINDOW_NS:
            return
        back_mps = self._back_m * NS_PER_S / (now_ns - self._since_ns)
        rolling = back_mps >= _MIN_MPS
        if rolling and self._rolled_before:
            self.sentence = (
                f"the base rolls back at {back_mps:.2f} m/s: does it hold itself on this slope, "
                "and do its motors turn the right way?"
            )
        self._since_ns, self._back_m, self._rolled_before = now_ns, 0.0, rolling
