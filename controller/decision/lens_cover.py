"""Whether something stands so near to the lens that depth fails; noticed by bands without data.

Floor that was seen free stays free once it is too near to be seen again (controller/decision/known_floor.py),
even if somebody has stepped onto it since. Within 0.3 m of the lens hardly any camera measures depth, so
whoever is there leaves bands of the view without any data, from the lowest row to the uppermost one.
controller/decision/world_model.py calls LensCover once a scene.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from hal.compiled import compiled
from hal.types import Flags, FloatArray
from vision.scene import FreeSpace

COVERED = "right before the camera nothing is seen, neither floor nor what stands on it"

# Nearer than this hardly any camera measures depth.
_LENS_M = 0.3
# Minimum width of the blank bands, as a tangent: 0.1 m at _LENS_M; a person hides more. Beside a way between
# panes of glass up to 0.3 may be blank with nobody there.
_HIDES_TAN = 0.33
# The majority of this many scenes decides: one outlier must not brake; three frames are a tenth of a second.
_FRAMES = 5


class LensCover:
    """Call look() once a scene.

    covered: bands right ahead that have shown something before are blank now, or most bands right ahead have
    never shown anything.
    """

    def __init__(self) -> None:
        self.covered = False
        self._found: deque[bool] = deque(maxlen=_FRAMES)
        # Bands that ever had data. Where the colour image is wider than depth, the sides never have any.
        self._shown = np.zeros(0, np.bool_)
        self._bearing_tan: FloatArray = np.zeros(0)

    def look(self, free: FreeSpace, half_width_m: float, left_m: float) -> None:
        """Take in one scene.

        half_width_m: half of the swept width. left_m: offset of the camera to the left of the robot's middle.
        """
        blank = _blank(free)
        if not self._same_bands(free):
            self._shown, self._bearing_tan = np.zeros(len(blank), np.bool_), free.bearing_tan
        self._shown, hidden, ahead, never = _right_ahead(
            free.bearing_tan, blank, self._shown, half_width_m, left_m
        )
        wide = 2.0 * free.half_width_tan * hidden >= _HIDES_TAN
        self._found.append(wide or not len(blank) or 2 * never > ahead)
        self.covered = 2 * sum(self._found) > len(self._found)

    def _same_bands(self, free: FreeSpace) -> bool:
        """Whether the bands are those that have shown something before, to within half a band."""
        bearing_tan = self._bearing_tan
        if free.bearing_tan is bearing_tan:
            return True
        return len(free.bearing_tan) == len(bearing_tan) and bool(
            (np.abs(free.bearing_tan - bearing_tan) <= free.half_width_tan).all()
        )


def _blank(free: FreeSpace) -> Flags:
    """(B,) bands without any data; taken from the scan itself if perception does not tell."""
    if free.blank is not None:
        return free.blank
    return ~(free.known_m > 0.0) & ~np.isfinite(free.nearest_m)


@compiled("float64[:], boolean[:], boolean[:], float64, float64")
def _right_ahead(
    bearing_tan: FloatArray, blank: Flags, shown: Flags, half_width_m: float, left_m: float
) -> tuple[Flags, int, int, int]:
    """What the B bands show, of which blank (B,) show nothing now and shown (B,) showed something before.

    Returns which bands have ever shown something (B,); the length of the longest run of bands right ahead
    that are blank now but were not before; how many bands are right ahead; how many of these were always
    blank.
    """
    shown = shown | ~blank
    longest, run, ahead, never = 0, 0, 0, 0
    for b in range(len(bearing_tan)):
        within = abs(bearing_tan[b] * _LENS_M - left_m) <= half_width_m
        run = run + 1 if within and blank[b] and shown[b] else 0
        longest = max(longest, run)
        ahead += within
        never += within and not shown[b]
    return shown, longest, ahead, never
