"""A battery whose voltage stays low: most bases report the voltage, but no fault for it."""

from __future__ import annotations

from hal.clocks import NS_PER_S

# A start or a ramp pulls the voltage down for a moment.
_LASTING_NS = 3 * NS_PER_S


class LowBattery:
    """sentence: what to tell the operator; "" as long as the voltage is unknown, high enough, or low for less
    than 3 s. limit_v: None means that any voltage is high enough."""

    def __init__(self, limit_v: float | None) -> None:
        self._limit_v = limit_v
        self._low_since_ns: int | None = None
        self.sentence = ""

    def step(self, voltage_v: float, now_ns: int) -> None:
        """Take in the newest voltage; NaN is unknown."""
        if self._limit_v is None or not voltage_v < self._limit_v:
            self._low_since_ns, self.sentence = None, ""
            return
        if self._low_since_ns is None:
            self._low_since_ns = now_ns
        if now_ns - self._low_since_ns >= _LASTING_NS:
            self.sentence = f"warning: battery below {self._limit_v:g} V"
