"""Clocks and progress of the bench, for its tests."""

from __future__ import annotations

from collections.abc import Callable


def every(step_ns: int) -> Callable[[], int]:
    """A clock on which step_ns pass between two readings."""
    readings = iter(range(0, 1 << 62, step_ns))
    return lambda: next(readings)


class Ticks:
    """Counts how often it is told of progress."""

    def __init__(self) -> None:
        self.count = 0

    def __call__(self) -> None:
        self.count += 1
