"""Parts of floor vectors along a direction and to its left, for compiled loops (hal/compiled.py)."""

from __future__ import annotations

from hal.compiled import inlined


@inlined
def along_and_left(x: float, y: float, cos: float, sin: float) -> tuple[float, float]:
    """The parts of the vector (x, y) along the direction with this cosine and sine, and to its left."""
    return x * cos + y * sin, y * cos - x * sin
