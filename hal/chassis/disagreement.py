"""Compares two sensors of the same motion once a second. Beyond a threshold, one of them must be wrong."""

from __future__ import annotations

from hal.clocks import NS_PER_S

_WINDOW_NS = NS_PER_S


class Disagreement:
    """sentence: "" while both agree, and until the first second is full.

    title: the beginning of the sentence. unit: of both sums.
    slack, ratio: the threshold is slack + ratio * |expected sum|.
    """

    def __init__(self, title: str, unit: str, slack: float, ratio: float) -> None:
        self.sentence = ""
        self._title = title
        self._unit = unit
        self._slack = slack
        self._ratio = ratio
        self._measured = 0.0
        self._expected = 0.0
        self._window_start_ns: int | None = None

    def expect(self, amount: float) -> None:
        """Add a motion that the reference sensor reported."""
        self._expected += amount

    def compare(self, amount: float, now_ns: int) -> None:
        """Add a motion that the other sensor reported up to now_ns; once a second, compare the sums."""
        if self._window_start_ns is None:
            self.restart(now_ns)
            self._measured = amount
            return
        self._measured += amount
        if now_ns - self._window_start_ns < _WINDOW_NS:
            return
        difference = abs(self._measured - self._expected)
        self.sentence = (
            f"{self._title}: {self._measured:.2f} {self._unit} against {self._expected:.2f} {self._unit}"
            if difference > self._slack + self._ratio * abs(self._expected)
            else ""
        )
        self.restart(now_ns)

    def restart(self, now_ns: int) -> None:
        """Restart the comparison from here, because one of the sensors restarted."""
        self._measured = self._expected = 0.0
        self._window_start_ns = now_ns
