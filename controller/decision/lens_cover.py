"""Whether somebody stands so near to the lens that depth fails: noticed by what is not seen.

Floor that was seen free stays free once it is too near to be seen again (controller/decision/sight.py). That
says nothing of who has come since: within 0.3 m of the lens hardly any camera measures, and whoever is there
leaves bands of the view without any data, from the lowest row to the uppermost one.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from hal.compiled import compiled
from hal.types import FloatArray
from vision.scene import FreeSpace

BoolArray = NDArray[np.bool_]

COVERED = "right before the camera nothing is seen, neither floor nor what stands on it"

_LENS_M = 0.3
# 0.1 m right before the lens: nobody hides less. Beside a way between panes of glass as much as 0.3 is blank.
_HIDES_TAN = 0.33
# One frame's outlier must not brake; three frames of five are a tenth of a second.
_FRAMES = 5


class LensCover:
    """look() once a scene. covered: a part of the way right ahead that has been seen shows nothing any more,
    or most of it has never shown anything."""

    def __init__(self) -> None:
        self.covered = False
        self._found: deque[bool] = deque(maxlen=_FRAMES)
        # Where the colour image is wider than depth, the sides never show anything, and hide nobody.
        self._shown = np.zeros(0, np.bool_)

    def look(self, free: FreeSpace, half_width_m: float, left_m: float) -> None:
        """half_width_m: of what the robot sweeps; left_m: of the camera from its middle."""
        blank = _blank(free)
        if len(self._shown) != len(blank):
            self._shown = np.zeros(len(blank), np.bool_)
        self._shown, hidden, ahead, never = _right_ahead(
            free.bearing_tan, blank, self._shown, half_width_m, left_m
        )
        wide = 2.0 * free.half_width_tan * hidden >= _HIDES_TAN
        self._found.append(wide or not len(blank) or 2 * never > ahead)
        self.covered = 2 * sum(self._found) > len(self._found)


def _blank(free: FreeSpace) -> BoolArray:
    """(B,) bands without any data; what perception does not tell of them is as what the scan shows."""
    if free.blank is not None:
        return free.blank
    return ~(free.known_m > 0.0) & ~np.isfinite(free.nearest_m)


@compiled("float64[:], boolean[:], boolean[:], float64, float64")
def _right_ahead(
    bearing_tan: FloatArray, blank: BoolArray, shown: BoolArray, half_width_m: float, left_m: float
) -> tuple[BoolArray, int, int, int]:
    """Which bands (B,) have ever shown something, those before this scene being shown; how many right ahead
    side by side do not any more; how many are ahead, and how many of these never have."""
    shown = shown | ~blank
    longest, run, ahead, never = 0, 0, 0, 0
    for b in range(len(bearing_tan)):
        within = abs(bearing_tan[b] * _LENS_M - left_m) <= half_width_m
        run = run + 1 if within and blank[b] and shown[b] else 0
        longest = max(longest, run)
        ahead += within
        never += within and not shown[b]
    return shown, longest, ahead, never
