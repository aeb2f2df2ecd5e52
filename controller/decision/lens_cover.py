"""Whether somebody stands so near to the lens that depth fails: noticed by what is not seen.

Floor that was seen free stays free once it is too near to be seen again (controller/decision/sight.py). That
says nothing of who has come since: within 0.3 m of the lens hardly any camera measures, and whoever is there
leaves bands of the view without any data, from the lowest row to the uppermost one.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from vision.scene import FreeSpace

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
        self._shown |= ~blank
        ahead = np.abs(free.bearing_tan * _LENS_M - left_m) <= half_width_m
        hides = ahead & blank & self._shown
        never = np.count_nonzero(ahead & ~self._shown)
        wide = 2.0 * free.half_width_tan * _longest_run(hides) >= _HIDES_TAN
        self._found.append(bool(wide or not len(blank) or 2 * never > np.count_nonzero(ahead)))
        self.covered = 2 * sum(self._found) > len(self._found)


def _blank(free: FreeSpace) -> NDArray[np.bool_]:
    """(B,) bands without any data; what perception does not tell of them is as what the scan shows."""
    if free.blank is not None:
        return free.blank
    return ~(free.known_m > 0.0) & ~np.isfinite(free.nearest_m)


def _longest_run(chosen: NDArray[np.bool_]) -> int:
    """How many of chosen (B,) are set side by side."""
    if not chosen.any():
        return 0
    turns = np.flatnonzero(np.diff(chosen.astype(np.int8), prepend=0, append=0))
    return int((turns[1::2] - turns[::2]).max())
